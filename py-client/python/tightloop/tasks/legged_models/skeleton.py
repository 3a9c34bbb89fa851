"""The geometry of a floating robot as numbers: which joint moves which body, and where shapes are at any pose."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

import tightloop as tl
from tightloop import _core

Array = NDArray[np.float64]
#: Directions in which a shape's outermost points are kept.
_DIRECTIONS = 64


@dataclass(frozen=True)
class Hinge:
    """A hinge joint of a robot.

    Attributes:
        name: Its name.
        low: Lower limit [rad]; -inf for none.
        high: Upper limit [rad].
        effort: Largest torque of its drive [N·m]; inf if unknown.
        armature: Inertia of its rotor [kg·m²].
        damping: Damping of the joint itself [N·m·s/rad].
        gains: Stiffness and damping of the drive that the file gives it [N·m/rad, N·m·s/rad]; None for none.
    """

    name: str
    low: float
    high: float
    effort: float
    armature: float = 0.0
    damping: float = 0.0
    gains: tuple[float, float] | None = None


@dataclass(frozen=True)
class Source:
    """A robot in a scene of its own, and what only its file tells.

    Attributes:
        what: The file, for messages.
        scene: The scene.
        name: The robot in it.
        hinges: Its hinge joints.
        masses: Mass [kg] and centre of mass in the body's frame [m] of each body, by name.
        start: Positions of the joints in the file [rad or m], by name; 0 for others.
        poses: Poses that the file keeps: positions of joints [rad], by name.
    """

    what: str
    scene: tl.Scene
    name: str
    hinges: Sequence[Hinge]
    masses: Mapping[str, tuple[float, Array]]
    start: Mapping[str, float] = field(default_factory=dict)
    poses: Sequence[Mapping[str, float]] = ()


@dataclass(frozen=True)
class Solid:
    """A collision shape: all that is within ``radius`` of the hull of some points.

    Attributes:
        body: The body that carries it.
        points: Points in the body's frame [m], shape ``(n, 3)``.
        radius: Their distance from the surface [m].
    """

    body: int
    points: Array
    radius: float


class Skeleton:
    """A robot whose base is at the origin, upright.

    Attributes:
        source: Where it is from.
        joints: Its hinge joints, in the order of the robot's.
        bodies: Names of its bodies.
        base: Index of the body that moves freely.
        moves: Which joint moves which body, shape ``(joints, bodies)``.
        low: Lower limits, within a turn [rad], shape ``(joints,)``.
        high: Upper limits [rad].
        neutral: The positions nearest to those of the file within the limits [rad], shape ``(joints,)``.
        zero: The positions of the file [rad].
        solids: Its collision shapes.
        mass: Its mass [kg].
    """

    def __init__(self, source: Source) -> None:
        self.source = source
        self._dynamics = tl.Dynamics(source.scene)
        prefix = f"{source.name}/"
        dofs, coords = self._dynamics.dof_names, self._dynamics.coord_names
        self.bodies = [name.removeprefix(prefix) for name in self._dynamics.body_names]
        known = {hinge.name: hinge for hinge in source.hinges}
        self.joints = [known[name.removeprefix(prefix)] for name in dofs if name.removeprefix(prefix) in known]
        self._coords = [coords.index(prefix + joint.name) for joint in self.joints]
        self._dofs = [dofs.index(prefix + joint.name) for joint in self.joints]
        # quaternions of the base and of ball joints
        self._start = np.array([float(name.endswith(".qw")) for name in coords])
        for place, name in enumerate(coords):
            self._start[place] = source.start.get(name.removeprefix(prefix), self._start[place])
        jacobian = self._dynamics.body_jacobian(self._start)
        self.moves = (np.abs(jacobian[:, 3:, self._dofs]) > 1e-9).any(axis=1).T
        self.base = int(np.argmax(np.abs(jacobian[:, :3, 0]).any(axis=1)))
        low, high = (np.array([getattr(joint, end) for joint in self.joints], float) for end in ("low", "high"))
        turns = high - low > 2 * np.pi
        self.low, self.high = np.where(turns, -np.pi, low), np.where(turns, np.pi, high)
        self.zero = self._start[self._coords]
        self.neutral = np.clip(self.zero, self.low, self.high)
        self.solids = self._read_solids()
        self._masses = np.array([source.masses.get(name, (0.0, None))[0] for name in self.bodies])
        self._centers = np.array(
            [source.masses[name][1] if name in source.masses else np.zeros(3) for name in self.bodies]
        )
        self.mass = float(self._masses.sum())

    def index(self, joint: str) -> int:
        """Return the index of a joint."""
        return [own.name for own in self.joints].index(joint)

    @property
    def columns(self) -> list[int]:
        """Column of each joint in ``joint_q``."""
        return self._coords

    def state(self, q: Array) -> Array:
        """Return ``joint_q`` with the base at the origin, shape ``(coords,)``.

        Args:
            q: Positions of the hinge joints [rad], shape ``(joints,)``.
        """
        state = self._start.copy()
        state[self._coords] = q
        return state

    def frames(self, q: Array) -> tuple[Array, Array]:
        """Return places and orientations of all bodies, ``(n, bodies, 3)`` and ``(n, bodies, 3, 3)``.

        Args:
            q: Positions of the hinge joints [rad], shape ``(n, joints)``.
        """
        states = np.tile(self._start, (len(q), 1))
        states[:, self._coords] = q
        poses = self._dynamics.forward_kinematics(states)
        return poses[..., :3], _matrices(poses[..., 3:])

    def axes(self, q: Array) -> Array:
        """Return the axes of the joints in the base's frame at one pose, shape ``(joints, 3)``."""
        jacobian = self._dynamics.body_jacobian(self.state(q))
        return np.array([jacobian[self.body_of(joint), 3:, dof] for joint, dof in enumerate(self._dofs)])

    def inertias(self, q: Array) -> Array:
        """Return the inertia that each joint moves, without armatures [kg·m²], shape ``(joints,)``."""
        whole = np.diag(self._dynamics.mass_matrix(self.state(q)))[self._dofs]
        return whole - [joint.armature for joint in self.joints]

    def gravity(self, q: Array) -> Array:
        """Return the torques that hold the joints against gravity, without contacts [N·m], shape ``(joints,)``."""
        return self._dynamics.inverse_dynamics(self.state(q))[self._dofs]

    def body_of(self, joint: int) -> int:
        """Return the first body that a joint moves."""
        return int(np.argmax(self.moves[joint]))

    def center(self, q: Array) -> Array:
        """Return the centre of mass [m], shape ``(3,)``."""
        places, turns = self.frames(q[None])
        centers = places[0] + np.einsum("bij,bj->bi", turns[0], self._centers)
        return self._masses @ centers / self.mass

    def points(self, solid: Solid, frames: tuple[Array, Array]) -> Array:
        """Return a shape's points in the base's frame, shape ``(n, points, 3)``."""
        places, turns = frames
        return places[:, None, solid.body] + np.einsum("nij,pj->npi", turns[:, solid.body], solid.points)

    def lowest(self, bodies: NDArray[np.bool_], frames: tuple[Array, Array]) -> Array:
        """Return the height of the lowest point of some bodies' shapes [m], shape ``(n,)``; inf without shapes."""
        own = [solid for solid in self.solids if bodies[solid.body]]
        heights = [self.points(solid, frames)[..., 2].min(axis=1) - solid.radius for solid in own]
        return np.min(heights, axis=0) if heights else np.full(len(frames[0]), np.inf)

    def _read_solids(self) -> list[Solid]:
        text, surfaces = _core.parts(self.source.scene.to_toml(), "/")
        prefix, found = f"{self.source.name}/", []
        for part in json.loads(text)["parts"]:
            if part["kind"] != "collision" or part["body"] is None or part["shape"] == "plane":
                continue
            vertices = np.asarray(surfaces[part["mesh"]][0], np.float64)
            points, radius = _core_of(part["shape"], vertices)
            turn = _matrices(np.array(part["quat"]))
            body = self.bodies.index(part["body"].removeprefix(prefix))
            found.append(Solid(body, points @ turn.T + np.array(part["pos"]), radius))
        return found


def _core_of(shape: str, vertices: Array) -> tuple[Array, float]:
    """The points of a shape, and their distance from its surface."""
    if shape == "sphere":
        return np.zeros((1, 3)), float(np.linalg.norm(vertices, axis=1).max())
    if shape == "capsule":  # along z
        radius = float(np.abs(vertices[:, 0]).max())
        end = float(vertices[:, 2].max()) - radius
        return np.array([[0.0, 0.0, end], [0.0, 0.0, -end]]), radius
    if len(vertices) > _DIRECTIONS and shape != "cylinder":
        directions = np.random.default_rng(0).normal(size=(_DIRECTIONS, 3))
        directions = np.concatenate([np.eye(3), -np.eye(3), directions])
        vertices = vertices[np.unique(np.argmax(vertices @ directions.T, axis=0))]
    return vertices, 0.0


def _matrices(quats: Array) -> Array:
    """Rotation matrices of quaternions (x, y, z, w), shape ``(…, 3, 3)``."""
    x, y, z, w = np.moveaxis(quats, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, -1) for row in rows], -2)
