"""Legged robots as the velocity tasks use them: joints, the pose in which they stand, feet and drives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from tightloop.env.mirror import Flip
from tightloop.robot import Robot
from tightloop.scene import Scene

Place = tuple[float, float, float]


@dataclass(frozen=True)
class LeggedRobot:
    """A legged robot.

    Attributes:
        file: Its URDF.
        name: Its name in the scene.
        base: Link whose velocity follows the command.
        joints: Joints of the action, in the order of the robot's.
        standing: Their positions when it stands [rad].
        height: Height of the base when it stands [m].
        feet: Link of each foot, and the place of its site in the link's frame [m], by name.
        radius: Height of these sites on level ground [m].
        groups: Which feet swing together, 0 or 1 of each.
        stiffness: Gains of the drives, by name or pattern or of all [N·m/rad].
        damping: Likewise [N·m·s/rad].
        armature: Likewise, inertia of the rotors [kg·m²].
        scale: Effect of an action of 1 on each joint's target [rad].
        flip: Joints in the mirror image: where each one's value comes from, and its sign; None if unknown.
    """

    file: Path
    name: str
    base: str
    joints: tuple[str, ...]
    standing: tuple[float, ...]
    height: float
    feet: Mapping[str, tuple[str, Place]]
    radius: float
    groups: Sequence[int]
    stiffness: float | Mapping[str, float]
    damping: float | Mapping[str, float]
    armature: float | Mapping[str, float] = 0.01
    scale: float | Sequence[float] = 0.3
    flip: Flip | None = field(default=None)

    @property
    def dofs(self) -> tuple[str, ...]:
        """Names of the joints in the scene."""
        return tuple(f"{self.name}/{joint}" for joint in self.joints)

    @property
    def body(self) -> str:
        """Name of the base in the scene."""
        return f"{self.name}/{self.base}"

    def add_to(self, scene: Scene) -> Robot:
        """Add it to a scene, standing on level ground, with a site at each foot."""
        robot = scene.add_urdf(self.file, name=self.name, floating=True, pos=(0.0, 0.0, self.height))
        pose = dict(zip(self.joints, self.standing, strict=True))
        robot.joint_q = pose
        robot.joint_target_q = pose
        robot.joint_target_ke, robot.joint_target_kd = self.stiffness, self.damping
        robot.joint_armature = self.armature
        for name, (link, place) in self.feet.items():
            scene.add_site(body=f"{self.name}/{link}", pos=place, name=name)
        return robot
