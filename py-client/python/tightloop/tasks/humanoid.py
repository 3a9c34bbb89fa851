"""A humanoid follows velocity commands on flat ground; see `tightloop.tasks.velocity`.

| place | observation | range | unit |
|---|---|---|---|
| 0–2 | velocity of the pelvis in its axes | ±10 | m/s |
| 3–5 | angular velocity of the pelvis in its axes | ±30 | rad/s |
| 6–8 | direction of gravity in its axes | ±1 | – |
| 9–11 | command: ahead, left, turn | ±2 | m/s, rad/s |
| 12–34 | joint positions less those of standing | ±4 | rad |
| 35–57 | joint velocities | ±60 | rad/s |
| 58–80 | last action | ±4 | – |
| 81, 82 | sine and cosine of the gait's phase; 0 and 1 when commanded to stand | ±1 | – |

| action | range | what 1 means |
|---|---|---|
| 0–22 | ±4 | a target 0.3 rad (pitch of hips, knees, ankles), 0.2 rad (rest of the legs) or 0.1 rad from standing |

The reward is the weighted sum of the terms of `HumanoidVelocityFlat.reward_terms`. An episode ends when the pelvis
tilts by more than 60° or is closer than 45 cm to the ground. ``velocity_error`` in ``infos`` is the distance of the
velocity from the command in the plane [m/s], a mean over about a second.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from tightloop.assets import HUMANOID
from tightloop.env.names import Names
from tightloop.env.task import Array, Namespace, Worlds
from tightloop.tasks.legged import ByJoint, LeggedRobot, RobotOptions
from tightloop.tasks.velocity import CONTROL_DT, VelocityTask, columns

if TYPE_CHECKING:
    from tightloop.mujoco.scene_models import Model

SIDES = ("left", "right")
LEG = {"hip_pitch": -0.3, "hip_roll": 0.0, "hip_yaw": 0.0, "knee": 0.6, "ankle_pitch": -0.3, "ankle_roll": 0.0}
WAIST = {"waist_yaw": 0.0, "waist_roll": 0.0, "waist_pitch": 0.0}
ARM = {"shoulder_pitch": 0.2, "shoulder_roll": 0.2, "shoulder_yaw": 0.0, "elbow": -0.6}
#: Joints that take a leg ahead.
AHEAD = ("hip_pitch", "knee", "ankle_pitch")
#: Joints that turn the other way in the mirror image.
SIDEWAYS = ("roll", "yaw")


def _pose() -> dict[str, float]:
    """Positions of all joints when it stands [rad]."""
    pose = {f"{side}_{joint}": value for side in SIDES for joint, value in LEG.items()} | WAIST
    pose |= {f"{side}_{joint}": value for side in SIDES for joint, value in ARM.items()}
    # arms are a little off the trunk: opposite rolls
    return pose | {"right_shoulder_roll": -ARM["shoulder_roll"]}


def _flip(joints: list[str]) -> tuple[list[int], list[float]]:
    """Left and right joints exchanged."""
    swapped = {"left": "right", "right": "left"}
    twins = ["_".join(swapped.get(part, part) for part in joint.split("_")) for joint in joints]
    return [joints.index(twin) for twin in twins], [-1.0 if j.endswith(SIDEWAYS) else 1.0 for j in joints]


def _scale(joint: str) -> float:
    """Effect of an action on a joint's target [rad]: most on joints that take a leg ahead."""
    if joint.endswith(AHEAD):
        return 0.3
    return 0.2 if "hip" in joint or "ankle" in joint else 0.1


POSE = _pose()
ROBOT = LeggedRobot(
    file=HUMANOID,
    name="humanoid",
    base="pelvis",
    joints=tuple(POSE),
    standing=tuple(POSE.values()),
    height=0.75,
    hip_height=0.67,
    mass=35.2,
    feet={side: (f"{side}_foot", (0.035, 0.0, -0.04)) for side in SIDES},
    radius=0.0,
    groups=(0, 1),
    stiffness={
        ".*_hip_.*": 100.0,
        ".*_knee": 150.0,
        ".*_ankle_.*": 40.0,
        "waist_.*": 120.0,
        ".*_(shoulder_.*|elbow)": 40.0,
    },
    damping={".*_hip_.*": 3.0, ".*_knee": 4.0, ".*_ankle_.*": 2.0, "waist_.*": 4.0, ".*_(shoulder_.*|elbow)": 1.5},
    armature={".*_(hip|knee|ankle).*|waist_.*": 0.02, ".*_(shoulder_.*|elbow)": 0.01},
    scale=tuple(_scale(joint) for joint in POSE),
    quiet=tuple(joint for joint in POSE if not joint.endswith(AHEAD)),
    flip=_flip(list(POSE)),
)


class HumanoidVelocityFlat(VelocityTask):
    """Follow velocity commands with a humanoid.

    Args:
        pushes: Largest push of the pelvis [N·s], 0 for none; if left out, one of 10 N·s for 35 kg.
        model: URDF or MJCF of another humanoid: a path, a model of the package ``mujoco``,
            or ``"unitree_g1"``.
        standing: Positions of its joints when it stands [rad], by name or pattern; if left out, as declared or found.
        stiffness: Gains of the drives [N·m/rad], for all joints or by name or pattern; likewise.
        damping: Likewise [N·m·s/rad].
        scale: Effect of an action of 1 on the targets [rad], likewise; those of the own robot's legs and
            other joints if left out.
    """

    legs = 2
    robot = ROBOT
    gait, swing, lowest = 1.4, 0.08, 0.45
    command_max = (1.0, 0.4, 1.0)
    reward_weights: Mapping[str, float] = {
        "follow velocity": 2.0 * CONTROL_DT,
        "miss": -1.0 * CONTROL_DT,
        "follow turn": 0.75 * CONTROL_DT,
        "bounce": -0.5 * CONTROL_DT,
        "roll and pitch rate": -0.05 * CONTROL_DT,
        "tilt": -2.5 * CONTROL_DT,
        "torque": -1e-5 * CONTROL_DT,
        "action rate": -0.01 * CONTROL_DT,
        "gait": 1.0 * CONTROL_DT,
        "pose": -0.05 * CONTROL_DT,
        "upper body": -0.5 * CONTROL_DT,
        "fall": -5.0,
    }

    def __init__(
        self,
        pushes: float | None = None,
        *,
        model: Model | None = None,
        standing: Mapping[str, float] | None = None,
        stiffness: ByJoint | None = None,
        damping: ByJoint | None = None,
        scale: ByJoint | None = None,
    ) -> None:
        super().__init__(pushes, 10.0, model, RobotOptions(standing, stiffness, damping, scale))

    def bind(self, names: Names) -> None:
        """Look up the joints and feet."""
        super().bind(names)
        self._quiet = np.array([joint in self.robot.quiet for joint in self.robot.joints], np.float32)

    def reward_terms(self, xp: Namespace, worlds: Worlds) -> Mapping[str, Array]:
        """Return the terms, before their weights."""
        off = columns(xp, worlds.joint_q, self._joints) - xp.asarray(self._standing)
        return {**super().reward_terms(xp, worlds), "upper body": xp.vecdot(off * xp.asarray(self._quiet), off)}
