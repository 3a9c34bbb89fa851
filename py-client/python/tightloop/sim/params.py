"""Parameters of a running simulation: values of its model that vary between worlds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tightloop import _core
from tightloop._core import Frame
from tightloop.arrays.inputs import as_mask, real_numbers
from tightloop.arrays.named_columns import Place, Runs, named_columns
from tightloop.arrays.written import PropertyArray
from tightloop.checks.attributes import nearest
from tightloop.checks.params_advice import ParamsAdvice
from tightloop.checks.signatures import checked_calls
from tightloop.errors import CommandRefused, ConstantParameter, UnknownField
from tightloop.sim.command_rows import COMMANDS


@checked_calls
class Params:
    """The varying parameters of a simulation, as attributes of `Sim.params`.

    A parameter varies if ``launch(params=...)`` or the scene names it, or if `Scene.randomize` draws it. Reading one
    returns an array, shape ``(worlds, ...)``. Assigning to one, or to its entries (``params.shape_mu[0] = 0.5``),
    writes it in all worlds, `write` in some. A written value takes effect at the next step and survives resets.
    Exceptions are ``body_f``, which a reset clears, and parameters that `Scene.randomize` draws, which a reset draws
    again.

    Free joints have no drive and no dry friction: their gains, effort limits, ``joint_friction`` and target noise have
    no effect. `Sim.inverse_dynamics` and the other functions of a state use the scene's values, not these. Reading
    takes a snapshot, so this client must be in control.

    A write replaces the value of the model. Only ``body_mass_scale`` (worlds, bodies) [–] is a factor: of mass and
    inertia of each link, 1 at the start.

    ``gravity`` (worlds, 3) [m/s²], ``joint_armature`` [kg·m² or kg],
    ``joint_damping``, ``joint_target_kd`` [N·m·s/rad or N·s/m], ``joint_target_ke`` [N·m/rad or N/m],
    ``joint_effort_limit`` [N·m or N; 1e30 is none], ``joint_friction`` [N·m or N], each (worlds, dofs),
    ``shape_mu`` (worlds, shapes) [–], ``body_f`` (worlds, bodies, 6) [N, N·m]. ``body_mass`` (worlds, bodies) [kg] and
    ``body_inertia`` (worlds, bodies, 6) [kg·m²] count before ``body_mass_scale``; an inertia is about the centre of
    mass in the link's axes: xx, yy, zz, xy, xz, yz. ``body_com`` (worlds, bodies, 3) [m] is that centre.
    ``body_invweight0`` (worlds, bodies) [1/kg] and ``dof_invweight0`` (worlds, dofs) are MuJoCo's, which make contacts
    and limits soft. ``joint_limit_lower`` and ``joint_limit_upper`` (worlds, dofs) [rad or m] act where a joint has
    limits. ``shape_solref`` (worlds, shapes, 2) and ``shape_solimp`` (worlds, shapes, 5) are MuJoCo's; the power stays.

    Of MuJoCo models: ``joint_ref`` (worlds, dofs) [rad or m] is ``qpos0`` of hinges and slides. ``body_gravcomp``
    (worlds, bodies) [–]. ``shape_mu_torsional`` and ``shape_mu_rolling`` (worlds, shapes) [m]. ``pair_friction``
    (worlds, contact_pairs, 3) [–, m, m] is sliding, torsional and rolling. ``actuator_gain`` and ``actuator_bias``
    (worlds, actuators, 3) are constant, factor of the length and factor of the velocity; muscles keep their own.
    ``actuator_forcerange`` (worlds, actuators, 2) [N or N·m] acts where an actuator has bounds.

    ``command_delay`` (worlds,) [substeps]: delay until ``joint_f`` and targets of a frame act, rounded up to whole
    substeps; at most ``Scene.command_delay_max``.

    Standard deviations of normal noise, drawn for each frame from (seed, world, episode, step). Noise on commands:
    ``joint_f_noise``, ``joint_target_q_noise``, ``joint_target_qd_noise``; on measured fields: ``joint_q_noise``,
    ``joint_qd_noise``, ``joint_torque_noise``; each (worlds, dofs), in the unit of the value it is added to;
    ``site_q_noise`` [m, rad] and ``site_qd_noise`` [m/s, rad/s] (worlds, sites, 2), ``gyro_noise`` [rad/s] and
    ``accelerometer_noise`` [m/s²] (worlds, sites), ``contact_sensor_noise`` [N] (worlds, contact_sensors).

    Raises:
        UnknownField: There is no parameter of that name.
        ConstantParameter: The parameter is constant in this run. It is an AttributeError, so that `hasattr` is false.
        CommandRefused: The values do not fit; nothing was written.
    """

    __slots__ = ("_advice", "_client", "_info", "_known", "_numbers", "_state", "_worlds")

    def __init__(
        self,
        client: _core.Client,
        info: Mapping[str, Any],
        state: Callable[[], NDArray[Any]],
        looks: ParamsAdvice | None = None,
    ) -> None:
        super().__setattr__("_advice", looks)
        super().__setattr__("_client", client)
        super().__setattr__("_info", info)
        super().__setattr__("_worlds", info["worlds"])
        super().__setattr__("_state", state)
        super().__setattr__("_known", {param["info"]["name"]: param for param in info["params"]})
        varying = [param["info"]["columns"] for param in info["params"] if param["place"] is not None]
        super().__setattr__("_numbers", sum(varying))

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self.names]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters that vary in this run."""
        return tuple(name for name, param in self._known.items() if param["place"] is not None)

    def __getattr__(self, name: str) -> NDArray[Any]:
        if name.startswith("_"):
            raise AttributeError(name)
        self._varying(name)

        def read() -> NDArray[Any]:
            return self._columns(name).reshape(self._shape(name))

        def write(values: NDArray[Any], assigned: NDArray[np.bool_]) -> NDArray[Any]:
            self._write({name: values}, None, entries=True)
            return values

        return PropertyArray.of(read, write, lambda problem: CommandRefused(f"params.{name} {problem}"))

    def __setattr__(self, name: str, value: ArrayLike) -> None:
        self.write(**{name: value})

    def __getitem__(self, name: Any) -> Any:
        raise UnknownField(f"params has no entries, such as {name!r}: parameters are attributes: write params.gravity")

    def write(self, *, mask: ArrayLike | None = None, **params: ArrayLike) -> Frame:
        """Set parameters in some worlds. All given parameters are written, or none after an error.

        Args:
            mask: Worlds to write, bool, shape ``(worlds,)``; all if left out.
            **params: Arrays by name, each ``(worlds, ...)``, ``(...)`` for identical worlds, or one number for all;
                ``body_f`` also a dict as in `Sim.step`.

        Returns:
            A frame at the current state. Raises as `Sim.step` does, and UnknownField.
        """
        return self._write(params, mask)

    def _write(self, params: Mapping[str, ArrayLike], mask: ArrayLike | None, *, entries: bool = False) -> Frame:
        runs = {name: self.ready_columns(name, value) for name, value in params.items()}
        worlds = None if mask is None else as_mask("mask", mask, self._worlds)
        if self._advice is not None:
            arrays = {name: own[0][1] for name, own in runs.items() if own}
            self._advice.look(arrays, worlds, self._columns, entries=entries)
        return self._client.write({name: _core.Columns(own) for name, own in runs.items()}, worlds, False)

    def _columns(self, name: str) -> NDArray[Any]:
        """Return a parameter as it is, shape ``(worlds, columns)``, in memory of its own."""
        # parameters are the last values of a world's record
        first = self._numbers - self._known[name]["place"]
        return np.array(self._state()[:, -first:][:, : self._known[name]["info"]["columns"]])

    def ready_columns(self, name: str, value: Any) -> Runs:
        """Return runs of columns of a value, as `ready` converts it. That of a command may be a dict, as in `step`."""
        if name in COMMANDS and isinstance(value, Mapping):
            self._varying(name)
            names, _, parts, robots = self._layout(name)
            if robots is not None:
                return named_columns(name, value, self._worlds, names, robots, parts=parts)
        return [(0, self.ready(name, value))]

    def ready(self, name: str, value: Any) -> NDArray[np.float64]:
        """Convert a value of a parameter to a contiguous float64 array, shape ``(worlds, columns)``.

        Raises:
            UnknownField: There is no parameter of that name.
            ConstantParameter: The parameter is constant in this run.
            CommandRefused: The shape is wrong, or the value is no array of real numbers.
        """
        self._varying(name)
        shape = self._shape(name)
        if isinstance(value, Mapping):
            raise CommandRefused(f"params.{name} is {value!r:.80}; give an array, one value for each of {_order(name)}")
        given = real_numbers(name, value)
        if given.shape not in (shape, shape[1:], ()):
            raise CommandRefused(
                f"{name}: expected shape {shape}, {shape[1:]} for all worlds, or a number; got {given.shape}"
            )
        return np.array(np.broadcast_to(given, shape), dtype=np.float64, order="C").reshape(self._worlds, -1)

    def _varying(self, name: str) -> dict[str, Any]:
        if name not in self._known:
            near = "".join(f"did you mean `{other}`? " for other in nearest(name, self._known)[:1])
            raise UnknownField(f"there is no parameter {name!r}; {near}there are: {', '.join(self._known)}")
        if self._known[name]["place"] is None:
            named = ", ".join(self.names) or "none does"
            raise ConstantParameter(
                f"`{name}` is the same constant in all worlds of this run; to read or write it, name it at launch: "
                f'params=("{name}",) (of this run vary: {named})'
            )
        return self._known[name]

    def _layout(self, name: str) -> tuple[list[str], int, int, list[Place] | None]:
        """Return what a parameter's columns are of: names, number of columns, columns of each name, parts of robots."""
        layout = self._client.layout(name)
        assert layout is not None, "it varies"
        return layout

    def _shape(self, name: str) -> tuple[int, ...]:
        names, columns, parts, _ = self._layout(name)
        if parts > 1:
            return (self._worlds, columns // parts, parts)
        return (self._worlds,) if columns == 1 and not names else (self._worlds, columns)

    def __repr__(self) -> str:
        return f"Params({', '.join(self.names) or 'none varies'})"


def _order(name: str) -> str:
    """Return where the names stand in whose order a parameter has its values."""
    kind = name.partition("_")[0]
    orders = {
        "body": "sim.body_names",
        "shape": "sim.shape_names",
        "joint": "sim.dof_names",
        "actuator": "sim.actuator_names",
        "contact": "sim.contact_sensor_names",
        "gravity": "x, y and z",
        "command": "the worlds",
    }
    return orders.get(kind, "sim.site_names")
