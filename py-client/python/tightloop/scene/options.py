"""Options of a scene: time step, gravity, constraint solver, capacities."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, SupportsFloat, SupportsIndex

import numpy as np

from tightloop import _core
from tightloop.checks import arguments as checks
from tightloop.checks.arguments import Triple, Vector
from tightloop.checks.attributes import Attributes, suggestion
from tightloop.checks.running import Running
from tightloop.checks.signatures import checked_calls
from tightloop.errors import SceneError

Cone = Literal["elliptic", "pyramidal"]
FrictionCombine = Literal["max", "mean", "min", "product"]


@dataclass(frozen=True)
class Solver:
    """The options of the constraint solver; see `Scene.solver`."""

    iterations: int = 20
    ls_iterations: int = 100
    tolerance: float = 1e-8
    cone: Cone = "elliptic"
    impratio: float = 1000.0


def capacity(what: str, value: SupportsIndex | None, most: int) -> int | None:
    """Check a capacity; None stands for the default.

    Raises:
        SceneError: It is not a whole number from 1 to ``most``.
    """
    if value is None:
        return None
    checked = checks.integer(f"Scene: {what}", value)
    if checked > most:
        raise SceneError(f"Scene: {what} is {checked}; it must be at most {most}")
    return checked


@checked_calls
class SceneOptions(Attributes):
    """Mixin of `Scene` with its options."""

    __slots__ = (
        "_command_delay_max",
        "_contacts_max",
        "_dt",
        "_friction_combine",
        "_gravity",
        "_params",
        "_rows_max",
        "_running",
        "_solver",
        "_substeps",
    )

    def __init__(self) -> None:
        self._running = Running()
        self._solver = Solver()

    def _changed(self, attribute: str) -> None:
        running = getattr(self, "_running", None)  # which a copy gets last
        if running is not None:
            running.tell("Scene", attribute)

    @property
    def dt(self) -> float:
        """Length of a physics step [s]."""
        return self._dt

    @dt.setter
    def dt(self, dt: SupportsFloat) -> None:
        self._dt = checks.number("Scene: dt", dt, above=0.0)

    @property
    def substeps(self) -> int:
        """Physics steps per control frame."""
        return self._substeps

    @substeps.setter
    def substeps(self, substeps: SupportsIndex) -> None:
        self._substeps = checks.integer("Scene: substeps", substeps)

    @property
    def gravity(self) -> Triple:
        """Acceleration of gravity [m/s²], world axes."""
        return self._gravity

    @gravity.setter
    def gravity(self, gravity: Vector) -> None:
        if np.ndim(gravity) == 0:
            raise SceneError(f"Scene: gravity is {gravity!r}; give 3 numbers, with z up, such as (0, 0, -9.81)")
        self._gravity = checks.triple("Scene: gravity", gravity)

    @property
    def params(self) -> tuple[str, ...]:
        """Model parameters that vary between worlds, besides those named at launch; see `launch`."""
        return self._params

    @params.setter
    def params(self, params: Iterable[str]) -> None:
        if isinstance(params, str) or not isinstance(params, Iterable):
            raise SceneError(f"Scene: params is {params!r}; give a list of names")
        checked = tuple(checks.text("Scene: an entry of params", param) for param in params)
        for param in checked:
            if param not in (known := _core.param_names()):
                raise SceneError(
                    f"Scene: params has {param!r}, and there is no such parameter; {suggestion(param, known)}"
                )
        self._params = checked

    @property
    def command_delay_max(self) -> int | None:
        """Largest ``command_delay`` of a world [substeps]; None is four control frames."""
        return self._command_delay_max

    @command_delay_max.setter
    def command_delay_max(self, command_delay_max: SupportsIndex | None) -> None:
        most = 1000 * self.substeps
        self._command_delay_max = capacity("command_delay_max", command_delay_max, most)

    @property
    def contacts_max(self) -> int | None:
        """Capacity for contacts of a world; None is as many as its shapes can have, at most 512."""
        return self._contacts_max

    @contacts_max.setter
    def contacts_max(self, contacts_max: SupportsIndex | None) -> None:
        self._contacts_max = capacity("contacts_max", contacts_max, 4096)

    @property
    def rows_max(self) -> int | None:
        """Capacity for constraint rows of contacts of a world; None is as many as its contacts need."""
        return self._rows_max

    @rows_max.setter
    def rows_max(self, rows_max: SupportsIndex | None) -> None:
        self._rows_max = capacity("rows_max", rows_max, 16384)

    def solver(
        self,
        *,
        iterations: int = 20,
        ls_iterations: int = 100,
        tolerance: float = 1e-8,
        cone: Cone = "elliptic",
        impratio: float = 1000.0,
    ) -> None:
        """Set the options of the constraint solver (primal Newton with exact line search).

        Args:
            iterations: Largest number of Newton iterations per physics step.
            ls_iterations: Largest number of line-search iterations per Newton iteration.
            tolerance: The solver stops when its scaled improvement is smaller [–]; at 0 only rounding stops it.
            cone: Friction cone of contacts, ``"elliptic"`` or ``"pyramidal"``.
            impratio: Ratio of frictional to normal impedance of contacts [–], above 0, at most 1e5. In float32, the
                edges of a pyramidal cone are at most 1e4 times as stiff as its normal. MuJoCo's edges exceed this limit
                if ``mu`` is below 0.22 at an impratio of 1000.

        Raises:
            SceneError: A value is out of range; the message names it.
        """
        checks.choice("cone", cone, ("elliptic", "pyramidal"))
        self._changed("solver")
        self._solver = Solver(
            iterations=checks.integer("solver: iterations", iterations),
            ls_iterations=checks.integer("solver: ls_iterations", ls_iterations),
            tolerance=checks.number("solver: tolerance", tolerance, least=0.0),
            cone=cone,
            impratio=checks.number("solver: impratio", impratio, above=0.0),
        )

    @property
    def friction_combine(self) -> FrictionCombine:
        """How the coefficients of friction of two shapes combine."""
        return self._friction_combine

    @friction_combine.setter
    def friction_combine(self, friction_combine: FrictionCombine) -> None:
        checks.choice("friction_combine", friction_combine, ("max", "mean", "min", "product"))
        self._friction_combine: FrictionCombine = friction_combine
