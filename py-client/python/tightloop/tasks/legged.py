"""Legged robots as the velocity tasks use them: joints, the pose in which they stand, feet and drives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from tightloop.env.controls import ActuatorTarget, Control, JointTarget
from tightloop.env.mirror import Flip
from tightloop.env.names import Names
from tightloop.env.task import Array
from tightloop.scene.distributions import Uniform
from tightloop.scene.scene import Scene

Place = tuple[float, float, float]
#: One value for all joints, or values by name or pattern.
ByJoint = float | Mapping[str, float]
#: Offsets of joints at the start, at most [rad].
OFFSET = 0.1
#: MuJoCo's type of slide joints; that of hinges follows, and those before have several coordinates.
_SLIDE = 2


@dataclass(frozen=True)
class RobotOptions:
    """What replaces what is found in a model; None to keep that.

    Attributes:
        standing: Positions of joints when it stands [rad], by name or pattern, a regular expression for whole names.
        stiffness: Gains of the drives of the action's joints, for all or by name or pattern [N·m/rad].
        damping: Likewise [N·m·s/rad].
        scale: Effect of an action of 1 on their targets [rad], likewise.
    """

    standing: Mapping[str, float] | None = None
    stiffness: ByJoint | None = None
    damping: ByJoint | None = None
    scale: ByJoint | None = None

    @property
    def are_given(self) -> bool:
        """Whether there is any."""
        return any(value is not None for value in (self.standing, self.stiffness, self.damping, self.scale))


@dataclass(frozen=True, kw_only=True)
class LeggedRobot:
    """A legged robot from URDF.

    Attributes:
        file: Its URDF.
        name: Its name in the scene.
        base: Link whose velocity follows the command.
        joints: Joints of the action, in the order of the robot's.
        standing: Their positions when it stands [rad].
        targets: Targets of their drives that hold them there [rad]; empty for ``standing``.
        height: Height of the base when it stands [m].
        hip_height: Height of the first joints of the legs when it stands [m], the size of the robot.
        mass: Its mass [kg].
        feet: Link of each foot, and the place of its site in the link's frame [m], by name.
        radius: Height of these sites on level ground [m].
        groups: Which feet swing together, 0 or 1 of each.
        stiffness: Gains of the drives, by name or pattern or of all [N·m/rad].
        damping: Likewise [N·m·s/rad].
        armature: Likewise, inertia of the rotors [kg·m²].
        scale: Effect of an action of 1 on each joint's target [rad].
        held: Positions of other joints, which drives hold [rad or m], by name.
        unlimited: Joints whose effort limit in the file is none that a drive could work with.
        quiet: Joints that walking ahead does not need.
        flip: Joints in the mirror image: where each one's value comes from, and its sign; None if unknown.
    """

    #: Frame fields with the sites of the feet, and with the torques of the drives.
    site_field: ClassVar[str] = "site_q"
    torque_field: ClassVar[str] = "joint_torque"

    file: Path
    name: str
    base: str
    joints: tuple[str, ...]
    standing: tuple[float, ...]
    height: float
    hip_height: float
    mass: float
    feet: Mapping[str, tuple[str, Place]]
    radius: float
    groups: Sequence[int]
    stiffness: float | Mapping[str, float]
    damping: float | Mapping[str, float]
    armature: float | Mapping[str, float] = 0.01
    scale: float | Sequence[float] = 0.3
    targets: tuple[float, ...] = ()
    held: Mapping[str, float] = field(default_factory=dict)
    unlimited: tuple[str, ...] = ()
    quiet: tuple[str, ...] = ()
    flip: Flip | None = None

    @property
    def dofs(self) -> tuple[str, ...]:
        """Names of the joints in the scene."""
        return tuple(f"{self.name}/{joint}" for joint in self.joints)

    @property
    def body(self) -> str:
        """Name of the base in the scene."""
        return f"{self.name}/{self.base}"

    @property
    def start_draws(self) -> int:
        """Random numbers of a start besides those of the scene."""
        return 0

    def add_to(self, scene: Scene) -> None:
        """Add it to a scene, standing on level ground, with a site at each foot and random starts."""
        robot = scene.add_urdf(self.file, name=self.name, floating=True, pos=(0.0, 0.0, self.height))
        pose = {**dict(zip(self.joints, self.standing, strict=True)), **self.held}
        robot.joint_q = pose
        robot.joint_target_q = pose | dict(zip(self.joints, self.targets or self.standing, strict=True))
        robot.joint_target_ke, robot.joint_target_kd = self.stiffness, self.damping
        robot.joint_armature = self.armature
        if self.unlimited:
            robot.joint_effort_limit = dict.fromkeys(self.unlimited, np.inf)
        for name, (link, place) in self.feet.items():
            scene.add_site(body=f"{self.name}/{link}", pos=place, name=name)
        offsets = {self.name: Uniform(-OFFSET, OFFSET)} | {
            f"{self.name}/{joint}": Uniform(0.0, 0.0) for joint in self.held
        }
        scene.randomize(joint_q=offsets, body_q={self.name: {"yaw": Uniform(-np.pi, np.pi)}})

    def control(self, limit: float) -> Control:
        """Return the control of its joints."""
        return JointTarget(self.dofs, self.scale, limit=limit)

    def sites(self, names: Names) -> list[int]:
        """Return the indices of its feet in ``site_field``."""
        return [names.site(name) for name in self.feet]

    def start(self, draws: Array) -> Array | None:
        """Return ``joint_q`` at random starts, shape ``(worlds, coords)``; None where the scene draws them.

        Args:
            draws: Uniform random numbers in [0, 1), shape ``(worlds, start_draws)``.
        """
        return None

    def metadata(self) -> dict[str, Any]:
        """Return what the metadata of policies cannot read from the scene: nothing of a URDF robot."""
        return {}


@dataclass(frozen=True, kw_only=True)
class LeggedModel(LeggedRobot):
    """A legged robot from MuJoCo's MJCF, with a position actuator at each joint of the action.

    Attributes:
        model: The compiled `mujoco.MjModel`, with sites at the feet.
        start_q: ``joint_q`` when it stands, shape ``(coords,)``.
        ranges: Column in ``joint_q``, lower and upper limit [rad] of each joint of the action, shape ``(joints, 3)``.
    """

    site_field: ClassVar[str] = "site_xpos"
    torque_field: ClassVar[str] = "qfrc_actuator"

    model: Any
    start_q: Array
    ranges: Array

    @property
    def start_draws(self) -> int:
        """A yaw, and an offset of each joint."""
        return 1 + len(self.joints)

    def add_to(self, scene: Scene) -> None:
        """Add the model to a scene."""
        scene.add_mujoco(self.model, name=self.name)

    def control(self, limit: float) -> Control:
        """Return the control of its actuators."""
        return ActuatorTarget(self.targets or self.standing, self.scale, limit=limit)

    def sites(self, names: Names) -> list[int]:
        """Return the indices of its feet in ``site_field``."""
        return [int(self.model.site(name).id) for name in self.feet]

    def start(self, draws: Array) -> Array:
        """Return ``joint_q`` at random starts, shape ``(worlds, coords)``."""
        joint_q = np.tile(self.start_q, (len(draws), 1))
        columns, low, high = self.ranges[:, 0].astype(int), self.ranges[:, 1], self.ranges[:, 2]
        offsets = OFFSET * (2.0 * np.asarray(draws[:, 1:], np.float64) - 1.0)
        joint_q[:, columns] = np.clip(joint_q[:, columns] + offsets, low, high)
        half = np.pi * (np.asarray(draws[:, 0], np.float64) - 0.5)
        joint_q[:, 5], joint_q[:, 6] = np.sin(half), np.cos(half)
        return joint_q

    def on_ground(self) -> Any:
        """Return an `mujoco.MjModel` of it on a plane, to run its policies in MuJoCo.

        Raises:
            ArgumentError: It has equalities, tendons or plugins.
        """
        # needs MuJoCo, which URDF robots do not
        from tightloop.tasks.legged_models.grounded import grounded

        return grounded(self.model)

    def metadata(self) -> dict[str, Any]:
        """Return its joints with one coordinate, the pose in which it stands, and their drives or springs."""
        model, single = self.model, [joint for joint in range(self.model.njnt) if self.model.jnt_type[joint] >= _SLIDE]
        names, dofs = [model.joint(joint).name for joint in single], model.jnt_dofadr[single]
        columns = model.jnt_qposadr[single]
        found: dict[str, Any] = {
            "joint_names": names,
            "default_joint_pos": self.start_q[columns],
            "joint_stiffness": model.jnt_stiffness[single],
            "joint_damping": model.dof_damping[dofs],
            "joint_effort_limit": np.full(len(names), np.inf),
            "joint_armature": model.dof_armature[dofs],
        }
        for actuator, joint in enumerate(self.joints):
            place = names.index(joint)
            found["joint_stiffness"][place] = model.actuator_gainprm[actuator, 0]
            found["joint_damping"][place] = -model.actuator_biasprm[actuator, 2]
            if model.actuator_forcelimited[actuator]:
                found["joint_effort_limit"][place] = model.actuator_forcerange[actuator, 1]
        return found
