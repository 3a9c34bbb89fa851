"""A robot of a scene: the values of its URDF, and the start state, drives and limits that the user sets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tightloop.checks import Vector
from tightloop.entity import Entity
from tightloop.errors import SceneError

MODES = ("position", "velocity", "both")


class _PerDof:
    """A property with one entry per dof; a single value is written to every dof with a drive."""

    entry = "dof"

    def __init__(self, doc: str) -> None:
        self.__doc__ = doc

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def error(self, robot: Robot, problem: str) -> SceneError:
        return SceneError(f"robot `{robot.name}`: {self.name} {problem}")

    def names(self, robot: Robot) -> list[str]:
        return robot.dof_names

    def expected(self, robot: Robot) -> str:
        names = self.names(robot)
        return f"expected {len(names)}, one a {self.entry} ({_some(names)}), or a single one for all"


class _Numbers(_PerDof):
    def __init__(self, doc: str, *, otherwise: str | None = None, signed: bool = True, limit: bool = False) -> None:
        super().__init__(doc)
        self.otherwise, self.signed, self.limit = otherwise, signed, limit

    @overload
    def __get__(self, robot: None, owner: type) -> _Numbers: ...
    @overload
    def __get__(self, robot: Robot, owner: type) -> NDArray[np.float64]: ...
    def __get__(self, robot: Robot | None, owner: type) -> _Numbers | NDArray[np.float64]:
        if robot is None:
            return self
        own = robot._own.get(self.name)
        if own is None and self.otherwise is not None:
            own = robot._start_targets()
        values = np.array(robot._urdf_values(self.name) if own is None else own, dtype=np.float64)
        # `arm.joint_q[3] = 1` would change a copy, so it raises an error
        values.flags.writeable = False
        return values

    def __set__(self, robot: Robot, values: ArrayLike) -> None:
        try:
            given = np.asarray(values)
        except ValueError as problem:
            raise self.error(robot, f"is no array: {problem}") from None
        if given.dtype.kind not in "fiu":
            raise self.error(robot, f"has dtype {given.dtype}; give real numbers")
        names = self.names(robot)
        if given.ndim != 0 and given.shape != (len(names),):
            got = f"{given.shape[0]} values" if given.ndim == 1 else f"shape {given.shape}"
            raise self.error(robot, f"has {got}; {self.expected(robot)}")
        checked = np.full(len(names), given, dtype=np.float64)
        if given.ndim == 0:
            checked[~self.takes_single(robot)] = 0.0
        for name, value in zip(names, checked, strict=True):
            if not (np.isfinite(value) or (self.limit and value == np.inf)):
                cure = "a finite number, or inf for no limit" if self.limit else "a finite number"
                raise self.error(robot, f"of {self.entry} `{robot.name}/{name}` is {value}; give {cure}")
            if value < 0.0 and not self.signed:
                raise self.error(robot, f"of {self.entry} `{robot.name}/{name}` is {value}; it cannot be negative")
        robot._own[self.name] = checked

    def takes_single(self, robot: Robot) -> NDArray[np.bool_]:
        return np.array(robot._summary["dof_driven"], dtype=bool)


class _Positions(_Numbers):
    """One entry per position coordinate; a joint that turns freely has a quaternion."""

    entry = "coordinate"

    def names(self, robot: Robot) -> list[str]:
        return robot.coord_names

    def takes_single(self, robot: Robot) -> NDArray[np.bool_]:
        return np.ones(len(robot.coord_names), dtype=bool)


class _Modes(_PerDof):
    @overload
    def __get__(self, robot: None, owner: type) -> _Modes: ...
    @overload
    def __get__(self, robot: Robot, owner: type) -> tuple[str, ...]: ...
    def __get__(self, robot: Robot | None, owner: type) -> _Modes | tuple[str, ...]:
        return self if robot is None else robot._own.get(self.name) or tuple(robot._urdf_values(self.name))

    def __set__(self, robot: Robot, values: str | Sequence[str]) -> None:
        try:
            modes = (values,) * robot.dofs if isinstance(values, str) else tuple(values)
        except TypeError:
            raise self.error(robot, f"is {values!r}; {self.expected(robot)}") from None
        if len(modes) != robot.dofs:
            raise self.error(robot, f"has {len(modes)} values; {self.expected(robot)}")
        for name, mode in zip(robot.dof_names, modes, strict=True):
            if mode not in MODES:
                choices = ", ".join(map(repr, MODES))
                raise self.error(robot, f"of dof `{robot.name}/{name}` is {mode!r}; choose one of {choices}")
        robot._own[self.name] = modes


class Robot(Entity):
    """A robot of a scene, made by `Scene.add_urdf`.

    Properties have one entry per dof, in the order of ``dof_names``; ``joint_q`` has one per coordinate, in the order
    of ``coord_names``. A single value is written to all entries except those of free joints, which have no drive.
    Properties that are not set keep the values of the URDF file.
    """

    # a misspelt property is an error
    __slots__ = (
        "_own",
        "_summary",
        "convex_decomposition",
        "floating",
        "mesh_max_hull_vertices",
        "package_dirs",
        "self_collisions",
        "strict",
        "surface",
        "urdf",
    )

    kind = "robot"

    joint_q = _Positions("Start positions [rad or m], shape ``(coords,)``.")
    joint_target_q = _Numbers(
        "Position targets of the drives at the start [rad or m], shape ``(dofs,)``; the start positions if not set.",
        otherwise="joint_q",
    )
    joint_target_qd = _Numbers("Velocity targets of the drives at the start [rad/s or m/s], shape ``(dofs,)``.")
    joint_target_mode = _Modes(
        "Drive law of each dof: ``position``: ke (q* − q) − kd q̇; ``velocity``: kd (q̇* − q̇); ``both``: their sum."
    )
    joint_target_ke = _Numbers("Proportional gains of the drives [N·m/rad or N/m], shape ``(dofs,)``.", signed=False)
    joint_target_kd = _Numbers("Derivative gains of the drives [N·m·s/rad or N·s/m], shape ``(dofs,)``.", signed=False)
    joint_effort_limit = _Numbers(
        "Limit of a joint's drive force [N·m or N], shape ``(dofs,)``; inf is no limit. It does not limit ``joint_f``.",
        signed=False,
        limit=True,
    )
    joint_armature = _Numbers("Inertia of the drives seen at the joint [kg·m² or kg], shape ``(dofs,)``.", signed=False)

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
        surface: dict[str, Any],
        summary: dict[str, Any],
    ) -> None:
        super().__init__(name, pos, quat)
        self.urdf = urdf
        self.package_dirs = package_dirs
        self.floating = floating
        self.self_collisions = self_collisions
        self.strict = strict
        self.mesh_max_hull_vertices = mesh_max_hull_vertices
        self.convex_decomposition = convex_decomposition
        self.surface = surface
        self._summary = summary
        self._own: dict[str, Any] = {}

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
    def joint_range(self) -> NDArray[np.float64]:
        """Lower and upper position limit of each dof [rad or m], shape ``(dofs, 2)``; infinite without a limit."""
        unlimited = [-np.inf, np.inf]
        return self._of_dofs([unlimited if range_ is None else range_ for range_ in self._summary["joint_range"]])

    @property
    def joint_velocity_limit(self) -> NDArray[np.float64]:
        """Velocity limit of each dof's joint [rad/s or m/s], shape ``(dofs,)``; infinite without one, not enforced."""
        return self._of_dofs(self._summary["joint_velocity_limit"])

    @property
    def dof_names(self) -> list[str]:
        """Names of the dofs: the joint, or ``joint.part`` for a joint with several dofs."""
        return list(self._summary["dof_names"])

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
            raise SceneError(f"robot `{self.name}` has no link {name!r}; there are: {_some(self.link_names, 20)}")
        return Link(self, name)

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
        # a single value skips free joints, but values set on their drives must reach the daemon, which refuses them
        single = all(self._summary["dof_driven"])
        own = {
            name: values if isinstance(values, tuple) else _portable(values, single=single)
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
            **self.surface,
        } | own

    def _of_dofs(self, joints: list[Any]) -> NDArray[np.float64]:
        """Expand a list of values per moving joint to one per dof."""
        own = dict(zip(self.joint_names, joints, strict=True))
        return np.array([own[dof if dof in own else dof.rpartition(".")[0]] for dof in self.dof_names], dtype=float)

    def _urdf_values(self, name: str) -> Any:
        if name == "joint_target_mode":
            return ["position"] * self.dofs
        if name == "joint_q" and self.floating:
            return [*self.pos, *self.quat, *self._summary["joint_q"][7:]]
        return self._summary.get(name, [0.0] * self.dofs)

    def _start_targets(self) -> list[float]:
        """Return targets that hold the start position; the daemon sets those of ball and free joints."""
        start = dict(zip(self.coord_names, self.joint_q, strict=True))
        return [float(start.get(name, 0.0)) for name in self.dof_names]

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


PER_DOF = tuple(name for name, value in vars(Robot).items() if isinstance(value, _PerDof))


def _portable(values: NDArray[np.float64], *, single: bool) -> float | str | list[float | str]:
    """Convert values for JSON, which has no infinity; with ``single``, equal values become one."""
    entries = ["inf" if np.isinf(value) else float(value) for value in values]
    return entries[0] if single and entries and len(set(entries)) == 1 else entries


def _some(names: list[str], most: int = 3) -> str:
    return ", ".join(names[:most]) + (", …" if len(names) > most else "")
