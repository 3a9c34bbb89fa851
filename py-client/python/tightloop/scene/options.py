"""Options of a scene: time step, gravity, constraint solver, capacities."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import Literal, SupportsFloat, SupportsIndex

import numpy as np

from tightloop import _core
from tightloop.checks import arguments as checks
from tightloop.checks.arguments import Triple, Vector
from tightloop.checks.attributes import suggestion
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


@dataclass(frozen=True)
class Options:
    """The options of a scene; see `tightloop.Scene`, which gives them their values."""

    dt: float = 1 / 480
    substeps: int = 8
    gravity: Triple = (0.0, 0.0, -9.81)
    contacts_max: int | None = None
    rows_max: int | None = None
    params: tuple[str, ...] = ()
    command_delay_max: int | None = None
    friction_combine: FrictionCombine = "max"
    solver: Solver = Solver()


#: The options that are arguments of `tightloop.Scene`.
NAMES = tuple(field.name for field in fields(Options) if field.name != "solver")


def checked_dt(dt: SupportsFloat) -> float:
    """Check a time step [s]."""
    return checks.number("Scene: dt", dt, above=0.0)


def checked_substeps(substeps: SupportsIndex) -> int:
    """Check a number of physics steps per control frame."""
    return checks.integer("Scene: substeps", substeps)


def checked_gravity(gravity: Vector) -> Triple:
    """Check an acceleration of gravity [m/s²].

    Raises:
        SceneError: It is no vector of three finite numbers.
    """
    if np.ndim(gravity) == 0:
        raise SceneError(f"Scene: gravity is {gravity!r}; give 3 numbers, with z up, such as (0, 0, -9.81)")
    return checks.triple("Scene: gravity", gravity)


def checked_params(params: Iterable[str]) -> tuple[str, ...]:
    """Check names of parameters.

    Raises:
        SceneError: They are no list of names, or there is no such parameter.
    """
    if isinstance(params, str) or not isinstance(params, Iterable):
        raise SceneError(f"Scene: params is {params!r}; give a list of names")
    checked = tuple(checks.text("Scene: an entry of params", param) for param in params)
    for param in checked:
        if param not in (known := _core.param_names()):
            raise SceneError(f"Scene: params has {param!r}, and there is no such parameter; {suggestion(param, known)}")
    return checked


def checked_command_delay_max(command_delay_max: SupportsIndex | None, substeps: int) -> int | None:
    """Check the largest delay of commands [substeps]."""
    return _capacity("command_delay_max", command_delay_max, 1000 * substeps)


def checked_contacts_max(contacts_max: SupportsIndex | None) -> int | None:
    """Check a capacity for contacts."""
    return _capacity("contacts_max", contacts_max, 4096)


def checked_rows_max(rows_max: SupportsIndex | None) -> int | None:
    """Check a capacity for constraint rows."""
    return _capacity("rows_max", rows_max, 16384)


def checked_friction_combine(friction_combine: FrictionCombine) -> FrictionCombine:
    """Check how coefficients of friction combine."""
    checks.choice("friction_combine", friction_combine, ("max", "mean", "min", "product"))
    return friction_combine


def checked_solver(iterations: int, ls_iterations: int, tolerance: float, cone: Cone, impratio: float) -> Solver:
    """Check the arguments of `Scene.solver`.

    Raises:
        SceneError: A value is out of range.
    """
    checks.choice("cone", cone, ("elliptic", "pyramidal"))
    return Solver(
        iterations=checks.integer("solver: iterations", iterations),
        ls_iterations=checks.integer("solver: ls_iterations", ls_iterations),
        tolerance=checks.number("solver: tolerance", tolerance, least=0.0),
        cone=cone,
        impratio=checks.number("solver: impratio", impratio, above=0.0),
    )


def _capacity(what: str, value: SupportsIndex | None, most: int) -> int | None:
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
