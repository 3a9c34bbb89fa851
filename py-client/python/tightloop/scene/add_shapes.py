"""The shapes of a scene: methods that add shapes and filter contacts."""

from __future__ import annotations

import json
import os
from collections import ChainMap
from collections.abc import Collection, Container
from typing import TYPE_CHECKING, Any, cast

from tightloop import _core
from tightloop.checks import arguments as checks
from tightloop.checks.arguments import Vector
from tightloop.checks.attributes import ByName, nearest
from tightloop.checks.signatures import checked_calls
from tightloop.errors import SceneError
from tightloop.files.kinds import instead
from tightloop.mujoco.model import MujocoModel
from tightloop.scene import height_fields
from tightloop.scene.body import Body
from tightloop.scene.options import SceneOptions
from tightloop.scene.robot import Link, Robot
from tightloop.scene.shapes import (
    ORIGIN,
    UPRIGHT,
    Shape,
    ShapeType,
    Surface,
    checked,
    checked_scale,
    checked_surface,
    with_surface,
)

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    # typing has it from Python 3.11 on, the package runs on 3.10
    from typing_extensions import Unpack

Collidable = Shape | Robot | Body | Link | str


@checked_calls
class SceneShapes(SceneOptions):
    """Mixin of `Scene` with its shapes."""

    __slots__ = ("_numbers", "bodies", "filters", "models", "robots", "shapes")

    def __init__(self) -> None:
        super().__init__()
        self.robots: dict[str, Robot] = ByName("robot")
        self.models: dict[str, MujocoModel] = ByName("MuJoCo model")
        self.bodies: dict[str, Body] = ByName("body")
        self.shapes: dict[str, Shape] = ByName("shape")
        self.filters: list[tuple[str, str]] = []
        self._numbers: dict[str, int] = {}  # of each kind, where free names begin

    @with_surface
    def add_box(
        self,
        *,
        half_extents: Vector,
        pos: Vector = ORIGIN,
        quat: Vector = UPRIGHT,
        body: Body | Link | str | None = None,
        density: float | None = None,
        name: str | None = None,
        **surface: Unpack[Surface],
    ) -> Shape:
        """Add a box, static or on a body or link.

        Args:
            half_extents: Half the length of each side [m], above 0.
            pos: Centre in the world, or in the body's frame [m].
            quat: Orientation in that frame (x, y, z, w).
            body: Body of the box, a robot's link (``robot.link("hand")``), or the name of either (``"cube"``,
                ``"arm/hand"``). None for a static box.
            density: Density of a box on a body [kg/m³], 1000 if left out. If the body has a mass, only the ratios of
                its shapes' densities matter. A link keeps the mass of its robot's file.
            name: Unique name; ``box``, ``box_2``, … if left out.
            **surface: Contact parameters: ``mu``, ``ke``, ``kd``, ``kf``, ``margin``, ``gap``, ``condim``, ``group``,
                see `tightloop.Surface`.

        Returns:
            The shape.

        Raises:
            SceneError: A value is out of range; the message names it.
        """
        return self._add_shape("box", name, body, density, surface, pos=pos, quat=quat, half_extents=half_extents)

    @with_surface
    def add_sphere(
        self,
        *,
        radius: float,
        pos: Vector = ORIGIN,
        quat: Vector = UPRIGHT,
        body: Body | Link | str | None = None,
        density: float | None = None,
        name: str | None = None,
        **surface: Unpack[Surface],
    ) -> Shape:
        """Add a sphere with a ``radius`` [m]; the other arguments are those of `add_box`."""
        return self._add_shape("sphere", name, body, density, surface, pos=pos, quat=quat, radius=radius)

    @with_surface
    def add_cylinder(
        self,
        *,
        radius: float,
        half_height: float,
        pos: Vector = ORIGIN,
        quat: Vector = UPRIGHT,
        body: Body | Link | str | None = None,
        density: float | None = None,
        name: str | None = None,
        **surface: Unpack[Surface],
    ) -> Shape:
        """Add a cylinder along its z axis, sizes in [m]; the other arguments are those of `add_box`."""
        return self._add_shape(
            "cylinder", name, body, density, surface, pos=pos, quat=quat, radius=radius, half_height=half_height
        )

    @with_surface
    def add_capsule(
        self,
        *,
        radius: float,
        half_height: float,
        pos: Vector = ORIGIN,
        quat: Vector = UPRIGHT,
        body: Body | Link | str | None = None,
        density: float | None = None,
        name: str | None = None,
        **surface: Unpack[Surface],
    ) -> Shape:
        """Add a capsule along its z axis, sizes in [m]; ``half_height`` is half the distance of the caps' centres."""
        return self._add_shape(
            "capsule", name, body, density, surface, pos=pos, quat=quat, radius=radius, half_height=half_height
        )

    @with_surface
    def add_mesh(
        self,
        path: str | os.PathLike[str],
        *,
        scale: Vector | float = 1.0,
        max_hull_vertices: int = 64,
        convex_decomposition: bool = False,
        pos: Vector = ORIGIN,
        quat: Vector = UPRIGHT,
        body: Body | Link | str | None = None,
        density: float | None = None,
        name: str | None = None,
        **surface: Unpack[Surface],
    ) -> Shape:
        """Add a mesh from a file; contacts use its convex hull. The file is read and checked at once.

        Args:
            path: The file: STL, OBJ, COLLADA or glTF.
            scale: Factor on the file's coordinates [–], one for all axes or one per axis; a negative one mirrors.
            max_hull_vertices: Largest number of vertices of the hull, 8 to 1024. Contacts keep twelve corners of a face
                and test 48 edges in deep penetrations, which is enough for 64 vertices.
            convex_decomposition: Whether a concave mesh becomes several convex hulls instead of one.
            pos: Position of the file's origin in the world, or in the body's frame [m].
            quat: Orientation of the file's axes in that frame (x, y, z, w).
            body: As in `add_box`.
            density: As in `add_box`; a mesh that is not closed has the mass of its hull.
            name: Unique name; ``mesh``, ``mesh_2``, … if left out.
            **surface: Contact parameters, see `add_box`.

        Returns:
            The shape; its ``notes`` say how the mesh was changed.

        Raises:
            SceneError: The file cannot be used, or a value is out of range; the message names it.
        """
        if wrong := instead("add_mesh: path", path, "mesh"):
            raise SceneError(wrong)
        file = checks.path("add_mesh: path", path)
        factors = checked_scale("add_mesh", scale)
        vertices = checks.integer("add_mesh: max_hull_vertices", max_hull_vertices)
        decompose = checks.flag("add_mesh: convex_decomposition", convex_decomposition)
        summary = json.loads(_core.read_mesh(str(file), factors, vertices, decompose))
        mesh = {
            "path": file,
            "scale": factors,
            "max_hull_vertices": vertices,
            "convex_decomposition": decompose,
            "notes": tuple(summary["notes"]),
        }
        return self._add_shape("mesh", name, body, density, surface, mesh=mesh, pos=pos, quat=quat)

    @with_surface
    def add_hfield(
        self,
        elevation: ArrayLike | str | os.PathLike[str],
        *,
        size: Vector,
        base: float = 1.0,
        pos: Vector = ORIGIN,
        quat: Vector = UPRIGHT,
        name: str | None = None,
        **surface: Unpack[Surface],
    ) -> Shape:
        """Add a height field: terrain that never moves, one for all worlds.

        Each cell has two triangles, as in MuJoCo; their common edge goes from the corner of lowest x and y to that of
        highest. The solid below each triangle touches on its own. A pair of shapes keeps eight contacts: of more, the
        deepest and those that are farthest from the ones kept.

        Args:
            elevation: Elevations [m], shape ``(rows, columns)``, rows along x: row 0 is at the lowest y. Or a ``.npy``
                file with them.
            size: Lengths along x and y [m]. The field is centred at ``pos``.
            base: Thickness of the ground below the lowest elevation [m].
            pos: Middle of the field in the world; elevations count from its z [m].
            quat: Orientation in the world (x, y, z, w).
            name: Unique name; ``hfield``, ``hfield_2``, … if left out.
            **surface: Contact parameters, see `add_box`.

        Returns:
            The shape; ``path`` is the file of its elevations.

        Raises:
            SceneError: A value is out of range; the message names it.
        """
        if isinstance(elevation, str | os.PathLike):
            file = height_fields.checked("add_hfield: elevation", checks.path("add_hfield: elevation", elevation))
        else:
            file = height_fields.cached(height_fields.elevations("add_hfield: elevation", elevation))
        lengths = checks.pair("add_hfield: size", size)
        checks.number("add_hfield: smallest of size", min(lengths), above=0.0)
        thickness = checks.number("add_hfield: base", base, above=0.0)
        field = {"path": file, "size": lengths, "base": thickness}
        return self._add_shape("hfield", name, None, None, surface, mesh=field, pos=pos, quat=quat)

    @with_surface
    def add_plane(
        self,
        *,
        pos: Vector = ORIGIN,
        quat: Vector = UPRIGHT,
        name: str | None = None,
        **surface: Unpack[Surface],
    ) -> Shape:
        """Add an infinite plane, such as a slope; all below z = 0 of its frame is solid.

        Args:
            pos: A point of the plane in the world [m].
            quat: Orientation (x, y, z, w); the z axis points outward.
            name: Unique name; ``plane``, ``plane_2``, … if left out.
            **surface: Contact parameters, see `add_box`.

        Returns:
            The shape.
        """
        return self._add_shape("plane", name, None, None, surface, pos=pos, quat=quat)

    @with_surface
    def add_ground(self, *, z: float = 0.0, name: str | None = None, **surface: Unpack[Surface]) -> Shape:
        """Add an infinite horizontal ground at height ``z`` [m], named ``ground``; see `add_plane`."""
        height = checks.number("add_ground: z", z)
        name = self._free_name("ground") if name is None else name
        return self.add_plane(pos=(0.0, 0.0, height), name=name, **surface)

    def filter_contacts(self, a: Collidable, b: Collidable) -> None:
        """Exclude contacts between two shapes, or between all shapes of robots, bodies or links.

        Args:
            a: A shape; a robot, body or link for all its shapes; or a name. Names are those of ``sim.shape_names``,
                such as ``"table"``, ``"cube/box"``, ``"arm/hand/0"``, or of a robot, body or link: ``"arm"``,
                ``"arm/hand"``.
            b: Likewise. The same value as ``a`` excludes contacts among its own shapes.

        Raises:
            SceneError: ``a`` or ``b`` does not exist in the scene; add it before the filter.
        """
        what = "filter_contacts"
        self.filters.append((self._collidable(f"{what}: a", a), self._collidable(f"{what}: b", b)))

    def _add_shape(
        self,
        kind: ShapeType,
        name: str | None,
        body: Body | Link | str | None,
        density: float | None,
        surface: Surface,
        *,
        mesh: dict[str, Any] | None = None,
        **frame_and_sizes: Any,
    ) -> Shape:
        name = checks.name(kind, self._free_name(kind) if name is None else name, self._names())
        what = f"{kind} `{name}`"
        carrier = None if body is None else self._carrier(what, body)
        if density is not None:
            if carrier is None:
                raise SceneError(f"{what} is static and has no density; leave it out, or give body=")
            if "/" in carrier:
                raise SceneError(
                    f"{what}: link `{carrier}` has the mass that its robot's file gives it; leave out density"
                )
            density = checks.number(f"{what}: density", density, above=0.0)
        values = checked(what, **frame_and_sizes) | checked_surface(what, surface) | (mesh or {})
        shape = Shape(name, kind, body=carrier, density=density, **values)
        self.shapes[name] = shape
        self._changed("add_ground" if kind == "plane" else f"add_{kind}")
        return shape

    def _carrier(self, what: str, body: Body | Link | str) -> str:
        """Return the name of a body of this scene, or ``robot/link``."""
        if isinstance(body, Body) and self.bodies.get(body.name) is not body:
            raise SceneError(f"{what}: body `{body.name}` is of another scene; give one of this scene's")
        if isinstance(body, Link) and self.robots.get(body.robot.name) is not body.robot:
            raise SceneError(f"{what}: link `{body}` is of another scene; give one of this scene's")
        if not isinstance(body, (Body, Link, str)):
            raise SceneError(f"{what}: body is {body!r}; give a body, robot.link(…), or the name of either")
        carrier = body.name if isinstance(body, (Body, Link)) else body
        robot, slash, link = carrier.partition("/")
        if slash and robot in self.robots:
            try:
                self.robots[robot].link(link)
            except SceneError as problem:
                raise SceneError(f"{what}: body is {carrier!r}: {problem}") from None
        elif carrier in self.robots:
            raise SceneError(f"{what}: body is the robot {carrier!r}; give one of its links, as in robot.link(…)")
        elif carrier not in self.bodies:
            known = ", ".join(f"`{body}`" for body in self.bodies) or "none yet; add_body makes one"
            links = f". A link of a robot is named with it, as in `{next(iter(self.robots))}/…`" if self.robots else ""
            raise SceneError(f"{what}: body is {carrier!r}, which is no body of this scene; there are: {known}{links}")
        return carrier

    def _collidable(self, what: str, thing: Collidable) -> str:
        """Return the name of a shape, robot, body or link; `what` is for messages."""
        if isinstance(thing, Shape):
            if self.shapes.get(thing.name) is not thing:
                raise SceneError(f"{what}: shape `{thing.name}` is of another scene; give one of this scene's")
            return thing.full_name
        if isinstance(thing, Robot):
            if self.robots.get(thing.name) is not thing:
                raise SceneError(f"{what}: robot `{thing.name}` is of another scene; give one of this scene's")
            return thing.name
        if isinstance(thing, (Body, Link)):
            return self._carrier(what, thing)
        shapes = [shape.full_name for shape in self.shapes.values()]
        names = [*shapes, *self.robots, *self.bodies]
        for robot in self.robots.values():
            names += (f"{robot.name}/{part}" for part in (*robot.link_names, *robot.shape_names))
        if thing not in names:
            known = ", ".join(f"`{name}`" for name in (*shapes, *self.robots, *self.bodies)) or "none yet"
            if near := nearest(str(thing), names):
                known = f"{known} (did you mean `{near[0]}`?)"
            raise SceneError(
                f"{what} is {thing!r}, which is no shape, robot, body or link; there are: {known}, and the "
                "robots' links and shapes (robot.link_names, robot.shape_names)"
            )
        return thing

    def _names(self) -> Collection[str]:
        # no copy: a scene asks for a name at every body
        return cast("Collection[str]", ChainMap[str, Any](self.shapes, self.bodies, self.models, self.robots))

    def _free_name(self, kind: str) -> str:
        name, self._numbers[kind] = numbered(kind, self._names(), self._numbers.get(kind, 1))
        return name


def free_name(kind: str, taken: Container[str]) -> str:
    """Return the first name of ``kind``, ``kind_2``, … that is not taken."""
    return numbered(kind, taken, 1)[0]


def numbered(kind: str, taken: Container[str], first: int) -> tuple[str, int]:
    """Return the first name that is not taken, from a number on, and its number."""
    count = first
    while (name := kind if count == 1 else f"{kind}_{count}") in taken:
        count += 1
    return name, count
