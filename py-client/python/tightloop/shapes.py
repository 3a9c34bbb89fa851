"""Shapes of a scene: static ones, and those of bodies and links; and how they touch."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Literal, SupportsFloat, TypedDict, cast

from tightloop import checks
from tightloop.checks import Quaternion, Triple, Vector
from tightloop.errors import SceneError

ShapeType = Literal["plane", "box", "sphere", "cylinder", "capsule", "mesh"]

ORIGIN = (0.0, 0.0, 0.0)
UPRIGHT = (0.0, 0.0, 0.0, 1.0)


class Surface(TypedDict, total=False):
    """What a shape is like where it touches another; what is left out has its default.

    Of two shapes that touch, margins and gaps are added, and the larger friction and ``condim`` count.
    """

    mu: float | None
    """Coefficient of sliding friction [–], 1; 0 to 1e12. Below 1e-5 it counts as that, as in MuJoCo."""
    ke: float | None
    """Contact stiffness [1/s²], as Newton's shape ``ke``, 2500, at most 1e12: with ``kd`` it is MuJoCo's
    ``solref = (2/kd, kd/(2 √ke))``."""
    kd: float | None
    """Contact damping [1/s], as Newton's shape ``kd``, 100, at most 1e12."""
    kf: float | None
    """Friction damping [N·s/m], as Newton's shape ``kf``, 1000, at most 1e12: MuJoCo's ``solreffriction``."""
    margin: float | None
    """Distance at which contact forces begin [m], 0."""
    gap: float | None
    """How much farther out contacts are listed, without a force [m], 0."""
    condim: int | None
    """Directions in which a contact acts, 3: along the normal and with sliding friction; 1 is the normal alone."""
    group: int | None
    """Newton's collision group, 1: 0 touches nothing, a positive group itself and the negative ones, a negative group
    all but itself."""


@dataclass(frozen=True)
class Shape:
    """A shape: ``pos`` [m] and ``quat`` (x, y, z, w) of its centre in the world, or in the frame of the body or link
    that bears it, sizes [m], density [kg/m³], and its surface, as `Surface` has it. What was left out is None.

    Attributes:
        body: Name of the body that bears it, or ``robot/link``; None for a static shape.
        path: File of a mesh; ``notes`` say what was done to it.
    """

    name: str
    type: ShapeType
    pos: Triple
    quat: Quaternion
    half_extents: Triple | None = None
    radius: float | None = None
    half_height: float | None = None
    path: Path | None = None
    scale: Triple | None = None
    max_hull_vertices: int | None = None
    convex_decomposition: bool | None = None
    body: str | None = None
    density: float | None = None
    mu: float | None = None
    ke: float | None = None
    kd: float | None = None
    kf: float | None = None
    margin: float | None = None
    gap: float | None = None
    condim: int | None = None
    group: int | None = None
    notes: tuple[str, ...] = ()

    @property
    def full_name(self) -> str:
        """Its name in ``sim.shape_names``: ``shape``, ``body/shape`` or ``robot/link/shape``."""
        return self.name if self.body is None else f"{self.body}/{self.name}"

    def table(self) -> dict[str, Any]:
        """The shape as a scene file has it, its path absolute; what was left out is left out."""
        values = {field.name: getattr(self, field.name) for field in fields(self) if field.name != "notes"}
        values["path"] = None if self.path is None else str(self.path)
        return {name: value for name, value in values.items() if value is not None}


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


def checked_scale(what: str, scale: Vector | SupportsFloat) -> Triple:
    """A factor for each axis, from one for all or from three."""
    if isinstance(scale, SupportsFloat):
        factor = checks.number(f"{what}: scale", scale)
        factors = (factor, factor, factor)
    else:
        factors = checks.triple(f"{what}: scale", scale)
    if 0.0 in factors:
        raise SceneError(f"{what}: scale is {scale!r}; no factor must be 0")
    return factors


def checked_surface(what: str, given: Surface) -> dict[str, Any]:
    """What is given of a surface, refused by name.

    Raises:
        SceneError: A value is out of range.
        TypeError: There is no such argument.
    """
    values: dict[str, Any] = {}
    for name, value in cast("dict[str, Any]", given).items():
        if name not in Surface.__annotations__:
            raise TypeError(f"{what}: unexpected argument {name!r}; of a surface there are: {', '.join(_SURFACE)}")
        if value is None:
            continue
        entry = f"{what}: {name}"
        if name == "condim":
            values[name] = checks.integer(entry, value)
            if values[name] in (4, 6):
                raise SceneError(
                    f"{entry} is {value}: friction against turning and rolling is not supported yet; give 3, or 1"
                )
            if values[name] not in (1, 3):
                raise SceneError(f"{entry} is {value}; give 3, or 1 for no friction")
        elif name == "group":
            values[name] = checks.integer(entry, value, least=-_GROUP_MAX)
            if values[name] > _GROUP_MAX:
                raise SceneError(f"{entry} is {value}; give at most {_GROUP_MAX}")
        elif name in ("ke", "kd", "kf"):
            values[name] = checks.number(entry, value, above=0.0)
        else:
            values[name] = checks.number(entry, value, least=0.0)
    return values


_SURFACE = tuple(Surface.__annotations__)
# The daemon reads groups into 32 bits.
_GROUP_MAX = 2**31 - 1
