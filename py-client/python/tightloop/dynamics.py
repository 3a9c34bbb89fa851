"""Kinematics and dynamics at states that you give: no world of a simulation is touched."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tightloop import _core
from tightloop.errors import ArgumentError, SceneError
from tightloop.scene import Scene

Array = NDArray[np.float64]


class Dynamics:
    """A scene's kinematics and dynamics as functions, computed in this process and in double precision.

    `Sim.dynamics` is that of a running simulation. States are given one, ``(coords,)``, or many, ``(n, coords)``, such
    as a frame's ``joint_q``; results have the same leading axis. An array of one state goes with many of another.

    Args:
        scene: What to evaluate; later changes to it have no effect.

    Attributes:
        dof_names: ``robot/joint`` of each dof.
        coord_names: ``robot/joint`` of each coordinate.
        body_names: ``robot/link`` of each body.

    Raises:
        SceneError: The scene is not valid.
    """

    def __init__(self, scene: Scene) -> None:
        if not isinstance(scene, Scene):
            raise ArgumentError(f"Dynamics: scene is {type(scene).__name__}; give a tightloop.Scene")
        self._take(_core.Dynamics(scene.to_toml(), "/"))

    @classmethod
    def of_daemon(cls, info: dict[str, Any]) -> Dynamics:
        """The dynamics of what a daemon simulates, from what it tells about itself.

        Raises:
            SceneError: A robot's file cannot be read here, or is no longer what the daemon read.
        """
        core = _core.Dynamics(info["scene"], info["scene_folder"])
        if core.model_hash != info["model_hash"]:
            raise SceneError(f"the files of simulation `{info['name']}` have changed since it started; launch it again")
        dynamics = cls.__new__(cls)
        dynamics._take(core)
        return dynamics

    def _take(self, core: _core.Dynamics) -> None:
        self._core = core
        self.dof_names, self.coord_names, self.body_names = core.names

    @property
    def model_hash(self) -> int:
        """Hash of the scene's model, as `Sim.info` has that of a daemon's."""
        return self._core.model_hash

    def forward_kinematics(self, joint_q: ArrayLike) -> Array:
        """Link frames in the world: position [m], then quaternion (x, y, z, w).

        Args:
            joint_q: Joint positions [rad or m], shape ``(coords,)`` or ``(n, coords)``.

        Returns:
            Shape ``(bodies, 7)`` or ``(n, bodies, 7)``.

        Raises:
            ArgumentError: A wrong shape, dtype or value.
        """
        return self._evaluate("body_q", (len(self.body_names), 7), joint_q, None)

    def body_velocity(self, joint_q: ArrayLike, joint_qd: ArrayLike) -> Array:
        """Velocity of each link's centre of mass [m/s], then its angular velocity [rad/s], in world axes.

        Args:
            joint_q: Joint positions [rad or m], shape ``(coords,)`` or ``(n, coords)``.
            joint_qd: Joint velocities [rad/s or m/s], shape ``(dofs,)`` or ``(n, dofs)``.

        Returns:
            Shape ``(bodies, 6)`` or ``(n, bodies, 6)``. Raises as `forward_kinematics` does.
        """
        return self._evaluate("body_qd", (len(self.body_names), 6), joint_q, joint_qd)

    def body_jacobian(self, joint_q: ArrayLike) -> Array:
        """What takes ``joint_qd`` to `body_velocity`: shape ``(bodies, 6, dofs)`` or ``(n, bodies, 6, dofs)``.

        Arguments and errors as in `forward_kinematics`.
        """
        return self._evaluate("body_jacobian", (len(self.body_names), 6, len(self.dof_names)), joint_q, None)

    def mass_matrix(self, joint_q: ArrayLike) -> Array:
        """Joint-space inertia, armature included [kg·m², kg·m or kg]: shape ``(dofs, dofs)`` or ``(n, dofs, dofs)``.

        Arguments and errors as in `forward_kinematics`.
        """
        return self._evaluate("mass_matrix", (len(self.dof_names), len(self.dof_names)), joint_q, None)

    def inverse_dynamics(
        self,
        joint_q: ArrayLike,
        joint_qd: ArrayLike | None = None,
        joint_qdd: ArrayLike | None = None,
        *,
        damping: bool = True,
    ) -> Array:
        """Joint forces that give an acceleration: ``M q̈ + c + d q̇``; with positions alone, what holds them.

        Sent as ``joint_f``, they make the joints accelerate by ``joint_qdd`` where no drive, dry friction, limit,
        mimic joint or contact acts. ``M`` has the armature in it, ``c`` are Coriolis, centrifugal and gravity forces
        (``bias_force``), ``d`` is the joints' damping. A floating base takes part with its wrench.

        Args:
            joint_q: Joint positions [rad or m], shape ``(coords,)`` or ``(n, coords)``.
            joint_qd: Joint velocities [rad/s or m/s], shape ``(dofs,)`` or ``(n, dofs)``; zero if left out.
            joint_qdd: Joint accelerations [rad/s² or m/s²], same shapes; zero if left out.
            damping: Whether to supply what damping takes; False leaves ``d q̇`` out, as the recursive Newton-Euler
                algorithm does (Featherstone 2008, section 5.3).

        Returns:
            Joint forces [N·m or N], shape ``(dofs,)`` or ``(n, dofs)``. Raises as `forward_kinematics` does.
        """
        dofs = len(self.dof_names)
        many, q, qd, qdd = self._states(joint_q, joint_qd, joint_qdd)
        forces = self._core.inverse_dynamics(q, qd, qdd, bool(damping))
        return forces.reshape((*many, dofs))

    def _evaluate(self, field: str, shape: tuple[int, ...], joint_q: ArrayLike, joint_qd: ArrayLike | None) -> Array:
        many, q, qd, _ = self._states(joint_q, joint_qd, None)
        values = self._core.evaluate(field, q, qd)
        if not self.coord_names:  # all states of what cannot move are alike
            return np.broadcast_to(values.reshape(shape), (*many, *shape)).copy()
        return values.reshape((*many, *shape))

    def _states(
        self, joint_q: ArrayLike, joint_qd: ArrayLike | None, joint_qdd: ArrayLike | None
    ) -> tuple[tuple[int, ...], Array, Array, Array]:
        """The leading axis, if there is one, and the arrays flat; what was left out is empty."""
        coords, dofs = len(self.coord_names), len(self.dof_names)
        given = [_numbers("joint_q", joint_q, coords)]
        given += [
            _numbers(name, value, dofs)
            for name, value in (("joint_qd", joint_qd), ("joint_qdd", joint_qdd))
            if value is not None
        ]
        counts = {array.shape[0] for array in given if array.ndim == 2}
        if len(counts) > 1:
            raise ArgumentError(f"arrays of {' and '.join(map(str, sorted(counts)))} states; give all of one number")
        if counts == {0}:
            raise ArgumentError("arrays of 0 states; give at least one")
        many = tuple(counts)
        flat = iter([np.array(np.broadcast_to(array, (*many, array.shape[-1]))).reshape(-1) for array in given])
        nothing = np.empty(0)
        q = next(flat)
        qd = nothing if joint_qd is None else next(flat)
        return many, q, qd, nothing if joint_qdd is None else next(flat)


def _numbers(name: str, value: ArrayLike, columns: int) -> Array:
    try:
        array = np.asarray(value)
    except (ValueError, TypeError) as problem:
        raise ArgumentError(f"{name} is no array: {problem}") from None
    if array.dtype.kind not in "fiu":
        raise ArgumentError(f"{name} has dtype {array.dtype}; give real numbers")
    if array.ndim not in (1, 2) or array.shape[-1] != columns:
        raise ArgumentError(f"{name} has shape {array.shape}; give ({columns},), or (n, {columns}) for many states")
    return array.astype(np.float64)
