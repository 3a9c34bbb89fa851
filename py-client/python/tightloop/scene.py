"""What is simulated: robots, static shapes, time step and solver. A scene is data; nothing runs until `tightloop.launch`."""

from __future__ import annotations

import json
import math
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from tightloop import _core
from tightloop.errors import SceneError
from tightloop.robot import Robot, Vector

Cone = Literal["elliptic", "pyramidal"]

_CONES = ("elliptic", "pyramidal")
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.\-]*")
# A quaternion typed with four digits is off by less; anything further is a slip (degrees, w first, Euler angles).
_QUAT_NORM_SLACK = 1e-3


@dataclass(frozen=True)
class Box:
    """A static box: ``half_extents`` [m], ``pos`` [m] and ``quat`` (x, y, z, w) of its centre in the world."""

    name: str
    half_extents: tuple[float, float, float]
    pos: tuple[float, float, float]
    quat: tuple[float, float, float, float]


@dataclass
class _Solver:
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

    def __init__(self, *, dt: float = 1 / 480, substeps: int = 8, gravity: Vector = (0.0, 0.0, -9.81)) -> None:
        self.dt = _number("Scene: dt", dt, above=0.0, unit="seconds")
        self.substeps = _integer("Scene: substeps", substeps, least=1)
        self.gravity = _vector("Scene: gravity", gravity, 3)
        self.robots: dict[str, Robot] = {}
        self.boxes: dict[str, Box] = {}
        self._solver = _Solver()

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
            tolerance: Stops early once the scaled improvement or gradient falls below it [–]; 0 never stops early.
            cone: Friction cone of contacts, ``"elliptic"`` or ``"pyramidal"``.
            impratio: Ratio of frictional to normal impedance of elliptic contacts [–], above 0.
        """
        if cone not in _CONES:
            raise SceneError(f"solver: unknown cone {cone!r}; choose one of {', '.join(map(repr, _CONES))}")
        self._solver = _Solver(
            iterations=_integer("solver: iterations", iterations, least=1),
            ls_iterations=_integer("solver: ls_iterations", ls_iterations, least=1),
            tolerance=_number("solver: tolerance", tolerance, least=0.0),
            cone=cone,
            impratio=_number("solver: impratio", impratio, above=0.0),
        )

    def add_box(
        self,
        *,
        half_extents: Vector,
        pos: Vector = (0.0, 0.0, 0.0),
        quat: Vector = (0.0, 0.0, 0.0, 1.0),
        name: str | None = None,
    ) -> Box:
        """Add a static box.

        Args:
            half_extents: Half the length of each side [m], above 0.
            pos: Centre in the world [m].
            quat: Orientation (x, y, z, w).
            name: Unique name; ``box1``, ``box2``, … if left out.
        """
        name = self._name(name, "box")
        extents = _vector(f"box `{name}`: half_extents", half_extents, 3)
        if min(extents) <= 0.0:
            raise SceneError(f"box `{name}`: half_extents {extents} must all be above 0")
        box = Box(name, extents, *_pose(f"box `{name}`", pos, quat))
        self.boxes[name] = box
        return box

    def add_urdf(
        self,
        path: str | os.PathLike[str],
        *,
        name: str | None = None,
        pos: Vector = (0.0, 0.0, 0.0),
        quat: Vector = (0.0, 0.0, 0.0, 1.0),
        floating: bool = False,
        self_collisions: bool = False,
    ) -> Robot:
        """Add a robot from a URDF file, which is read and checked at once.

        Args:
            path: The URDF file.
            name: Unique name, the prefix of joint and link names; the robot's own name if left out.
            pos: Where the root link stands in the world [m].
            quat: Its orientation (x, y, z, w).
            floating: Let the root link move freely instead of fixing it.
            self_collisions: Let links of this robot touch each other (neighbours never do).

        Returns:
            The robot, to set start state, drives and limits.

        Raises:
            UrdfError: The file is missing, is not URDF, or describes a robot that cannot be simulated.
        """
        urdf = Path(path).expanduser().absolute()
        summary = json.loads(_core.read_urdf(str(urdf)))
        name = self._name(name or _plain(summary["name"]), "robot")
        pose = _pose(f"robot `{name}`", pos, quat)
        robot = Robot(name, urdf, *pose, bool(floating), bool(self_collisions), summary)
        self.robots[name] = robot
        return robot

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the scene as a TOML file; paths inside are relative to that file."""
        file = Path(path).expanduser().absolute()
        file.write_text(_core.scene_to_toml(self._json(), str(file.parent)), encoding="utf-8")

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Scene:
        """Read a scene file, and the robots that it names.

        Raises:
            SceneError: The file is missing, or a key or value in it is wrong.
            UrdfError: A robot in it cannot be read.
        """
        file = Path(path).expanduser().absolute()
        return cls._from_json(_core.scene_from_toml(str(file)))

    def __repr__(self) -> str:
        parts = [f"dt={self.dt:.6g}", f"substeps={self.substeps}"]
        parts += [f"robots={list(self.robots)}", f"boxes={list(self.boxes)}"]
        return f"Scene({', '.join(parts)})"
