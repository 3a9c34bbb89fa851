"""A quadruped follows velocity commands on flat ground; see `tightloop.tasks.velocity`.

| place | observation | range | unit |
|---|---|---|---|
| 0–2 | velocity of the trunk in its axes | ±10 | m/s |
| 3–5 | angular velocity of the trunk in its axes | ±30 | rad/s |
| 6–8 | direction of gravity in its axes | ±1 | – |
| 9–11 | command: ahead, left, turn | ±2 | m/s, rad/s |
| 12–23 | joint positions less those of standing | ±4 | rad |
| 24–35 | joint velocities | ±60 | rad/s |
| 36–47 | last action | ±4 | – |
| 48, 49 | sine and cosine of the gait's phase; 0 and 1 when commanded to stand | ±1 | – |

| action | range | what 1 means |
|---|---|---|
| 0–11 | ±4 | a target 0.3 rad from standing |

The reward is the weighted sum of the terms of `QuadrupedVelocityFlat.reward_terms`. An episode ends when the trunk
tilts by more than 60° or is closer than 15 cm to the ground. ``velocity_error`` in ``infos`` is the distance of the
velocity from the command in the plane [m/s], a mean over about a second.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from tightloop.assets import QUADRUPED
from tightloop.tasks.legged import ByJoint, LeggedRobot, RobotOptions
from tightloop.tasks.velocity import CONTROL_DT, VelocityTask

if TYPE_CHECKING:
    from tightloop.mujoco.scene_models import Model

LEGS = ("FL", "FR", "RL", "RR")
ROBOT = LeggedRobot(
    file=QUADRUPED,
    name="dog",
    base="trunk",
    joints=tuple(f"{leg}_{joint}" for leg in LEGS for joint in ("hip", "thigh", "calf")),
    standing=(0.0, 0.8, -1.6) * 4,
    height=0.32,
    hip_height=0.32,
    mass=14.68,
    feet={leg: (f"{leg}_foot", (0.0, 0.0, 0.0)) for leg in LEGS},
    radius=0.02,
    groups=(0, 1, 1, 0),  # a trot: diagonal feet swing together
    stiffness=40.0,
    damping=1.0,
    flip=([3, 4, 5, 0, 1, 2, 9, 10, 11, 6, 7, 8], [-1, 1, 1] * 4),
)


class QuadrupedVelocityFlat(VelocityTask):
    """Follow velocity commands.

    Args:
        pushes: Largest push of the trunk [N·s], 0 for none; if left out, one of 4 N·s for 14.7 kg.
        model: URDF or MJCF of another quadruped: a path, a model of the package ``mujoco``,
            or ``"unitree_go1"``.
        standing: Positions of its joints when it stands [rad], by name or pattern; if left out, as declared or found.
        stiffness: Gains of the drives [N·m/rad], for all joints or by name or pattern; likewise.
        damping: Likewise [N·m·s/rad].
        scale: Effect of an action of 1 on the targets [rad], likewise; 0.3 if left out.
    """

    legs = 4
    robot = ROBOT
    goal_steps = 100
    reward_weights: Mapping[str, float] = {
        "follow velocity": 1.5 * CONTROL_DT,
        "miss": -1.0 * CONTROL_DT,
        "follow turn": 0.75 * CONTROL_DT,
        "bounce": -1.0 * CONTROL_DT,
        "roll and pitch rate": -0.05 * CONTROL_DT,
        "tilt": -2.5 * CONTROL_DT,
        "torque": -2e-4 * CONTROL_DT,
        "action rate": -0.01 * CONTROL_DT,
        "gait": 1.0 * CONTROL_DT,
        "pose": -0.1 * CONTROL_DT,
        "fall": -6.0,
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
        super().__init__(pushes, 4.0, model, RobotOptions(standing, stiffness, damping, scale))
