"""Options of a scene: those of its constraint solver, and capacities."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, SupportsIndex

from tightloop import checks
from tightloop.errors import SceneError

Cone = Literal["elliptic", "pyramidal"]


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
