"""Model fields with a value per simulation: which there are, and the parameters of a simulation that they become."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from tightloop.errors import ArgumentError
from tightloop.mujoco import reflected
from tightloop.mujoco.batch import gains, masses, varied_fields
from tightloop.mujoco.batch.library import mujoco

Array = NDArray[Any]

#: Model fields that are a parameter of the simulation with the same values and order.
_SAME = {
    "gravity": "gravity",
    "dof_armature": "joint_armature",
    "dof_damping": "joint_damping",
    "dof_frictionloss": "joint_friction",
}
#: Flags that make a field count as 0, whatever its values.
_SWITCHES = {
    "gravity": ("mjDSBL_GRAVITY",),
    "dof_damping": ("mjDSBL_DAMPER",),
    "dof_frictionloss": ("mjDSBL_FRICTIONLOSS", "mjDSBL_CONSTRAINT"),
}
#: Constants that `mj_setConst` computes and that act: what makes contacts and limits soft.
_SOFTNESS = ("body_invweight0", "dof_invweight0")
#: Model fields that become parameters.
_VARYING = (*_SAME, *masses.FIELDS, *gains.PARAMS, *varied_fields.FIELDS, *_SOFTNESS)
#: What ``mj_setConst`` computes. All but `_SOFTNESS` is for reading.
CONSTANTS = (
    "body_subtreemass body_invweight0 dof_invweight0 dof_M0 tendon_length0 tendon_invweight0 actuator_length0 "
    "actuator_acc0 cam_pos0 cam_poscom0 cam_mat0 light_pos0 light_poscom0 light_dir0"
).split()
#: Beginnings of the names of fields without influence on the motion: of pictures, of the user, of MuJoCo's broad phase.
_IDLE = (
    *("cam_", "light_", "mat_", "skin_", "geom_rgba", "geom_matid", "geom_group", "site_rgba", "site_group"),
    *("site_matid", "tendon_rgba", "tendon_width", "tendon_group", "tendon_matid", "jnt_group", "geom_rbound"),
    *("geom_aabb", "bvh_", "body_user", "jnt_user", "geom_user", "site_user", "tendon_user", "actuator_user"),
    *("sensor_user", "body_margin", "body_contype", "body_conaffinity"),
)
#: Beginnings of the names of assets, which are not expanded.
_ASSETS = ("mesh_", "hfield_", "tex_", "skin_", "bvh_", "text_", "name_", "numeric_", "tuple_", "key_", "plugin_")
#: Integers of ``MjModel`` that may differ. Others say how the model is built.
_CHOICES = frozenset(
    """eq_type eq_active0 geom_type geom_contype geom_conaffinity geom_condim geom_priority jnt_limited jnt_group
    jnt_actfrclimited jnt_actgravcomp pair_dim tendon_limited tendon_actfrclimited tendon_group actuator_actlimited
    actuator_ctrllimited actuator_forcelimited actuator_actearly actuator_biastype actuator_dyntype actuator_gaintype
    actuator_group body_simple body_sameframe geom_sameframe site_sameframe dof_simplenum""".split()
)
_SLEEP = int(mujoco.mjtEnableBit.mjENBL_SLEEP)


def is_idle(name: str) -> bool:
    """Whether a field of this name has no influence on the motion."""
    return name.startswith(_IDLE)


def _senses_cameras(model: Any) -> bool:
    """Whether some sensor is of a camera, or seen from one."""
    camera = int(mujoco.mjtObj.mjOBJ_CAMERA)
    return any(camera in np.asarray(kinds) for kinds in (model.sensor_objtype, model.sensor_reftype))


def can_vary(name: str) -> bool:
    """Whether a field may differ between simulations."""
    return name in _VARYING


class Expansions:
    """Arrays ``(num_sims, ...)`` of model fields.

    Args:
        model: The batch's own copy of the model.
        num_sims: Number of simulations.
        instead: What the caller can do about a field that cannot differ, for errors.
    """

    def __init__(self, model: Any, num_sims: int, instead: str = "make a Batch per value") -> None:
        self._model, self._sims, self._instead = model, num_sims, instead
        self._arrays: dict[str, Array] = {}
        self._inertias = masses.Inertias(np.asarray(model.body_iquat))
        #: Whether MuJoCo compensates gravity at all, ``(num_sims,)``: it skips it until `set_const` finds a share.
        self.compensated = np.full(num_sims, bool((np.asarray(model.body_gravcomp) > 0.0).any()))

    def over(self, model: Any) -> Expansions:
        """Return the same fields as parameters of another model, which has the values that are no parameters."""
        other = copy.copy(self)
        other._model, other._inertias = model, masses.Inertias(np.asarray(model.body_iquat))
        return other

    def __contains__(self, name: str) -> bool:
        """Whether ``MjModel`` or ``MjOption`` has a field of this name."""
        return not name.startswith("_") and self._template(name) is not None

    def _template(self, name: str) -> Array | None:
        for home in (self._model, self._model.opt):
            value = getattr(home, name, None)
            if isinstance(value, np.ndarray) and value.dtype.kind in "fiub":
                return value
        # of MjOption scalars expand, too; those of MjModel are sizes
        value = getattr(self._model.opt, name, None)
        return None if value is None or callable(value) else np.asarray(value, type(value))

    def _is_idle(self, name: str) -> bool:
        # cameras move nothing, but sensors may be of them
        return is_idle(name) and not (name.startswith("cam_") and _senses_cameras(self._model))

    @property
    def names(self) -> tuple[str, ...]:
        """Expanded fields."""
        return tuple(self._arrays)

    def of(self, name: str) -> Array:
        """Return the values of a field: of each simulation if it is expanded, else ``(1, ...)`` of the model."""
        if name in self._arrays:
            return self._arrays[name]
        template = self._template(name)
        assert template is not None
        return template[None]

    def get(self, name: str, dtype: DTypeLike | None) -> Array:
        """Return the array of a field, the same one at each call.

        Raises:
            ArgumentError: The field is of assets, or the dtype is not one of the field's.
        """
        template = self._template(name)
        assert template is not None
        if name.startswith(_ASSETS):
            raise ArgumentError(f"{name} is asset data, which all simulations share; make a Batch per model instead")
        scalar = np.dtype(np.int32) if template.dtype.kind in "iu" and template.ndim == 0 else template.dtype
        wanted = scalar if dtype is None else np.dtype(dtype)
        if wanted != scalar and not (scalar == np.float64 and wanted == np.float32):
            raise ArgumentError(f"{name} cannot be {wanted}; expand it as {scalar}")
        if name not in self._arrays:
            self._arrays[name] = np.repeat(template[None], self._sims, axis=0).astype(wanted)
        if self._arrays[name].dtype != wanted:
            raise ArgumentError(f"{name} is already expanded as {self._arrays[name].dtype}; give that dtype")
        return self._arrays[name]

    def _is_parameter(self, name: str) -> bool:
        """Whether a field acts as parameters. A medium drags boxes of the model's masses."""
        in_medium = self._model.opt.density > 0.0 or self._model.opt.viscosity > 0.0
        return name in _VARYING and not (in_medium and name in masses.FIELDS)

    @property
    def _masses(self) -> tuple[str, ...]:
        """Parameters of expanded masses."""
        return masses.params([name for name in self._arrays if self._is_parameter(name)])

    def params(self) -> tuple[str, ...]:
        """Return the parameters that must vary for what is expanded."""
        found = [_SAME[name] for name in self._arrays if name in _SAME]
        found.extend(self._masses)
        found.extend(param for name, param in gains.PARAMS.items() if name in self._arrays)
        for name in self._arrays:
            if name in varied_fields.FIELDS:
                found.extend(varied_fields.FIELDS[name].params(self._model))
        found.extend(name for name in _SOFTNESS if name in self._arrays)
        return tuple(found)

    @property
    def needs_shapes(self) -> bool:
        """Whether a field of geoms is expanded."""
        return any(name in self._arrays for name in varied_fields.GEOM_FIELDS)

    def values(self, shapes: list[int], ids: Array) -> dict[str, Array]:
        """Return the parameters of all simulations, ``(num_sims, columns)``, after a check of the given ones.

        Args:
            shapes: The geom of each shape of the simulation.
            ids: Indices of the simulations that are about to run.

        Raises:
            ArgumentError: A value cannot be taken over; the message has the simulation and the field.
        """
        self.check_fixed(ids)
        for name, array in self._arrays.items():
            if not self._is_parameter(name):
                continue
            self._check_finite(name, ids)
            wrong, problem = self._inexpressible(name, array[ids])
            if wrong.any():
                sim = ids[int(wrong.reshape(len(ids), -1).any(axis=1).argmax())]
                raise ArgumentError(f"sim {sim}: {name} {problem}")
        return self.checked_values(shapes)

    def checked_values(self, shapes: list[int]) -> dict[str, Array]:
        """Return the parameters as `values` does, where `fixed` has checked the simulations that are about to run."""
        found = {}
        for name, array in self._arrays.items():
            if not self._is_parameter(name):
                continue
            if name in _SAME:
                found[_SAME[name]] = (array.astype(np.float64) + self._share(name)) * self._switch(name)
            elif name in gains.PARAMS:
                found[gains.PARAMS[name]] = gains.factors(self._model, name, array)
            elif name in varied_fields.FIELDS:
                found |= varied_fields.FIELDS[name].values(self._model, array, shapes)
        if "body_gravcomp" in found:
            found["body_gravcomp"] = found["body_gravcomp"] * self.compensated[:, None]
        bodies = self._model.nbody
        wanted = self._masses
        if "body_mass" in wanted:
            found["body_mass"] = np.broadcast_to(self.of("body_mass"), (self._sims, bodies)).astype(np.float64)
            tensors = self._inertias.of(self.of("body_inertia"))
            found["body_inertia"] = np.broadcast_to(tensors, (self._sims, bodies, 6))
        if "body_com" in wanted:
            found["body_com"] = self._arrays["body_ipos"].astype(np.float64)
        if "body_invweight0" in self._arrays:
            # the first of both is of translation, which contacts have
            found["body_invweight0"] = self._arrays["body_invweight0"][..., 0].astype(np.float64)
        if "dof_invweight0" in self._arrays:
            found["dof_invweight0"] = self._arrays["dof_invweight0"].astype(np.float64)
        return found

    def _share(self, name: str) -> Array | float:
        """Return what actuators of the model add to a field of dofs, ``(nv,)``."""
        if name not in ("dof_armature", "dof_damping"):
            return 0.0
        armature, damping = reflected.shares(self._model)
        return armature if name == "dof_armature" else damping[:, 0]

    def _switch(self, name: str) -> float:
        flags = [getattr(mujoco.mjtDisableBit, flag, 0) for flag in _SWITCHES.get(name, ())]
        return 0.0 if any(self._model.opt.disableflags & int(flag) for flag in flags) else 1.0

    def _check_finite(self, name: str, ids: Array) -> None:
        array = self._arrays[name][ids].reshape(len(ids), -1)
        wrong = np.flatnonzero(~np.isfinite(array).all(axis=1))
        if len(wrong):
            raise ArgumentError(f"sim {ids[wrong[0]]}: {name} is not finite")

    def _inexpressible(self, name: str, values: Array) -> tuple[NDArray[np.bool_], str]:
        """Return which elements of values ``(n, ...)`` no parameter can express, and what is wrong with them."""
        if name in varied_fields.FIELDS:
            field = varied_fields.FIELDS[name]
            return field.wrong(self._model, values), field.problem
        if name in gains.PARAMS:
            problem = "of a muscle or a DC motor, or with velocity of an adhesion, cannot differ"
            return gains.inexpressible(self._model, name, values), problem
        if name not in _SAME or name == "gravity":
            return np.zeros(values.shape, bool), ""
        # tightloop has other dofs for free joints: velocities of the centre of mass, in world axes
        free = self._model.jnt_type[self._model.dof_jntid] == mujoco.mjtJoint.mjJNT_FREE
        moved = (values != getattr(self._model, name).astype(values.dtype)) & free
        return moved, "of a free joint cannot differ from the model's; write other dofs only"

    def fixed(self, ids: Array) -> dict[str, tuple[NDArray[np.bool_], Array]]:
        """Return the fields with values that only another model has.

        Returns:
            By name: the simulations that need it, ``(len(ids),)``, and the field of these models, ``(len(ids), ...)``.
            Elements that parameters express are the model's.

        Raises:
            ArgumentError: A value says how the model is built, is not finite, or enables sleep.
        """
        self.check_sleep(ids)
        self.check_structure(ids)
        fields = {}
        for name, array in self._arrays.items():
            if not self._is_parameter(name):
                if not (name in CONSTANTS or self._is_idle(name)) and (needs := self.differs(name, ids)).any():
                    fields[name] = needs, array[ids]
                continue
            self._check_finite(name, ids)
            wrong, _ = self._inexpressible(name, array[ids])
            if wrong.any():
                template = np.asarray(self._template(name)).astype(array.dtype)
                fields[name] = wrong.reshape(len(ids), -1).any(axis=1), np.where(wrong, array[ids], template)
        return fields

    def check_structure(self, ids: Array, free: tuple[str, ...] = ()) -> None:
        """Check that integers that say how the model is built, but for those of `free`, have the values of the model.

        Raises:
            ArgumentError: One has not; the message has the simulation and the field.
        """
        for name, array in self._arrays.items():
            is_choice = name in _CHOICES or not hasattr(self._model, name) or self._is_idle(name)
            if array.dtype.kind not in "iub" or is_choice or name in free:
                continue
            differs = self.differs(name, ids)
            if differs.any():
                raise ArgumentError(
                    f"sim {ids[int(differs.argmax())]}: {name} differs from the model's and says how a model is built; "
                    f"{self._instead}"
                )

    def check_sleep(self, ids: Array) -> None:
        """Check that no simulation is to sleep.

        Raises:
            ArgumentError: One is; the message has the simulation.
        """
        asleep = (self.of("enableflags") & _SLEEP) != 0
        asleep = np.broadcast_to(asleep, self._sims)[ids]
        if asleep.any():
            raise ArgumentError(f"sim {ids[int(asleep.argmax())]}: sleep cannot be enabled in a Batch")

    def differs(self, name: str, ids: Array) -> NDArray[np.bool_]:
        """Return in which simulations a field has other values than the model's, ``(len(ids),)``."""
        array = self._arrays[name]
        template = np.asarray(self._template(name)).astype(array.dtype)
        given = array[ids]
        # NaN is no other value than NaN
        return ((given != template) & ~(np.isnan(given) & np.isnan(template))).reshape(len(ids), -1).any(axis=1)

    def check_fixed(self, ids: Array) -> None:
        """Check that fields that are no parameters have the values of the model.

        Raises:
            ArgumentError: One has not; the message has the simulation and the field.
        """
        self.check_sleep(ids)
        for name in self._arrays:
            if self._is_parameter(name) or name in CONSTANTS or self._is_idle(name):
                continue
            differs = self.differs(name, ids)
            if differs.any():
                sim = ids[int(differs.argmax())]
                raise ArgumentError(
                    f"sim {sim}: {name} differs from the model's; parameters are "
                    f"{', '.join(field for field in _VARYING if self._is_parameter(field))}"
                    f"{'' if name not in _VARYING else ' in a medium'}; {self._instead}"
                )
