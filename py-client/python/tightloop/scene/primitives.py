"""Methods of a scene that add round shapes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tightloop.checks.arguments import Vector
from tightloop.checks.attributes import Attributes
from tightloop.checks.signatures import checked_calls
from tightloop.scene.body import Body
from tightloop.scene.robot import Link
from tightloop.scene.shapes import ORIGIN, UPRIGHT, Shape, ShapeType, Surface, with_surface

if TYPE_CHECKING:
    from typing_extensions import Unpack


@checked_calls
class Primitives(Attributes):
    """Spheres, cylinders, capsules and ellipsoids of a `Scene`."""

    __slots__ = ()

    def _add_shape(
        self, kind: ShapeType, name: str | None, body: Any, density: float | None, surface: Surface, **values: Any
    ) -> Shape:
        """Add a shape; the scene says how."""
        raise NotImplementedError

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
    def add_ellipsoid(
        self,
        *,
        radii: Vector,
        pos: Vector = ORIGIN,
        quat: Vector = UPRIGHT,
        body: Body | Link | str | None = None,
        density: float | None = None,
        name: str | None = None,
        **surface: Unpack[Surface],
    ) -> Shape:
        """Add an ellipsoid with the ``radii`` along its axes [m]; the other arguments are those of `add_box`."""
        return self._add_shape("ellipsoid", name, body, density, surface, pos=pos, quat=quat, radii=radii)
