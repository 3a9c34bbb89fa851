"""Parameters of a running simulation: numbers of its model that differ from world to world."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tightloop import _core
from tightloop._core import Frame
from tightloop.errors import CommandRefused, ConstantParameter, UnknownField
from tightloop.inputs import real_numbers

#: Numbers of a link or site in a parameter that has several.
PARTS = {"body_f": 6, "site_q_noise": 2, "site_qd_noise": 2}
#: Parameters with one number a world.
SINGLE = ("command_delay",)


class Params:
    """What `Sim.params` is: each parameter that the scene draws or names, or ``launch(params=...)``, is an attribute.

    Reading one gives an array, shape ``(worlds, ...)``, read-only (``.copy()`` is yours); assigning to one writes it in
    all worlds, `write` in some. What is written holds from the next step on, over resets too, but for ``body_f``, which
    a reset clears, and numbers that `Scene.randomize` draws, which a reset draws anew.

    Free joints have no drive and no dry friction: their gains, effort limits, ``joint_friction`` and noises of targets
    have no effect. `Sim.inverse_dynamics` and the other functions of a state use the scene's numbers, not these.
    Reading takes a snapshot, for which this client must be in control.

    ``gravity`` (worlds, 3) [m/s²], ``body_mass_scale`` (worlds, bodies) [–], ``joint_armature`` [kg·m² or kg],
    ``joint_damping``, ``joint_target_kd`` [N·m·s/rad or N·s/m], ``joint_target_ke`` [N·m/rad or N/m],
    ``joint_effort_limit`` [N·m or N; 1e30 is none], ``joint_friction`` [N·m or N], each (worlds, dofs),
    ``shape_mu`` (worlds, shapes) [–], ``body_f`` (worlds, bodies, 6) [N, N·m].

    ``command_delay`` (worlds,) [substeps]: when ``joint_f`` and targets of a frame begin to act, a fraction counting as
    a whole substep; at most ``Scene.command_delay_max``.

    Standard deviations of normal noise, drawn for each frame from (seed, world, episode, step): of commands
    ``joint_f_noise``, ``joint_target_q_noise``, ``joint_target_qd_noise``, of measured fields ``joint_q_noise``,
    ``joint_qd_noise``, ``joint_torque_noise``, each (worlds, dofs), in the unit of what it is added to;
    ``site_q_noise`` [m, rad] and ``site_qd_noise`` [m/s, rad/s] (worlds, sites, 2), ``gyro_noise`` [rad/s] and
    ``accelerometer_noise`` [m/s²] (worlds, sites), ``contact_sensor_noise`` [N] (worlds, contact_sensors).

    Raises:
        UnknownField: There is no parameter of that name.
        ConstantParameter: It is a constant of this run; it is an AttributeError, so that `hasattr` is false.
        CommandRefused: The values do not fit; nothing was written.
    """

    __slots__ = ("_client", "_known", "_numbers", "_state", "_worlds")

    def __init__(self, client: _core.Client, info: Mapping[str, Any], state: Callable[[], NDArray[Any]]) -> None:
        super().__setattr__("_client", client)
        super().__setattr__("_worlds", info["worlds"])
        super().__setattr__("_state", state)
        super().__setattr__("_known", {param["info"]["name"]: param for param in info["params"]})
        varying = [param["info"]["columns"] for param in info["params"] if param["place"] is not None]
        super().__setattr__("_numbers", sum(varying))

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self.names]

    @property
    def names(self) -> tuple[str, ...]:
        """Those that vary in this run."""
        return tuple(name for name, param in self._known.items() if param["place"] is not None)

    def __getattr__(self, name: str) -> NDArray[Any]:
        if name.startswith("_"):
            raise AttributeError(name)
        param = self._varying(name)
        # the parameters are the last numbers of a world
        first = self._numbers - param["place"]
        rows = self._state()[:, -first:][:, : param["info"]["columns"]]
        array = np.array(rows).reshape(self._shape(name))
        # what was set in it would go nowhere
        array.flags.writeable = False
        return array

    def __setattr__(self, name: str, value: ArrayLike) -> None:
        self.write(**{name: value})

    def write(self, *, mask: ArrayLike | None = None, **params: ArrayLike) -> Frame:
        """Set parameters in some worlds, all of them or none.

        Args:
            mask: Which worlds, bool, shape ``(worlds,)``; all if left out.
            **params: Arrays by name, each ``(worlds, ...)``, ``(...)`` for every world alike, or one number for all.

        Returns:
            A frame evaluated at the present state. Raises as `Sim.step` does, and UnknownField.
        """
        return self._client.write_params({name: self.ready(name, value) for name, value in params.items()}, mask)

    def ready(self, name: str, value: Any) -> NDArray[np.float64]:
        """A value of a parameter for every world, float64, contiguous, shape ``(worlds, columns)``.

        Raises:
            CommandRefused: It has another shape, or is no array of real numbers.
        """
        self._varying(name)
        shape = self._shape(name)
        given = real_numbers(name, value)
        if given.shape not in (shape, shape[1:], ()):
            raise CommandRefused(
                f"{name}: expected shape {shape}, {shape[1:]} for every world alike, or a number; got {given.shape}"
            )
        return np.array(np.broadcast_to(given, shape), dtype=np.float64, order="C").reshape(self._worlds, -1)

    def _varying(self, name: str) -> dict[str, Any]:
        if name not in self._known:
            raise UnknownField(f"there is no parameter {name!r}; there are: {', '.join(self._known)}")
        if self._known[name]["place"] is None:
            named = ", ".join(self.names) or "none does"
            raise ConstantParameter(
                f"`{name}` is the same constant in all worlds of this run; to read or write it, name it at launch: "
                f'params=("{name}",) (of this run vary: {named})'
            )
        return self._known[name]

    def _shape(self, name: str) -> tuple[int, ...]:
        columns = self._known[name]["info"]["columns"]
        if name in SINGLE:
            return (self._worlds,)
        parts = PARTS.get(name)
        return (self._worlds, columns) if parts is None else (self._worlds, columns // parts, parts)

    def __repr__(self) -> str:
        return f"Params({', '.join(self.names) or 'none varies'})"
