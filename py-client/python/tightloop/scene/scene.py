"""A scene: robots, bodies, shapes, time step and solver options. A scene is data; `tightloop.launch` runs it."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, SupportsFloat, SupportsIndex, TypeVar

from numpy.typing import ArrayLike

from tightloop import _core, notebook
from tightloop.checks import advice
from tightloop.checks import arguments as checks
from tightloop.checks.arguments import Triple, Vector
from tightloop.checks.attributes import ByName
from tightloop.checks.running import Running
from tightloop.checks.signatures import checked_calls
from tightloop.mujoco.model import MujocoModel
from tightloop.mujoco.scene_models import HULL_VERTICES, check_options, read_model
from tightloop.scene import make_sensors, make_shapes, options, randomization, scene_file, urdf
from tightloop.scene.body import Body
from tightloop.scene.cameras.camera import Camera
from tightloop.scene.cameras.methods import CameraMethods
from tightloop.scene.entity import Entity
from tightloop.scene.options import Cone, FrictionCombine, Options
from tightloop.scene.parts import Collidable, FreeNames, collidable_name, part_names, summary
from tightloop.scene.primitives import Primitives
from tightloop.scene.randomization import BodyOffsets, Offsets, ParamRanges
from tightloop.scene.robot import Link, Robot
from tightloop.scene.sensors import ContactSensor, HeightScan, Site
from tightloop.scene.shapes import ORIGIN, UPRIGHT, Shape, ShapeType, Surface, checked_surface, with_surface

if TYPE_CHECKING:
    # typing has it from Python 3.11 on, the package runs on 3.10
    from typing_extensions import Unpack

    from tightloop.mujoco.scene_models import Model

Part = TypeVar("Part", bound=Entity)


@checked_calls
class Scene(CameraMethods, Primitives):
    """A scene: robots, bodies and shapes, time step and solver options, and what varies between worlds.

    In the arrays of a frame, robots come first, then bodies, each in the order in which they were added.

    Args:
        dt: Length of a physics step [s], above 0.
        substeps: Physics steps per control frame, at least 1. One `Sim.step` advances ``substeps * dt`` seconds.
        gravity: Acceleration of gravity [m/s²], world axes, z up.
        contacts_max: Capacity for contacts of a world, 1 to 4096; None is as many as its shapes can have, at most 512.
            Further contacts are left out, counted and flagged in the world's status.
        rows_max: Capacity for constraint rows of contacts of a world, 1 to 16384; None is as many as its contacts need.
        params: Model parameters that vary between worlds, besides those named at launch; see `launch`.
        command_delay_max: Largest ``command_delay`` of a world, if it varies [substeps]; None is four control frames.
            Each control frame of it takes memory for one frame of commands in every world.
        friction_combine: How the coefficients of friction of two shapes combine: ``"max"``, ``"mean"``, ``"min"`` or
            ``"product"``. A contact with a geom of a MuJoCo model keeps MuJoCo's rule.

    Raises:
        SceneError: A value is out of range; the message names it.
    """

    # a copy takes them in this order, and nothing that comes before `_running` warns that a launched scene changes
    __slots__ = (  # noqa: RUF023
        "_distributions", "_free_names", "_options",
        "bodies", "cameras", "contact_sensors", "filters", "height_scans", "models", "robots", "shapes", "sites",
        "_running",
    )  # fmt: skip

    def __init__(
        self,
        *,
        dt: float = 1 / 480,
        substeps: int = 8,
        gravity: Vector = (0.0, 0.0, -9.81),
        contacts_max: int | None = None,
        rows_max: int | None = None,
        params: Iterable[str] = (),
        command_delay_max: int | None = None,
        friction_combine: FrictionCombine = "max",
    ) -> None:
        self._running = Running()
        self._options = Options()
        self._distributions: dict[str, dict[str, Any]] = {}
        self._free_names = FreeNames()
        self.robots: dict[str, Robot] = ByName("robot")
        self.models: dict[str, MujocoModel] = ByName("MuJoCo model")
        self.bodies: dict[str, Body] = ByName("body")
        self.shapes: dict[str, Shape] = ByName("shape")
        self.filters: list[tuple[str, str]] = []
        self.sites: dict[str, Site] = ByName("site")
        self.contact_sensors: dict[str, ContactSensor] = ByName("contact sensor")
        self.height_scans: dict[str, HeightScan] = ByName("height scan")
        self.cameras: dict[str, Camera] = ByName("camera")
        self.dt = dt
        self.substeps = substeps
        self.gravity = gravity
        self.contacts_max = contacts_max
        self.rows_max = rows_max
        self.params = params
        self.command_delay_max = command_delay_max
        self.friction_combine = friction_combine

    @property
    def dt(self) -> float:
        """Length of a physics step [s]."""
        return self._options.dt

    @dt.setter
    def dt(self, dt: SupportsFloat) -> None:
        self._options = replace(self._options, dt=options.checked_dt(dt))

    @property
    def substeps(self) -> int:
        """Physics steps per control frame."""
        return self._options.substeps

    @substeps.setter
    def substeps(self, substeps: SupportsIndex) -> None:
        self._options = replace(self._options, substeps=options.checked_substeps(substeps))

    @property
    def gravity(self) -> Triple:
        """Acceleration of gravity [m/s²], world axes."""
        return self._options.gravity

    @gravity.setter
    def gravity(self, gravity: Vector) -> None:
        self._options = replace(self._options, gravity=options.checked_gravity(gravity))

    @property
    def params(self) -> tuple[str, ...]:
        """Model parameters that vary between worlds, besides those named at launch; see `launch`."""
        return self._options.params

    @params.setter
    def params(self, params: Iterable[str]) -> None:
        self._options = replace(self._options, params=options.checked_params(params))

    @property
    def command_delay_max(self) -> int | None:
        """Largest ``command_delay`` of a world [substeps]; None is four control frames."""
        return self._options.command_delay_max

    @command_delay_max.setter
    def command_delay_max(self, command_delay_max: SupportsIndex | None) -> None:
        checked = options.checked_command_delay_max(command_delay_max, self.substeps)
        self._options = replace(self._options, command_delay_max=checked)

    @property
    def contacts_max(self) -> int | None:
        """Capacity for contacts of a world; None is as many as its shapes can have, at most 512."""
        return self._options.contacts_max

    @contacts_max.setter
    def contacts_max(self, contacts_max: SupportsIndex | None) -> None:
        self._options = replace(self._options, contacts_max=options.checked_contacts_max(contacts_max))

    @property
    def rows_max(self) -> int | None:
        """Capacity for constraint rows of contacts of a world; None is as many as its contacts need."""
        return self._options.rows_max

    @rows_max.setter
    def rows_max(self, rows_max: SupportsIndex | None) -> None:
        self._options = replace(self._options, rows_max=options.checked_rows_max(rows_max))

    @property
    def friction_combine(self) -> FrictionCombine:
        """How the coefficients of friction of two shapes combine."""
        return self._options.friction_combine

    @friction_combine.setter
    def friction_combine(self, friction_combine: FrictionCombine) -> None:
        self._options = replace(self._options, friction_combine=options.checked_friction_combine(friction_combine))

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
        solver = options.checked_solver(iterations, ls_iterations, tolerance, cone, impratio)
        self._changed("solver")
        self._options = replace(self._options, solver=solver)

    @with_surface
    def add_urdf(
        self,
        path: str | os.PathLike[str],
        *,
        name: str | None = None,
        pos: Vector = ORIGIN,
        quat: Vector = UPRIGHT,
        floating: bool = False,
        self_collisions: bool = False,
        strict: bool = False,
        mesh_max_hull_vertices: int = 64,
        convex_decomposition: bool = False,
        collada_up_axis: bool = False,
        package_dirs: Sequence[str | os.PathLike[str]] = (),
        **surface: Unpack[Surface],
    ) -> Robot:
        """Add a robot from a URDF file; the file is read and checked at once.

        Args:
            path: The URDF file.
            name: Unique name, which precedes joint and link names; the robot's name in the file if left out.
            pos: Position of the root link in the world [m].
            quat: Orientation of the root link (x, y, z, w).
            floating: Whether the root link moves freely.
            self_collisions: Whether links of this robot collide with each other; neighbours never do. What a floating
                or planar joint separates from a fixed link collides with it in any case.
            strict: Whether to refuse an inertia that no body can have (A + B < C). Otherwise it is balanced as in
                MuJoCo, with a warning.
            mesh_max_hull_vertices: Largest number of vertices of the convex hull of a collision mesh, 8 to 1024.
                `Robot.notes` reports an error of the hull above 1 mm or 1 % of the mesh.
            convex_decomposition: Whether a concave collision mesh becomes several convex hulls instead of one.
            collada_up_axis: Whether COLLADA meshes are turned from their ``<up_axis>`` to z up. RViz does not, and many
                exporters write ``Y_UP`` into files that are z up. ``<unit>`` always counts.
            package_dirs: Folders with the packages of ``package://`` paths; the folders above the file if left out.
            **surface: Contact parameters of all shapes of the file: ``mu``, ``ke``, ``kd``, ``kf``, ``margin``,
                ``gap``, ``condim``, ``group``, see `tightloop.Surface`.

        Returns:
            The robot, whose properties set start state, drives and limits.

        Warns:
            TightloopWarning: Inertias were balanced, or visual meshes are missing; `Robot.notes` has all notes.

        Raises:
            UrdfError: The file is missing, is not URDF, or describes a robot that cannot be simulated.
            SceneError: An argument is not valid; the message names it.
        """
        robot, warnings = urdf.read_robot(
            path, name, taken=part_names(self), pos=pos, quat=quat, floating=floating,
            self_collisions=self_collisions, strict=strict, mesh_max_hull_vertices=mesh_max_hull_vertices,
            convex_decomposition=convex_decomposition, collada_up_axis=collada_up_axis, package_dirs=package_dirs,
            surface=surface,
        )  # fmt: skip
        self._add(self.robots, robot, "add_urdf")
        for warning in warnings:
            advice.warn(f"robot `{robot.name}`: {warning}")
        return robot

    @classmethod
    def from_mujoco(
        cls,
        model: Model,
        *,
        name: str | None = None,
        substeps: int = 1,
        mesh_max_hull_vertices: int = HULL_VERTICES,
        without: Sequence[str] = (),
    ) -> Scene:
        """Make a scene of a MuJoCo model, with its time step, gravity and solver options.

        MuJoCo reads and compiles the model. The result is kept in a file in the user's cache, and `save` copies it
        beside the scene, so that the scene runs on machines without MuJoCo.

        Args:
            model: A path to MJCF, an ``mujoco.MjSpec`` or an ``mujoco.MjModel``.
            name: Name of the model, which precedes the names of its joints, bodies and geoms; the model's own if left
                out.
            substeps: Physics steps per control frame.
            mesh_max_hull_vertices: Largest number of vertices of the convex hull of a mesh, 8 to 1024.
            without: Names of elements and options that tightloop does not support, to run the model without them. The
                model's ``notes`` say what that changes.

        Returns:
            The scene; ``scene.models`` has the model.

        Raises:
            SceneError: MuJoCo cannot compile the model, it has elements that are not supported, by their names, or
                ``without`` names what it does not have, or what is supported.
            MissingLibrary: The extra ``mujoco`` is not installed.
        """
        substeps = checks.integer("from_mujoco: substeps", substeps)
        read = read_model(model, name, (), mesh_max_hull_vertices=mesh_max_hull_vertices, without=without)
        scene = cls(dt=read.options["dt"], substeps=substeps, gravity=read.options["gravity"])
        scene.solver(**read.options["solver"])
        scene._add(scene.models, read, "add_mujoco")
        return scene

    def add_mujoco(
        self,
        model: Model,
        *,
        name: str | None = None,
        pos: Vector = ORIGIN,
        quat: Vector = UPRIGHT,
        mesh_max_hull_vertices: int = HULL_VERTICES,
        without: Sequence[str] = (),
    ) -> MujocoModel:
        """Add a MuJoCo model, beside robots from URDF and bodies of the scene.

        The first model sets the integrator of the scene. Geoms of MuJoCo models touch each other by MuJoCo's rules.
        Against a geom, a shape of the scene counts as a geom with its friction, ``solref`` (2/kd, kd/(2 √ke)) and
        MuJoCo's defaults.

        Args:
            model: A path to MJCF, an ``mujoco.MjSpec`` or an ``mujoco.MjModel``.
            name: Unique name, which precedes the names of its joints, bodies and geoms; the model's own if left out.
            pos: Position of the model's world in the scene [m].
            quat: Orientation of the model's world in the scene (x, y, z, w).
            mesh_max_hull_vertices: Largest number of vertices of the convex hull of a mesh, 8 to 1024.
            without: As in `from_mujoco`.

        Returns:
            The model.

        Raises:
            SceneError: An option of the model contradicts the scene's, or as `from_mujoco`.
            MissingLibrary: The extra ``mujoco`` is not installed.
        """
        read = read_model(
            model,
            name,
            part_names(self),
            pos=pos,
            quat=quat,
            mesh_max_hull_vertices=mesh_max_hull_vertices,
            without=without,
        )
        check_options(read, asdict(self._options), self.models)
        return self._add(self.models, read, "add_mujoco")

    def add_body(
        self,
        *,
        pos: Vector = ORIGIN,
        quat: Vector = UPRIGHT,
        mass: float | None = None,
        com: Vector | None = None,
        inertia: ArrayLike | None = None,
        fixed: bool = False,
        name: str | None = None,
    ) -> Body:
        """Add a rigid body, such as a cube to grasp. `add_box` and the other shape methods give it shapes.

        Without ``mass``, its shapes and their densities set the mass. With ``mass`` and without ``inertia``, it has the
        inertia of its shapes scaled to that mass or, without shapes, that of a solid sphere of 1000 kg/m³.

        Args:
            pos: Position of its frame at the start [m].
            quat: Orientation of its frame at the start (x, y, z, w).
            mass: Mass [kg], above 0.
            com: Centre of mass in the body's frame [m]; that of its shapes, or the origin, if left out.
            inertia: Inertia about the centre of mass in body axes [kg·m²], shape ``(3, 3)``, or a diagonal ``(3,)``.
            fixed: Whether the body does not move; otherwise it moves freely.
            name: Unique name; ``body``, ``body_2``, … if left out.

        Returns:
            The body, for the argument ``body`` of the shape methods.

        Raises:
            SceneError: A value is out of range; the message names it.
        """
        name = self._checked_name("body", name)
        body = Body(name, pos=pos, quat=quat, mass=mass, com=com, inertia=inertia, fixed=fixed)
        return self._add(self.bodies, body, "add_body")

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
        sizes = make_shapes.read_mesh(path, scale, max_hull_vertices, convex_decomposition)
        return self._add_shape("mesh", name, body, density, surface, checked_sizes=sizes, pos=pos, quat=quat)

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
        sizes = make_shapes.read_height_field(elevation, size, base)
        return self._add_shape("hfield", name, None, None, surface, checked_sizes=sizes, pos=pos, quat=quat)

    @with_surface
    def add_plane(
        self, *, pos: Vector = ORIGIN, quat: Vector = UPRIGHT, name: str | None = None, **surface: Unpack[Surface]
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
        name = self._free_names.take("ground", part_names(self)) if name is None else name
        return self.add_plane(pos=(0.0, 0.0, height), name=name, **surface)

    @with_surface
    def add_table(self, *, name: str = "table", **surface: Unpack[Surface]) -> Shape:
        """Add the table of the lesson: a static box of 0.8 × 0.8 × 0.1 m with its top at z = 0.1 m, at (0, -0.5) m."""
        return self.add_box(half_extents=(0.4, 0.4, 0.05), pos=(0.0, -0.5, 0.05), name=name, **surface)

    @with_surface
    def add_cube(
        self,
        *,
        pos: Vector = (0.0, -0.35, 0.125),
        quat: Vector = UPRIGHT,
        name: str = "cube",
        **surface: Unpack[Surface],
    ) -> Body:
        """Add the cube of the lesson, which rests on its table: a free box of 5 cm side length and 400 kg/m³.

        Args:
            pos: Centre at the start [m].
            quat: Orientation at the start (x, y, z, w).
            name: Name of the body.
            **surface: Contact parameters, see `add_box`. The margin is 1 mm if left out.

        Returns:
            The body.
        """
        checked_surface(f"body `{name}`", surface)
        surface.setdefault("margin", 1e-3)
        cube = self.add_body(pos=pos, quat=quat, name=name)
        self.add_box(half_extents=(0.025, 0.025, 0.025), body=cube, density=400.0, **surface)
        return cube

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
        self.filters.append((collidable_name(self, f"{what}: a", a), collidable_name(self, f"{what}: b", b)))

    def add_site(
        self,
        *,
        body: Body | Link | str | None = None,
        pos: Vector = ORIGIN,
        quat: Vector = UPRIGHT,
        relative_to: Site | Body | Link | str | None = None,
        damping: float = 0.05,
        name: str | None = None,
    ) -> Site:
        """Add a site, a frame of interest such as a tool tip, a camera or an inertial measurement unit.

        The fields ``site_q``, ``site_qd``, ``gyro``, ``accelerometer`` and ``site_inverse_jacobian`` have one row per
        site, in the order in which sites were added; ``launch(fields=...)`` asks for them. `Sim.params` has their
        noise.

        Args:
            body: Body that carries the site, a robot's link (``robot.link("hand")``), or the name of either
                (``"cube"``, ``"arm/hand"``). None for a site that is fixed in the world.
            pos: Position in the frame of the body [m].
            quat: Orientation in that frame (x, y, z, w).
            relative_to: Site, body or link that is the reference frame: ``site_q`` and ``site_qd`` are relative to it
                and in its axes, as for MuJoCo's frame sensors with a reference. None for the world. ``gyro`` and
                ``accelerometer`` are always in the site's own axes.
            damping: Damping λ of ``site_inverse_jacobian``, Jᵀ (J Jᵀ + λ² I)⁻¹ [m or rad], from 1e-6 to 1e6. It halves
                the joint motion in a direction where a unit of joint motion moves the site by λ, and reduces it more
                where it moves the site less. With a stretched arm, ``f32`` has three correct digits at 0.01, and fewer
                below.
            name: Unique name; ``site``, ``site_2``, … if left out.

        Returns:
            The site.

        Raises:
            SceneError: A value is out of range, or the body, link or site does not exist; the message names it.
        """
        return make_sensors.add_site(
            self, name=name, body=body, pos=pos, quat=quat, relative_to=relative_to, damping=damping
        )

    def add_contact_sensor(
        self, *, of: Collidable, against: Collidable | None = None, name: str | None = None
    ) -> ContactSensor:
        """Add a contact sensor: the sum of the contact forces on shapes, from all others or from some.

        The field ``contact_sensor`` has one row per sensor, in world axes [N]. ``body_contact_force`` has the sum of
        every body.

        Args:
            of: A shape; a robot, body or link for all its shapes; or a name as in ``sim.shape_names``.
            against: Where the forces come from, likewise; None for all contacts.
            name: Unique name; ``contact``, ``contact_2``, … if left out.

        Returns:
            The sensor.

        Raises:
            SceneError: A shape, robot, body or link does not exist in the scene; the message names it.
        """
        return make_sensors.add_contact_sensor(self, name, of, against)

    def add_height_scan(
        self,
        *,
        body: Body | Link | str | None = None,
        pos: Vector = ORIGIN,
        size: Vector = (1.6, 1.0),
        shape: tuple[int, int] = (17, 11),
        reach: float = 10.0,
        name: str | None = None,
    ) -> HeightScan:
        """Add a height scan: how far the ground is below a frame, at the points of a grid that turns with its yaw.

        The ground is the static planes and height fields of the scene; other shapes are not seen. The field
        ``height_scan``, shape ``(worlds, rays)``, has all scans one after another; ``launch(fields=...)`` asks for it.
        A value is the height of the frame above the ground [m], negative where the ground is higher.

        Args:
            body: Body that carries the grid, a robot's link (``robot.link("trunk")``), or the name of either; links of
                a MuJoCo model as ``"model/body"``. None for a grid that is fixed in the world.
            pos: Middle of the grid in the frame of the body [m].
            size: Lengths of the grid along x and y of the frame [m].
            shape: Rays along x and y.
            reach: The value where the ground is farther away, or where there is none [m].
            name: Unique name; ``scan``, ``scan_2``, … if left out.

        Returns:
            The scan; ``frame.height_scan[:, scan.rays]`` are its values, x innermost.

        Raises:
            SceneError: A value is out of range, or the body does not exist; the message names it.
        """
        return make_sensors.add_height_scan(self, name=name, body=body, pos=pos, size=size, shape=shape, reach=reach)

    def randomize(
        self,
        *,
        joint_q: Offsets | None = None,
        joint_qd: Offsets | None = None,
        body_q: BodyOffsets | None = None,
        body_qd: BodyOffsets | None = None,
        params: ParamRanges | None = None,
        cameras: BodyOffsets | None = None,
    ) -> None:
        """Randomize start states and parameters of worlds, at launch and at each `Sim.reset`.

        A draw of the state is an offset from the scene's start. A draw of a parameter replaces the scene's value, and
        is no factor of it. Only ``body_mass_scale`` is one: it multiplies mass and inertia of a link. `Sim.reset` says
        what a draw depends on.

        >>> scene.randomize(
        ...     joint_q={"arm": tl.Uniform(-0.1, 0.1), "arm/fr3_joint4": tl.Normal(0.0, 0.02)},
        ...     body_q={"cube": {"x": tl.Uniform(-0.05, 0.05), "yaw": tl.Uniform(-3.14, 3.14)}},
        ...     params={
        ...         "shape_mu": {"cube/box": tl.Uniform(0.1, 1.0)},
        ...         "body_mass_scale": {"cube": tl.Uniform(0.8, 1.2)},  # factors; body_mass takes kilograms
        ...         "gravity": {"z": tl.Normal(-9.81, 0.1)},
        ...     },
        ... )

        Args:
            joint_q: `Uniform` or `Normal` offsets of joint positions [rad or m], by ``"robot/joint"``, by
                ``"robot/joint.part"`` for a joint with several dofs, or by ``"robot"`` for all its joints. The more
                specific name has priority, in any order. Limits clamp the position. A mimic joint follows its leader,
                and only the leader's limits apply. A ball joint rotates by a rotation vector in the child's axes.
            joint_qd: Distributions of joint velocities [rad/s or m/s], by the same names.
            body_q: Offsets of the poses of free bodies (``"cube"``), floating robots (``"dog"``) and floating joints
                (``"robot/joint"``): ``x``, ``y``, ``z`` [m] along the world's axes; ``roll``, ``pitch``, ``yaw`` [rad]
                about the world's fixed x, y, z axes in that order, through the frame's origin, after the start
                orientation.
            body_qd: Their velocities in world axes: ``vx``, ``vy``, ``vz`` [m/s] of the centre of mass (of all links
                fixed to the body, as in ``joint_qd`` of a frame), ``wx``, ``wy``, ``wz`` [rad/s].
            params: Parameters by name, as `launch` lists them, each with distributions by name: ``"robot"`` or a body
                for all its values, ``"robot/joint"``, ``"robot/link"``, a shape as in `Sim.shape_names`; ``x``, ``y``,
                ``z`` of gravity. A parameter with one value per world takes a distribution directly. The more specific
                name has priority. These parameters vary without being named at launch. `Sim.params` reads them; values
                that it writes last until the world's next reset. Draws below a parameter's minimum become the minimum.
                ``body_f`` cannot be drawn. Delays are clamped to ``Scene.command_delay_max`` and rounded up to whole
                substeps.
            cameras: Offsets of cameras by name, in their own axes: ``x``, ``y``, ``z`` [m], ``roll``, ``pitch`` and
                ``yaw`` [rad] about the fixed axes x (right), y (down) and z (forward) in that order, and ``focal``, a
                part of the focal lengths [–]: 0.1 makes them a tenth longer.

        A later call adds to earlier ones, and replaces the distributions that it names again.

        Raises:
            SceneError: A name does not exist in the scene, or a value is not a distribution; nothing changed. `launch`
                checks names and values of ``params``, when all shapes are known.
        """
        drawn = randomization.checked(
            self, joint_q=joint_q, joint_qd=joint_qd, body_q=body_q, body_qd=body_qd, params=params, cameras=cameras
        )
        self._changed("randomize")
        randomization.merge(drawn, self._distributions)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the scene as a TOML file. Paths in it are relative if they share a folder with the file.

        MuJoCo models are copied into the folder ``NAME_models`` beside it, height fields into ``NAME_fields``. An
        existing file is replaced as a whole or, after an error, not at all.

        Args:
            path: The file.

        Raises:
            SceneError: The file cannot be written, or its ending is that of another format, such as ``.json``.
        """
        scene_file.save(self, checks.path("save: path", path), self._options, self._distributions)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Scene:
        """Read a scene file and the robots that it names.

        Args:
            path: The file.

        Raises:
            SceneError: The file is missing, or an entry in it is not valid.
            UrdfError: A robot of the scene cannot be read.
        """
        return cls._made_of(*scene_file.read(path))

    @classmethod
    def from_toml(cls, text: str, folder: str | os.PathLike[str] = ".") -> Scene:
        """Read the text of a scene file, as `to_toml` returns it, and the robots that it names.

        Args:
            text: The text.
            folder: Folder that relative paths begin in.

        Raises:
            SceneError: An entry is not valid.
            UrdfError: A robot of the scene cannot be read.
        """
        return cls._made_of(_core.parse_scene(checks.text("from_toml: text", text)), checks.path("folder", folder))

    @classmethod
    def _made_of(cls, tables: str, folder: Path) -> Scene:
        """Make a scene of its tables as JSON, whose paths are relative to a folder."""
        data = json.loads(tables)
        scene = cls(**{option: data[option] for option in options.NAMES if option in data})
        scene_file.fill(scene, data, folder)
        return scene

    def to_toml(self) -> str:
        """Return the text of a scene file with absolute paths, as a daemon gets it."""
        return _core.scene_to_toml(scene_file.written(self, self._options, self._distributions))

    def to_mujoco(self, path: str | os.PathLike[str] | None = None) -> str:
        """Return the scene as MJCF, which MuJoCo compiles to the same mass matrix, bias forces, drives and contacts.

        The text comes from the model that `launch` would run: inertias are balanced, fixed links merged where MuJoCo
        merges them, and convex hulls are written out, so the text needs no mesh files. Names stay, such as
        ``arm/joint1``. Keyframe ``start`` is the start of the scene with the targets of its drives. ``substeps`` steps
        of MuJoCo are one control frame.

        Args:
            path: File to write, too. An existing file is replaced.

        Returns:
            The XML text, for ``mujoco.MjModel.from_xml_string``.

        Raises:
            SceneError: The scene does not compile, or part of it has no equal in MJCF: a MuJoCo model, a drive of a
                ball joint, damping of a free joint. The message names it. Or the file cannot be written.
        """
        return scene_file.to_mujoco(self, self.to_toml(), {*self.params, *self._distributions}, path)

    def _add_shape(
        self, kind: ShapeType, name: str | None, body: Any, density: float | None, surface: Surface, **values: Any
    ) -> Shape:
        name = self._checked_name(kind, name)
        shape = make_shapes.shape(self, kind, name, body, density, surface=surface, **values)
        self.shapes[name] = shape
        self._changed("add_ground" if kind == "plane" else f"add_{kind}")
        return shape

    def _checked_name(self, kind: str, name: str | None) -> str:
        """Return the name of a new part, a free one if none was given."""
        taken = part_names(self)
        return checks.name(kind, self._free_names.take(kind, taken) if name is None else name, taken)

    def _add(self, parts: dict[str, Part], part: Part, method: str) -> Part:
        """Add a robot, model or body, whose later changes warn as those of the scene do."""
        parts[part.name] = part
        part._running = self._running
        self._changed(method)
        return part

    def _changed(self, attribute: str) -> None:
        running = getattr(self, "_running", None)  # which a copy gets last
        if running is not None:
            running.tell("Scene", attribute)

    def _repr_html_(self) -> str:
        title = f"Scene: {self.substeps} steps of {self.dt:.6g} s per frame"
        return notebook.table(title, (), summary(self), notebook.picture_html("of_scene", self))

    def __repr__(self) -> str:
        parts = f"robots={[*self.robots]}, models={[*self.models]}, bodies={[*self.bodies]}, shapes={[*self.shapes]}"
        return f"Scene(dt={self.dt:.6g}, substeps={self.substeps}, {parts})"
