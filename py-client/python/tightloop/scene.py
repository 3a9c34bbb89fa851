"""What is simulated: robots, static shapes, time step and solver. A scene is data; `tightloop.launch` runs it."""

from __future__ import annotations

import json
import os
import re
import warnings
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal, SupportsFloat, SupportsIndex

import numpy as np

from tightloop import _core, checks
from tightloop.checks import Quaternion, Triple, Vector
from tightloop.errors import SceneError
from tightloop.robot import PER_DOF, Robot

Cone = Literal["elliptic", "pyramidal"]
ShapeType = Literal["box", "sphere", "cylinder", "capsule"]

_ORIGIN = (0.0, 0.0, 0.0)
_UPRIGHT = (0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True)
class StaticShape:
    """A shape that never moves: ``pos`` [m] and ``quat`` (x, y, z, w) of its centre in the world, and its sizes [m]."""

    name: str
    type: ShapeType
    pos: Triple
    quat: Quaternion
    half_extents: Triple | None = None
    radius: float | None = None
    half_height: float | None = None


@dataclass(frozen=True)
class Solver:
    """Options of the constraint solver; see `Scene.solver`."""

    iterations: int = 20
    ls_iterations: int = 100
    tolerance: float = 1e-8
    cone: Cone = "elliptic"
    impratio: float = 1000.0


class Scene:
    """Robots and static shapes, and how time advances.

    Args:
        dt: Length of a physics step [s], above 0.
        substeps: Physics steps a control frame, at least 1. One `Sim.step` advances ``substeps * dt`` seconds.
        gravity: Acceleration of gravity [m/s²], world axes, z up.

    Raises:
        SceneError: A value is out of range; the message names it.
    """

    __slots__ = ("_dt", "_gravity", "_solver", "_substeps", "robots", "shapes")

    def __init__(self, *, dt: float = 1 / 480, substeps: int = 8, gravity: Vector = (0.0, 0.0, -9.81)) -> None:
        self.dt = dt
        self.substeps = substeps
        self.gravity = gravity
        self.robots: dict[str, Robot] = {}
        self.shapes: dict[str, StaticShape] = {}
        self._solver = Solver()

    @property
    def dt(self) -> float:
        """Length of a physics step [s]."""
        return self._dt

    @dt.setter
    def dt(self, dt: SupportsFloat) -> None:
        self._dt = checks.number("Scene: dt", dt, above=0.0)

    @property
    def substeps(self) -> int:
        """Physics steps a control frame."""
        return self._substeps

    @substeps.setter
    def substeps(self, substeps: SupportsIndex) -> None:
        self._substeps = checks.integer("Scene: substeps", substeps)

    @property
    def gravity(self) -> Triple:
        """Acceleration of gravity [m/s²], world axes."""
        return self._gravity

    @gravity.setter
    def gravity(self, gravity: Vector) -> None:
        self._gravity = checks.triple("Scene: gravity", gravity)

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
            iterations: Newton iterations a physics step, at most.
            ls_iterations: Line-search iterations a Newton iteration, at most.
            tolerance: The solver stops once its scaled improvement or gradient is smaller [–]; at 0 it never does.
            cone: Friction cone of contacts, ``"elliptic"`` or ``"pyramidal"``.
            impratio: Frictional over normal impedance of elliptic contacts [–], above 0.
        """
        checks.choice("cone", cone, ("elliptic", "pyramidal"))
        self._solver = Solver(
            iterations=checks.integer("solver: iterations", iterations),
            ls_iterations=checks.integer("solver: ls_iterations", ls_iterations),
            tolerance=checks.number("solver: tolerance", tolerance, least=0.0),
            cone=cone,
            impratio=checks.number("solver: impratio", impratio, above=0.0),
        )

    def add_box(
        self, *, half_extents: Vector, pos: Vector = _ORIGIN, quat: Vector = _UPRIGHT, name: str | None = None
    ) -> StaticShape:
        """Add a static box.

        Args:
            half_extents: Half the length of each side [m], above 0.
            pos: Centre in the world [m].
            quat: Orientation (x, y, z, w).
            name: Unique name; ``box``, ``box_2``, … if left out.
        """
        return self._add_shape("box", name, pos, quat, half_extents=half_extents)

    def add_sphere(
        self, *, radius: float, pos: Vector = _ORIGIN, quat: Vector = _UPRIGHT, name: str | None = None
    ) -> StaticShape:
        """Add a static sphere of that radius [m]; the rest as in `add_box`."""
        return self._add_shape("sphere", name, pos, quat, radius=radius)

    def add_cylinder(
        self,
        *,
        radius: float,
        half_height: float,
        pos: Vector = _ORIGIN,
        quat: Vector = _UPRIGHT,
        name: str | None = None,
    ) -> StaticShape:
        """Add a static cylinder along its z axis, sizes [m]; the rest as in `add_box`."""
        return self._add_shape("cylinder", name, pos, quat, radius=radius, half_height=half_height)

    def add_capsule(
        self,
        *,
        radius: float,
        half_height: float,
        pos: Vector = _ORIGIN,
        quat: Vector = _UPRIGHT,
        name: str | None = None,
    ) -> StaticShape:
        """Add a static capsule along its z axis, sizes [m]; ``half_height`` is that between the caps' centres."""
        return self._add_shape("capsule", name, pos, quat, radius=radius, half_height=half_height)

    def add_urdf(
        self,
        path: str | os.PathLike[str],
        *,
        name: str | None = None,
        pos: Vector = _ORIGIN,
        quat: Vector = _UPRIGHT,
        floating: bool = False,
        self_collisions: bool = False,
        strict: bool = False,
        mesh_max_hull_vertices: int = 64,
        convex_decomposition: bool = False,
        package_dirs: Sequence[str | os.PathLike[str]] = (),
    ) -> Robot:
        """Add a robot from a URDF file, which is read and checked at once.

        Args:
            path: The URDF file.
            name: Unique name, which stands before joint and link names; the robot's name in the file if left out.
            pos: Where the root link stands in the world [m].
            quat: Its orientation (x, y, z, w).
            floating: Whether the root link moves freely.
            self_collisions: Whether links of this robot touch each other (neighbours never do).
            strict: Whether an inertia that no body can have (A + B < C) is refused. Otherwise it is balanced as MuJoCo
                does, with a warning.
            mesh_max_hull_vertices: Most vertices of the convex hull that stands for a collision mesh in contacts, 8 to 1024.
                Its error is noted where it exceeds 1 mm or 1% of the mesh.
            convex_decomposition: Whether a concave collision mesh becomes several convex hulls rather than one.
            package_dirs: Folders that hold the packages of ``package://`` paths; those above the file if left out.

        Returns:
            The robot, to set start state, drives and limits.

        Warns:
            UserWarning: Inertias were balanced, or visual meshes are missing; ``Robot.notes`` has everything.

        Raises:
            UrdfError: The file is missing, is not URDF, or describes a robot that cannot be simulated.
        """
        urdf = checks.path("add_urdf: path", path)
        if isinstance(package_dirs, str) or not isinstance(package_dirs, Sequence):
            raise SceneError(f"add_urdf: package_dirs is {package_dirs!r}; give a list of folders")
        packages = [checks.path("add_urdf: a folder of package_dirs", folder) for folder in package_dirs]
        folders = [str(folder) for folder in packages]
        vertices = checks.integer("add_urdf: mesh_max_hull_vertices", mesh_max_hull_vertices)
        decompose = bool(convex_decomposition)
        summary = json.loads(_core.read_urdf(str(urdf), folders, bool(floating), bool(strict), vertices, decompose))
        own_name = re.sub(r"[^A-Za-z0-9_.\-]", "_", summary["name"])
        name = checks.name("robot", own_name if name is None else name, self._names())
        robot = Robot(
            name,
            urdf=urdf,
            package_dirs=packages,
            pos=pos,
            quat=quat,
            floating=bool(floating),
            self_collisions=bool(self_collisions),
            strict=bool(strict),
            mesh_max_hull_vertices=vertices,
            convex_decomposition=decompose,
            summary=summary,
        )
        self.robots[name] = robot
        for warning in summary["warnings"]:
            warnings.warn(f"robot `{name}`: {warning}", stacklevel=2)
        return robot

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the scene as a TOML file; paths inside are relative to that file where they share a folder with it.

        Raises:
            SceneError: The file cannot be written.
        """
        _core.save_scene(self._json(), str(checks.path("save: path", path)))

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Scene:
        """Read a scene file, and the robots that it names.

        Raises:
            SceneError: The file is missing, or an entry in it is wrong.
            UrdfError: A robot in it cannot be read.
        """
        file = checks.path("load: path", path)
        data = json.loads(_core.load_scene(str(file)))
        scene = cls(dt=data["dt"], substeps=data["substeps"], gravity=data["gravity"])
        scene.solver(**data["solver"])
        for shape in data.get("shape", ()):
            getattr(scene, f"add_{shape.pop('type')}")(**shape)
        for table in data.get("robot", ()):
            joints = {name: table.pop(name) for name in PER_DOF if name in table}
            packages = [file.parent / folder for folder in table.pop("package_dirs", ())]
            robot = scene.add_urdf(file.parent / table.pop("urdf"), package_dirs=packages, **table)
            for name, values in joints.items():
                setattr(robot, name, values if name == "joint_target_mode" else np.array(values, dtype=float))
        return scene

    def to_toml(self) -> str:
        """The scene as the text of a scene file, paths absolute; this is what a daemon gets."""
        return _core.scene_to_toml(self._json())

    def __repr__(self) -> str:
        return f"Scene(dt={self.dt:.6g}, substeps={self.substeps}, robots={[*self.robots]}, shapes={[*self.shapes]})"

    def _json(self) -> str:
        return json.dumps(
            {
                "dt": self.dt,
                "substeps": self.substeps,
                "gravity": self.gravity,
                "solver": asdict(self._solver),
                "shape": [asdict(shape) for shape in self.shapes.values()],
                "robot": [robot.table() for robot in self.robots.values()],
            }
        )

    def _add_shape(self, kind: ShapeType, name: str | None, pos: Vector, quat: Vector, **sizes: Any) -> StaticShape:
        name = checks.name(kind, self._free_name(kind) if name is None else name, self._names())
        what = f"{kind} `{name}`"
        checked: dict[str, Any] = {}
        for size, value in sizes.items():
            if size == "half_extents":
                checked[size] = checks.triple(f"{what}: {size}", value)
                checks.number(f"{what}: smallest of {size}", min(checked[size]), above=0.0)
            else:
                checked[size] = checks.number(f"{what}: {size}", value, above=0.0)
        position, orientation = checks.triple(f"{what}: pos", pos), checks.quaternion(f"{what}: quat", quat)
        shape = StaticShape(name, kind, position, orientation, **checked)
        self.shapes[name] = shape
        return shape

    def _names(self) -> list[str]:
        return [*self.robots, *self.shapes]

    def _free_name(self, kind: str) -> str:
        names = self._names()
        count = 1
        while (name := kind if count == 1 else f"{kind}_{count}") in names:
            count += 1
        return name
