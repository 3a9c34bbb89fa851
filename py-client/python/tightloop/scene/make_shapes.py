"""Making shapes of a scene: files are read, poses, sizes and densities are checked."""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING, Any

from tightloop import _core
from tightloop.checks import arguments as checks
from tightloop.checks.arguments import Vector
from tightloop.errors import SceneError
from tightloop.files.kinds import instead
from tightloop.scene import height_fields
from tightloop.scene.body import Body
from tightloop.scene.parts import Parts, carrier_name
from tightloop.scene.robot import Link
from tightloop.scene.shapes import Shape, ShapeType, Surface, checked, checked_scale, checked_surface

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


def shape(
    scene: Parts,
    kind: ShapeType,
    name: str,
    body: Body | Link | str | None,
    density: float | None,
    *,
    surface: Surface,
    checked_sizes: dict[str, Any] | None = None,
    **frame_and_sizes: Any,
) -> Shape:
    """Make a shape for a scene.

    Args:
        scene: The scene, which has the body.
        kind: Type of the shape.
        name: Its name, checked.
        body: Its body or link; None if it is static.
        density: Its density [kg/m³], if it is given.
        surface: Its contact parameters.
        checked_sizes: What `read_mesh` or `read_height_field` returned.
        frame_and_sizes: Its pose, and sizes that are not checked yet.

    Raises:
        SceneError: A value is out of range, or the body is of another scene.
    """
    what = f"{kind} `{name}`"
    carrier = None if body is None else carrier_name(scene, what, body)
    if density is not None:
        if carrier is None:
            raise SceneError(f"{what} is static and has no density; leave it out, or give body=")
        if "/" in carrier:
            raise SceneError(f"{what}: link `{carrier}` has the mass that its robot's file gives it; leave out density")
        density = checks.number(f"{what}: density", density, above=0.0)
    values = checked(what, **frame_and_sizes) | checked_surface(what, surface) | (checked_sizes or {})
    return Shape(name, kind, body=carrier, density=density, **values)


def read_mesh(
    path: str | os.PathLike[str], scale: Vector | float, max_hull_vertices: int, convex_decomposition: bool
) -> dict[str, Any]:
    """Read and check a mesh; return the attributes of its shape. The arguments are those of `Scene.add_mesh`.

    Raises:
        SceneError: The file cannot be used, or a value is out of range.
    """
    if wrong := instead("add_mesh: path", path, "mesh"):
        raise SceneError(wrong)
    file = checks.path("add_mesh: path", path)
    factors = checked_scale("add_mesh", scale)
    vertices = checks.integer("add_mesh: max_hull_vertices", max_hull_vertices)
    decompose = checks.flag("add_mesh: convex_decomposition", convex_decomposition)
    summary = json.loads(_core.read_mesh(str(file), factors, vertices, decompose))
    return {
        "path": file,
        "scale": factors,
        "max_hull_vertices": vertices,
        "convex_decomposition": decompose,
        "notes": tuple(summary["notes"]),
    }


def read_height_field(elevation: ArrayLike | str | os.PathLike[str], size: Vector, base: float) -> dict[str, Any]:
    """Check a height field and keep it in a file; return the attributes of its shape.

    The arguments are those of `Scene.add_hfield`.

    Raises:
        SceneError: A value is out of range.
    """
    if isinstance(elevation, str | os.PathLike):
        file = height_fields.checked("add_hfield: elevation", checks.path("add_hfield: elevation", elevation))
    else:
        file = height_fields.cached(height_fields.elevations("add_hfield: elevation", elevation))
    lengths = checks.pair("add_hfield: size", size)
    checks.number("add_hfield: smallest of size", min(lengths), above=0.0)
    thickness = checks.number("add_hfield: base", base, above=0.0)
    return {"path": file, "size": lengths, "base": thickness}
