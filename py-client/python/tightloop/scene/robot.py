"""A robot of a scene: the values of its URDF, and the start state, drives and limits that the user sets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.checks import arguments as checks
from tightloop.checks.arguments import Vector
from tightloop.checks.attributes import suggestion
from tightloop.checks.signatures import checked_calls
from tightloop.errors import SceneError
from tightloop.notebook import picture_html, table
from tightloop.scene.actuated_joints import chosen, gains
from tightloop.scene.entity import Entity
from tightloop.scene.joint_order import JointOrder
from tightloop.scene.robot_properties import Modes, Numbers, PerDof, Positions, position, velocity


@checked_calls
class Robot(Entity):
    """A robot of a scene, made by `Scene.add_urdf`.

    Properties have one entry per dof, in the order of ``dof_names``; ``joint_q`` has one per coordinate, in the order
    of ``coord_names``. Properties that are not set keep the values of the URDF file. They are set

    - by an array; of a floating robot, the entries of the floating base may be left out,
    - by a single value, which is written to all entries except those of free joints, which have no drive,
    - by a dict of values by name or pattern, ``{"knee": 0.4, ".*_hip": 0.1}``: a regular expression for whole names,
      after which exact names count. Other entries keep their values,
    - or by entries: ``arm.joint_q[:7] = 0.1``.

    A mimic joint starts where its leader puts it, and so do its targets. Only an array, an entry, or the mimic joint's
    own name gives it another value; a single value or a pattern that gives both does not.

    Where they are left out, ``pos`` and ``quat`` are the start of a floating base.
    """

    __slots__ = ("_file", "_follows_pose", "_own", "_self_collisions", "_summary")

    kind = "robot"

    joint_q = Positions("Start positions [rad or m], shape ``(coords,)``.", follows=position)
    joint_target_q = Numbers(
        "Position targets of the drives at the start [rad or m], shape ``(dofs,)``; the start positions if not set.",
        otherwise="joint_q",
        follows=position,
    )
    joint_target_qd = Numbers(
        "Velocity targets of the drives at the start [rad/s or m/s], shape ``(dofs,)``.", follows=velocity
    )
    joint_target_mode: Modes = Modes(
        "Drive law of each dof: ``position``: ke (q* − q) − kd q̇; ``velocity``: kd (q̇* − q̇); ``both``: their sum."
    )
    joint_target_ke: Numbers = Numbers(
        "Proportional gains of the drives [N·m/rad or N/m], shape ``(dofs,)``.", signed=False
    )
    joint_target_kd: Numbers = Numbers(
        "Derivative gains of the drives [N·m·s/rad or N·s/m], shape ``(dofs,)``.", signed=False
    )
    joint_effort_limit: Numbers = Numbers(
        "Limit of a joint's drive force [N·m or N], shape ``(dofs,)``; inf is no limit. It does not limit ``joint_f``.",
        signed=False,
        limit=True,
    )
    joint_limit_ke = Numbers(
        "Stiffness of the joint limits [N·m/rad or N/m], shape ``(dofs,)``; 10000 if not set, as in Newton.",
        signed=False,
    )
    joint_limit_kd = Numbers(
        "Damping of the joint limits [N·m·s/rad or N·s/m], shape ``(dofs,)``; 10 if not set, as in Newton. More of it "
        "makes joints bounce less.",
        signed=False,
    )
    joint_armature = Numbers("Inertia of the drives seen at the joint [kg·m² or kg], shape ``(dofs,)``.", signed=False)

    def __init__(
        self,
        name: str,
        *,
        urdf: Path,
        package_dirs: list[Path],
        pos: Vector,
        quat: Vector,
        floating: bool,
        self_collisions: bool,
        strict: bool,
        mesh_max_hull_vertices: int,
        convex_decomposition: bool,
        collada_up_axis: bool,
        surface: dict[str, Any],
        summary: dict[str, Any],
    ) -> None:
        super().__init__(name, pos, quat)
        # as the file was read, which cannot change afterwards
        self._file: dict[str, Any] = {
            "urdf": urdf,
            "package_dirs": package_dirs,
            "floating": floating,
            "strict": strict,
            "mesh_max_hull_vertices": mesh_max_hull_vertices,
            "convex_decomposition": convex_decomposition,
            "collada_up_axis": collada_up_axis,
            "surface": surface,
        }
        self.self_collisions = self_collisions
        self._summary = summary
        self._own: dict[str, Any] = {}
        # whether `joint_q` was set and its base is that of `pos` and `quat`
        self._follows_pose = False

    @property
    def urdf(self) -> Path:
        """The URDF file."""
        return self._file["urdf"]

    @property
    def package_dirs(self) -> list[Path]:
        """Folders with the packages of ``package://`` paths; none if they are searched above the file."""
        return list(self._file["package_dirs"])

    @property
    def floating(self) -> bool:
        """Whether the root link moves freely."""
        return self._file["floating"]

    @property
    def strict(self) -> bool:
        """Whether an inertia that no body can have was refused."""
        return self._file["strict"]

    @property
    def mesh_max_hull_vertices(self) -> int:
        """Largest number of vertices of the convex hull of a collision mesh."""
        return self._file["mesh_max_hull_vertices"]

    @property
    def convex_decomposition(self) -> bool:
        """Whether concave collision meshes become several convex hulls."""
        return self._file["convex_decomposition"]

    @property
    def collada_up_axis(self) -> bool:
        """Whether COLLADA meshes are turned from their ``<up_axis>`` to z up."""
        return self._file["collada_up_axis"]

    @property
    def surface(self) -> dict[str, Any]:
        """Contact parameters of all shapes of the file; see `tightloop.Surface`."""
        return dict(self._file["surface"])

    @property
    def self_collisions(self) -> bool:
        """Whether links of this robot collide with each other; neighbours never do."""
        return self._self_collisions

    @self_collisions.setter
    def self_collisions(self, self_collisions: bool) -> None:
        self._self_collisions = checks.flag(f"robot `{self.name}`: self_collisions", self_collisions)

    @property
    def joint_names(self) -> list[str]:
        """Names of the moving joints in the URDF, in dof order (``sim.dof_names`` has ``robot/joint``)."""
        return list(self._summary["joint_names"])

    @property
    def joint_types(self) -> dict[str, str]:
        """URDF type of each moving joint: ``revolute``, ``continuous``, ``prismatic``, …"""
        return dict(zip(self._summary["joint_names"], self._summary["joint_types"], strict=True))

    @property
    def joint_leaders(self) -> dict[str, str]:
        """Leader of each mimic joint, by the name of the mimic joint."""
        joints = zip(self._summary["joint_names"], self._summary["joint_mimic"], strict=True)
        return {joint: mimic["joint"] for joint, mimic in joints if mimic is not None}

    @property
    def _followers(self) -> list[tuple[str, str, float, float]]:
        """Mimic joints: name, leader, multiplier and offset of ``q = multiplier * q_leader + offset``."""
        joints = zip(self._summary["joint_names"], self._summary["joint_mimic"], strict=True)
        return [
            (joint, mimic["joint"], mimic["multiplier"], mimic["offset"])
            for joint, mimic in joints
            if mimic is not None
        ]

    @property
    def joint_range(self) -> NDArray[np.float64]:
        """Lower and upper position limit of each dof [rad or m], shape ``(dofs, 2)``; infinite without a limit."""
        unlimited = [-np.inf, np.inf]
        known = [unlimited if range_ is None else range_ for range_ in self._summary["joint_range"]]
        return self._of_dofs(known).reshape(-1, 2)

    @property
    def joint_velocity_limit(self) -> NDArray[np.float64]:
        """Velocity limit of each dof's joint [rad/s or m/s], shape ``(dofs,)``; infinite without one, not enforced."""
        return self._of_dofs(self._summary["joint_velocity_limit"])

    @property
    def dof_names(self) -> list[str]:
        """Names of the dofs: the joint, or ``joint.part`` for a joint with several dofs."""
        return list(self._summary["dof_names"])

    @property
    def dof_driven(self) -> list[bool]:
        """Whether each dof has a drive; those of free joints have none."""
        return list(self._summary["dof_driven"])

    @property
    def coord_names(self) -> list[str]:
        """Names of the position coordinates: the joint, or ``joint.part`` for a joint with several coordinates."""
        return list(self._summary["coord_names"])

    @property
    def link_names(self) -> list[str]:
        """Names of the links in the URDF, in the order of their bodies."""
        return list(self._summary["link_names"])

    @property
    def shape_names(self) -> list[str]:
        """Names of the collision shapes of its file, ``link/shape``, in the order of the bodies.

        A shape without a name has its index in the link (``sim.shape_names`` has ``robot/link/shape``).
        """
        return list(self._summary["shape_names"])

    def link(self, name: str) -> Link:
        """Return a link, for example to attach a shape: ``scene.add_box(body=arm.link("hand"), …)``.

        Args:
            name: Name of the link in the URDF.

        Raises:
            SceneError: There is no such link.
        """
        if name not in self._summary["link_names"]:
            raise SceneError(
                f"robot `{self.name}` has no link of the name {name!r}; {suggestion(str(name), self.link_names)}"
            )
        return Link(self, name)

    def order(self, names: Sequence[str]) -> JointOrder:
        """Declare an order of the dofs, such as that of a policy trained in another simulator, to convert arrays.

        Args:
            names: Names of all dofs, without those of a floating base, in that order.

        Raises:
            SceneError: A name is unknown, missing or there twice, or a joint has several coordinates.
        """
        base = 6 if self.floating else 0
        dofs, coords = self.dof_names[base:], self.coord_names[base + 1 if base else 0 :]
        if dofs != coords:
            ball = next(name for name in coords if name not in dofs)
            raise SceneError(f"robot `{self.name}`: order: `{ball}` has no dof of its own; order its columns by hand")
        return JointOrder(self.name, names, dofs, base)

    def add_position_actuators(
        self,
        joints: str | Sequence[str] = ".*",
        *,
        stiffness: float,
        damping: float,
        effort_limit: float | None = None,
    ) -> list[str]:
        """Give joints drives that follow ``joint_target_q``: ``stiffness * (target - q) - damping * qd``.

        It sets ``joint_target_ke``, ``joint_target_kd``, ``joint_target_mode`` and ``joint_effort_limit`` of them. A
        mimic joint, which its leader moves, gets a drive by its own name alone.

        Args:
            joints: Names of dofs, or regular expressions for whole names.
            stiffness: Gain of each [N·m/rad or N/m].
            damping: Damping of each [N·m·s/rad or N·s/m].
            effort_limit: Largest force of each [N·m or N]; that of the file if left out.

        Returns:
            The names of these dofs.

        Raises:
            SceneError: No joint matches, or a value is wrong.
        """
        subject = self._subject()
        stiffness, damping, limit = gains(subject, stiffness, damping, effort_limit)
        driven = [name for name, is_driven in zip(self.dof_names, self.dof_driven, strict=True) if is_driven]
        names = chosen(subject, joints, driven, self.joint_leaders)
        self.joint_target_ke = dict.fromkeys(names, stiffness)
        self.joint_target_kd = dict.fromkeys(names, damping)
        self.joint_target_mode = dict.fromkeys(names, "position")
        if limit is not None:
            self.joint_effort_limit = dict.fromkeys(names, limit)
        return names

    @property
    def notes(self) -> list[str]:
        """What the URDF reader ignored or repaired, one sentence each."""
        return list(self._summary["notes"])

    @property
    def dofs(self) -> int:
        """Number of degrees of freedom."""
        return len(self._summary["dof_names"])

    def table(self) -> dict[str, Any]:
        """Return the robot in the form of a scene file, with absolute paths and without properties that are not set."""
        # a single value skips free joints and mimic joints, but values set on these must reach the daemon
        single, spread = all(self._summary["dof_driven"]), not self._followers
        own = {
            name: values
            if isinstance(values, tuple)
            else _portable(np.array(getattr(self, name)), single=single and (spread or name not in FOLLOWED))
            for name, values in self._own.items()
        }
        packages = [str(folder) for folder in self.package_dirs]
        return {
            "name": self.name,
            "urdf": str(self.urdf),
            "package_dirs": packages,
            "pos": self.pos,
            "quat": self.quat,
            "floating": self.floating,
            "self_collisions": self.self_collisions,
            "strict": self.strict,
            "mesh_max_hull_vertices": self.mesh_max_hull_vertices,
            "convex_decomposition": self.convex_decomposition,
            "collada_up_axis": self.collada_up_axis,
            **self.surface,
        } | own

    def _instead(self, name: str) -> str:
        return "it is an argument of add_urdf"

    def _of_dofs(self, joints: list[Any]) -> NDArray[np.float64]:
        """Expand a list of values per moving joint to one per dof."""
        own = dict(zip(self.joint_names, joints, strict=True))
        return np.array([own[dof if dof in own else dof.rpartition(".")[0]] for dof in self.dof_names], dtype=float)

    def file_values(self, name: str) -> Any:
        """Return the values of the file for a property."""
        if name == "joint_target_mode":
            return ["position"] * self.dofs
        if name == "joint_q" and self.floating:
            return [*self.pos, *self.quat, *self._summary["joint_q"][7:]]
        return self._summary.get(name, [0.0] * self.dofs)

    def start_targets(self) -> list[float]:
        """Return the targets that hold the start position; the daemon sets those of ball and free joints."""
        start = dict(zip(self.coord_names, self.joint_q, strict=True))
        return [float(start.get(name, 0.0)) for name in self.dof_names]

    def _repr_html_(self) -> str:
        names, effort = self.dof_names, self.joint_effort_limit
        rows = [
            (name, f"{low:.4g} … {high:.4g}", f"{limit:.4g}", f"{ke:.4g}", f"{kd:.4g}", mode)
            for name, (low, high), limit, ke, kd, mode in zip(
                names,
                self.joint_range,
                effort,
                self.joint_target_ke,
                self.joint_target_kd,
                self.joint_target_mode,
                strict=True,
            )
        ]
        head = ("dof", "range [rad or m]", "effort limit", "target_ke", "target_kd", "target_mode")
        title = f"{self.name}: {self.dofs} dofs, {len(self.link_names)} links"
        return table(title, head, rows, picture_html("of_robot", self))

    def __repr__(self) -> str:
        return f"Robot({self.name!r}, dofs={self.dofs}, urdf={str(self.urdf)!r})"


@dataclass(frozen=True)
class Link:
    """A link of a robot, made by `Robot.link`."""

    robot: Robot
    link: str

    @property
    def name(self) -> str:
        """Name in the scene, ``robot/link``."""
        return f"{self.robot.name}/{self.link}"

    def __str__(self) -> str:
        return self.name


#: Properties of which a mimic joint has what its leader gives it.
FOLLOWED = tuple(name for name, value in vars(Robot).items() if isinstance(value, Numbers) and value.follows)
PER_DOF = tuple(name for name, value in vars(Robot).items() if isinstance(value, PerDof))


def _portable(values: NDArray[np.float64], *, single: bool) -> float | str | list[float | str]:
    """Convert values for JSON, which has no infinity; with ``single``, equal values become one."""
    entries = ["inf" if np.isinf(value) else float(value) for value in values]
    return entries[0] if single and entries and len(set(entries)) == 1 else entries
