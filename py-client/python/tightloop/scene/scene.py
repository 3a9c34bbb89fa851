"""A scene: robots, bodies, shapes, time step and solver options. A scene is data; `tightloop.launch` runs it."""

from __future__ import annotations

import inspect
import json
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from tightloop import _core, notebook
from tightloop.checks import advice
from tightloop.checks import arguments as checks
from tightloop.checks.arguments import Vector
from tightloop.checks.signatures import checked_calls
from tightloop.errors import SceneError, UrdfError
from tightloop.files.kinds import instead, not_a_scene_ending
from tightloop.mujoco import mjcf
from tightloop.mujoco.model import MujocoModel
from tightloop.mujoco.scene_models import HULL_VERTICES, check_options, keep_beside, read_file, read_model
from tightloop.scene import height_fields
from tightloop.scene.body import Body
from tightloop.scene.options import FrictionCombine
from tightloop.scene.randomization import SceneRandomization
from tightloop.scene.robot import PER_DOF, Robot
from tightloop.scene.shapes import ORIGIN, UPRIGHT, Shape, Surface, checked_surface, with_surface
from tightloop.whole_files import whole_file

if TYPE_CHECKING:
    # typing has it from Python 3.11 on, the package runs on 3.10
    from typing_extensions import Unpack

    from tightloop.mujoco.scene_models import Model


@checked_calls
class Scene(SceneRandomization):
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

    __slots__ = ()

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
        super().__init__()
        self.dt = dt
        self.substeps = substeps
        self.gravity = gravity
        self.contacts_max = contacts_max
        self.rows_max = rows_max
        self.params = params
        self.command_delay_max = command_delay_max
        self.friction_combine = friction_combine

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
        if wrong := instead("add_urdf: path", path, "robot"):
            raise UrdfError(wrong)
        urdf = checks.path("add_urdf: path", path)
        touch = checked_surface("add_urdf", surface)
        if isinstance(package_dirs, str) or not isinstance(package_dirs, Sequence):
            raise SceneError(f"add_urdf: package_dirs is {package_dirs!r}; give a list of folders")
        packages = [checks.path("add_urdf: a folder of package_dirs", folder) for folder in package_dirs]
        for folder in packages:
            if not folder.is_dir():
                raise SceneError(
                    f"add_urdf: package_dirs names {folder}, which is no folder; mend or leave out the path"
                )
        folders = [str(folder) for folder in packages]
        vertices = checks.integer("add_urdf: mesh_max_hull_vertices", mesh_max_hull_vertices)
        decompose = checks.flag("add_urdf: convex_decomposition", convex_decomposition)
        turn = checks.flag("add_urdf: collada_up_axis", collada_up_axis)
        floating, strict = checks.flag("add_urdf: floating", floating), checks.flag("add_urdf: strict", strict)
        self_collisions = checks.flag("add_urdf: self_collisions", self_collisions)
        summary = json.loads(_core.read_urdf(str(urdf), folders, floating, strict, vertices, decompose, turn))
        own_name = re.sub(r"[^A-Za-z0-9_.\-]", "_", summary["name"])
        name = checks.name("robot", own_name if name is None else name, self._names())
        robot = Robot(
            name,
            urdf=urdf,
            package_dirs=packages,
            pos=pos,
            quat=quat,
            floating=floating,
            self_collisions=self_collisions,
            strict=strict,
            mesh_max_hull_vertices=vertices,
            convex_decomposition=decompose,
            collada_up_axis=turn,
            surface=touch,
            summary=summary,
        )
        self.robots[name] = robot
        robot._running = self._running
        self._changed("add_urdf")
        for warning in summary["warnings"]:
            advice.warn(f"robot `{name}`: {warning}")
        return robot

    @classmethod
    def from_mujoco(
        cls,
        model: Model,
        *,
        name: str | None = None,
        substeps: int = 1,
        mesh_max_hull_vertices: int = HULL_VERTICES,
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

        Returns:
            The scene; ``scene.models`` has the model.

        Raises:
            SceneError: MuJoCo cannot compile the model, or it has elements that are not supported, by their names.
            MissingLibrary: The extra ``mujoco`` is not installed.
        """
        substeps = checks.integer("from_mujoco: substeps", substeps)
        found = read_model(model, name, (), mesh_max_hull_vertices=mesh_max_hull_vertices)
        options = found.options
        scene = cls(dt=options["dt"], substeps=substeps, gravity=options["gravity"])
        scene.solver(**options["solver"])
        scene.models[found.name] = found
        found._running = scene._running
        return scene

    def add_mujoco(
        self,
        model: Model,
        *,
        name: str | None = None,
        pos: Vector = ORIGIN,
        quat: Vector = UPRIGHT,
        mesh_max_hull_vertices: int = HULL_VERTICES,
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

        Returns:
            The model.

        Raises:
            SceneError: An option of the model contradicts the scene's, or as `from_mujoco`.
            MissingLibrary: The extra ``mujoco`` is not installed.
        """
        found = read_model(
            model, name, self._names(), pos=pos, quat=quat, mesh_max_hull_vertices=mesh_max_hull_vertices
        )
        options = {"dt": self.dt, "gravity": self.gravity, "solver": asdict(self._solver)}
        for model_before in self.models.values():
            options["integrator"] = model_before.options["integrator"]
        check_options(found, options)
        self.models[found.name] = found
        found._running = self._running
        self._changed("add_mujoco")
        return found

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
        name = checks.name("body", self._free_name("body") if name is None else name, self._names())
        body = Body(name, pos=pos, quat=quat, mass=mass, com=com, inertia=inertia, fixed=fixed)
        self.bodies[name] = body
        body._running = self._running
        self._changed("add_body")
        return body

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

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the scene as a TOML file. Paths in it are relative if they share a folder with the file.

        MuJoCo models are copied into the folder ``NAME_models`` beside it, height fields into ``NAME_fields``. An
        existing file is replaced as a whole or, after an error, not at all.

        Args:
            path: The file.

        Raises:
            SceneError: The file cannot be written, or its ending is that of another format, such as ``.json``.
        """
        file = checks.path("save: path", path)
        if problem := not_a_scene_ending(file):
            raise SceneError(f"save: {problem}")
        kept = {model.name: keep_beside(file, model) for model in self.models.values()}
        paths = {
            shape.name: height_fields.keep_beside(file, shape.name, shape.path)
            for shape in self.shapes.values()
            if shape.type == "hfield" and shape.path is not None
        }
        _core.save_scene(self._json(kept, paths), str(file))

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Scene:
        """Read a scene file and the robots that it names.

        Args:
            path: The file.

        Raises:
            SceneError: The file is missing, or an entry in it is not valid.
            UrdfError: A robot of the scene cannot be read.
        """
        if wrong := instead("load: path", path, "scene"):
            raise SceneError(wrong)
        file = checks.path("load: path", path)
        return cls._made_of(_core.load_scene(str(file)), file.parent)

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
        given = inspect.signature(cls).parameters
        scene = cls(**{option: data[option] for option in given if option in data})
        scene.solver(**data["solver"])
        for table in data.get("robot", ()):
            joints = {name: table.pop(name) for name in PER_DOF if name in table}
            packages = [folder / package for package in table.pop("package_dirs", ())]
            robot = scene.add_urdf(folder / table.pop("urdf"), package_dirs=packages, **table)
            for name, values in joints.items():
                setattr(robot, name, values if name == "joint_target_mode" else np.array(values, dtype=float))
        for table in data.get("mujoco", ()):
            scene.models[table["name"]] = read_file(folder / table.pop("model"), **table)
        for table in data.get("body", ()):
            scene.add_body(**table)
        for shape in data.get("shape", ()):
            if "path" in shape:
                shape["path"] = folder / shape["path"]
            kind = shape.pop("type")
            if kind == "hfield":
                shape["elevation"] = shape.pop("path")
            getattr(scene, f"add_{kind}")(**shape)
        for pair in data.get("contact_filters", ()):
            scene.filter_contacts(*pair)
        for site in data.get("site", ()):
            scene.add_site(**site)
        for sensor in data.get("contact_sensor", ()):
            scene.add_contact_sensor(**sensor)
        for scan in data.get("height_scan", ()):
            scene._load_height_scan(scan)
        scene._load_offsets(data.get("randomize", {}))
        return scene

    def to_toml(self) -> str:
        """Return the text of a scene file with absolute paths, as a daemon gets it."""
        return _core.scene_to_toml(self._json())

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
        text = mjcf.written(json.loads(_core.compiled_scene(self.to_toml())), "scene")
        left = [*self.contact_sensors, *self.height_scans]
        if left:
            advice.warn(f"to_mujoco: MJCF has no equal of sensor {', '.join(map(repr, left))}; it is left out")
        drawn = sorted({*self.params, *self._offsets} & set(_core.param_names()))
        if drawn:
            advice.warn(f"to_mujoco: worlds differ in {', '.join(drawn)}; the text has the values of the scene")
        if path is not None:
            with whole_file(checks.path("to_mujoco: path", path), SceneError) as file:
                file.write_text(text, encoding="utf-8")
        return text

    def _repr_html_(self) -> str:
        rows = [("robot", name, f"{robot.dofs} dofs") for name, robot in self.robots.items()]
        rows += [("MuJoCo model", name, f"{len(model.dof_names)} dofs") for name, model in self.models.items()]
        rows += [("body", name, "fixed" if body.fixed else "free") for name, body in self.bodies.items()]
        rows += [("shape", shape.full_name, shape.type) for shape in self.shapes.values()]
        title = f"Scene: {self.substeps} steps of {self.dt:.6g} s per frame"
        return notebook.table(title, (), rows, notebook.picture_html("of_scene", self))

    def __repr__(self) -> str:
        parts = f"robots={[*self.robots]}, models={[*self.models]}, bodies={[*self.bodies]}, shapes={[*self.shapes]}"
        return f"Scene(dt={self.dt:.6g}, substeps={self.substeps}, {parts})"

    def _json(self, models: Mapping[str, Path] | None = None, fields: Mapping[str, Path] | None = None) -> str:
        """Return the scene as JSON, with other files of its models and height fields where these are given."""
        files = {name: {"model": str(file)} for name, file in (models or {}).items()}
        paths = {name: {"path": str(file)} for name, file in (fields or {}).items()}
        return json.dumps(
            {
                "dt": self.dt,
                "substeps": self.substeps,
                "gravity": self.gravity,
                "params": self.params,
                "command_delay_max": self.command_delay_max,
                "friction_combine": self.friction_combine,
                "contacts_max": self.contacts_max,
                "rows_max": self.rows_max,
                "contact_filters": self.filters,
                "solver": asdict(self._solver),
                "randomize": self._offsets,
                "shape": [shape.table() | paths.get(shape.name, {}) for shape in self.shapes.values()],
                "robot": [robot.table() for robot in self.robots.values()],
                "mujoco": [model.table() | files.get(model.name, {}) for model in self.models.values()],
                "body": [body.table() for body in self.bodies.values()],
                **self._sensor_tables(),
            }
        )
