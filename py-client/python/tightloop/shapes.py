"""Shapes of a scene: static ones, and those of bodies, which give these their mass."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from tightloop import checks
from tightloop.checks import Quaternion, Triple, Vector

ShapeType = Literal["box", "sphere", "cylinder", "capsule"]

ORIGIN = (0.0, 0.0, 0.0)
UPRIGHT = (0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Shape:
    """A shape: ``pos`` [m] and ``quat`` (x, y, z, w) of its centre in the world, or in the frame of the body that bears
    it, sizes [m], density [kg/m³]."""

    name: str
    type: ShapeType
    pos: Triple
    quat: Quaternion
    half_extents: Triple | None = None
    radius: float | None = None
    half_height: float | None = None
    body: str | None = None
    density: float | None = None


def checked(what: str, pos: Vector, quat: Vector, **sizes: Any) -> dict[str, Any]:
    """Pose and sizes of a shape, refused by name.

    Raises:
        SceneError: A value is not finite, a size is not above 0, or the quaternion is no rotation.
    """
    values: dict[str, Any] = {
        "pos": checks.triple(f"{what}: pos", pos),
        "quat": checks.quaternion(f"{what}: quat", quat),
    }
    for size, value in sizes.items():
        if size == "half_extents":
            values[size] = checks.triple(f"{what}: {size}", value)
            checks.number(f"{what}: smallest of {size}", min(values[size]), above=0.0)
        else:
            values[size] = checks.number(f"{what}: {size}", value, above=0.0)
    return values
