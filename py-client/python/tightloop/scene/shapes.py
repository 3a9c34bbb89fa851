"""Collision shapes and their contact parameters."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Literal, SupportsFloat, TypedDict, cast

from tightloop.checks import arguments as checks
from tightloop.checks.arguments import Quaternion, Triple, Vector
from tightloop.checks.signatures import with_arguments
from tightloop.errors import SceneError

ShapeType = Literal["plane", "box", "sphere", "cylinder", "capsule", "ellipsoid", "mesh", "hfield"]

ORIGIN = (0.0, 0.0, 0.0)
UPRIGHT = (0.0, 0.0, 0.0, 1.0)


class Surface(TypedDict, total=False):
    """The contact parameters of a shape; a parameter that is left out has its default.

    A contact of two shapes has the sum of their margins and gaps, and the larger friction and ``condim``.
    """

    mu: float | None
    """Coefficient of sliding friction [–], default 1; 0 to 1e12. As in MuJoCo, 1e-5 is the lower limit in effect."""
    ke: float | None
    """Contact stiffness [1/s²], as Newton's shape ``ke``, default 2500, at most 1e12. With ``kd`` it is MuJoCo's
    ``solref = (2/kd, kd/(2 √ke))``."""
    kd: float | None
    """Contact damping [1/s], as Newton's shape ``kd``, default 100, at most 1e12."""
    kf: float | None
    """Friction damping [N·s/m], as Newton's shape ``kf``, default 1000, at most 1e12; MuJoCo's ``solreffriction``."""
    margin: float | None
    """Distance at which contact forces begin [m], default 0."""
    gap: float | None
    """Additional distance at which contacts are listed without a force [m], default 0."""
    condim: int | None
    """Dimension of the contact, default 3: normal force and sliding friction; 1 is the normal force alone."""
    group: int | None
    """Newton's collision group, default 1. Group 0 collides with nothing, a positive group with itself and with all
    negative groups, a negative group with all groups but itself."""


@dataclass(frozen=True)
class Shape:
    """A collision shape, made by `Scene.add_box` and the like. Attributes that were left out are None.

    It has ``pos`` [m] and ``quat`` (x, y, z, w) of its centre in the frame of its body, sizes [m], density [kg/m³] and
    the contact parameters of `Surface`.

    Attributes:
        body: Name of its body, or ``robot/link``; None for a static shape.
        radii: Radii of an ellipsoid along its axes [m].
        path: File of a mesh, ``notes`` say how the mesh was changed; or of the elevations of a height field.
        size: Lengths of a height field along x and y [m].
        base: Thickness of a height field below its lowest elevation [m].
    """

    name: str
    type: ShapeType
    pos: Triple
    quat: Quaternion
    half_extents: Triple | None = None
    radii: Triple | None = None
    radius: float | None = None
    half_height: float | None = None
    path: Path | None = None
    size: tuple[float, float] | None = None
    base: float | None = None
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
        """Name in ``sim.shape_names``: ``shape``, ``body/shape`` or ``robot/link/shape``."""
        return self.name if self.body is None else f"{self.body}/{self.name}"

    def table(self) -> dict[str, Any]:
        """Return the shape in the form of a scene file, with an absolute path and without attributes that are None."""
        values = {field.name: getattr(self, field.name) for field in fields(self) if field.name != "notes"}
        values["path"] = None if self.path is None else str(self.path)
        return {name: value for name, value in values.items() if value is not None}


def checked(what: str, pos: Vector, quat: Vector, **sizes: Any) -> dict[str, Any]:
    """Check pose and sizes of a shape.

    Raises:
        SceneError: A value is not finite, a size is not above 0, or the quaternion is not a unit quaternion.
    """
    values: dict[str, Any] = {
        "pos": checks.triple(f"{what}: pos", pos),
        "quat": checks.quaternion(f"{what}: quat", quat),
    }
    for size, value in sizes.items():
        if size in ("half_extents", "radii"):
            values[size] = checks.triple(f"{what}: {size}", value)
            checks.number(f"{what}: smallest of {size}", min(values[size]), above=0.0)
        else:
            values[size] = checks.number(f"{what}: {size}", value, above=0.0)
    return values


def checked_scale(what: str, scale: Vector | SupportsFloat) -> Triple:
    """Return a factor per axis, from one factor for all axes or from three."""
    if isinstance(scale, SupportsFloat):
        factor = checks.number(f"{what}: scale", scale)
        factors = (factor, factor, factor)
    else:
        factors = checks.triple(f"{what}: scale", scale)
    if 0.0 in factors:
        raise SceneError(f"{what}: scale is {scale!r}; no factor must be 0")
    return factors


def checked_surface(what: str, given: Surface) -> dict[str, Any]:
    """Check the given contact parameters.

    Args:
        what: What they are of, for messages.
        given: The parameters by name.

    Raises:
        SceneError: A value is out of range.
    """
    values: dict[str, Any] = {}
    for name, value in cast("dict[str, Any]", given).items():
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


#: Marks methods that take the parameters of a `Surface` as keyword arguments.
with_surface = with_arguments(*Surface.__annotations__)
# The daemon reads groups into 32 bits.
_GROUP_MAX = 2**31 - 1
