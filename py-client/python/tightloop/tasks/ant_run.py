"""An ant runs ahead, along the world's x axis, as fast as it can.

| place | observation | range | unit |
|---|---|---|---|
| 0 | height of the torso | 0–2 | m |
| 1–3 | direction of gravity in the torso's axes | ±1 | – |
| 4, 5 | direction of the world's x axis in them: ahead and to the left | ±1 | – |
| 6–8 | velocity of the torso in its axes | ±10 | m/s |
| 9–11 | angular velocity of the torso in its axes | ±30 | rad/s |
| 12–19 | joint positions less those of standing: hip and knee of FL, FR, RL, RR | ±4 | rad |
| 20–27 | joint velocities | ±60 | rad/s |
| 28–35 | last action | ±1 | – |

| action | range | what 1 means |
|---|---|---|
| 0–7 | ±1 | a target 0.6 rad from standing |

The reward is the weighted sum of the terms of `AntRun.reward_terms`; 1 m/s along x is worth 0.02 a step. An episode
ends when the torso is upside down, or its height is below 13 cm or above 1 m. Control at 50 Hz, physics at 200 Hz.
``speed`` in ``infos`` is the mean velocity along x since the start [m/s].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

import tightloop as tl
from tightloop.assets import ANT
from tightloop.env.controls import Control, JointTarget
from tightloop.env.mirror import Mirror
from tightloop.env.names import Names
from tightloop.env.observed import Observed
from tightloop.env.task import Array, Namespace, Task, Worlds
from tightloop.tasks.geometry import squares
from tightloop.tasks.kinematics import projected_gravity, rotate_inverse
from tightloop.tasks.velocity import AXIAL, CONTROL_DT, DT, POLAR, SUBSTEPS

LEGS = ("FL", "FR", "RL", "RR")
JOINTS = tuple(f"ant/{leg}_{joint}" for leg in LEGS for joint in ("hip", "knee"))
STANDING = (0.0, 1.1) * 4  # [rad]
HEIGHT = 0.3  # of the torso when it stands [m]
STIFFNESS, DAMPING, ARMATURE = 30.0, 0.6, 0.005  # [N·m/rad, N·m·s/rad, kg·m²]
SCALE = 0.6  # [rad]


class AntRun(Task):
    """Run ahead as fast as possible.

    Attributes:
        lowest: Height of the torso below which an episode ends [m].
        highest: Height above which it ends [m].
    """

    fields = ("joint_q", "joint_qd")
    max_episode_steps = 1000
    lowest, highest = 0.13, 1.0
    reward_weights: Mapping[str, float] = {
        "ahead": 1.0 * CONTROL_DT,
        "sideways": -0.3 * CONTROL_DT,
        "action": -0.02 * CONTROL_DT,
        "action rate": -0.02 * CONTROL_DT,
        "fall": -1.0,
    }

    def scene(self) -> tl.Scene:
        """The ant on the ground, about ahead, with its joints a little off."""
        scene = tl.Scene(dt=DT, substeps=SUBSTEPS)
        scene.solver(cone="pyramidal", impratio=1.0)
        scene.add_ground(mu=1.0)
        robot = scene.add_urdf(ANT, name="ant", floating=True, pos=(0.0, 0.0, HEIGHT))
        robot.joint_q = robot.joint_target_q = dict(zip((n.partition("/")[2] for n in JOINTS), STANDING, strict=True))
        robot.joint_target_ke, robot.joint_target_kd, robot.joint_armature = STIFFNESS, DAMPING, ARMATURE
        scene.randomize(joint_q={"ant": tl.Uniform(-0.1, 0.1)}, body_q={"ant": {"yaw": tl.Uniform(-0.3, 0.3)}})
        return scene

    def controls(self) -> Sequence[Control]:
        """Joint targets."""
        return [JointTarget(JOINTS, SCALE)]

    def observed(self) -> Sequence[Observed]:
        """The table of the module."""
        return [
            Observed("height", 0, 2, unit="m"),
            Observed("gravity", -1, 1, 3),
            Observed("ahead", -1, 1, 2),
            Observed("velocity", -10, 10, 3, "m/s"),
            Observed("angular velocity", -30, 30, 3, "rad/s"),
            Observed("joint positions", -4, 4, len(JOINTS), "rad"),
            Observed("joint velocities", -60, 60, len(JOINTS), "rad/s"),
            Observed("last action", -1, 1, len(JOINTS)),
        ]

    def bind(self, names: Names) -> None:
        """Look up the joints."""
        coord, dof = names.coord(JOINTS[0]), names.dof(JOINTS[0])
        self._joints, self._dofs = slice(coord, coord + len(JOINTS)), slice(dof, dof + len(JOINTS))
        self._standing = np.array(STANDING, np.float32)

    def remember(self, xp: Namespace, worlds: Worlds, memory: Mapping[str, Array] | None) -> Mapping[str, Array]:
        """Return velocities, gravity and x axis in the torso's axes, the distance along x [m], and the time [s]."""
        quats = worlds.joint_q[:, 3:7]
        now = worlds.joint_qd[:, 0]
        if memory is None:
            distance, time = 0.0 * now, 0.0 * now
        else:
            distance, time = memory["distance"] + CONTROL_DT * now, memory["time"] + CONTROL_DT
        along = xp.stack([0.0 * now + 1.0, 0.0 * now, 0.0 * now], 1)
        return {
            "velocity": rotate_inverse(xp, quats, worlds.joint_qd[:, 0:3]),
            "turning": rotate_inverse(xp, quats, worlds.joint_qd[:, 3:6]),
            "gravity": projected_gravity(xp, quats),
            "ahead": rotate_inverse(xp, quats, along)[:, :2],
            "distance": distance,
            "time": time,
        }

    def observe(self, xp: Namespace, worlds: Worlds) -> Sequence[Array]:
        """Return the parts of the table of the module."""
        own = worlds.memory
        turned = worlds.joint_q[:, self._joints] - xp.asarray(self._standing)
        moving = worlds.joint_qd[:, self._dofs]
        motion = own["gravity"], own["ahead"], own["velocity"], own["turning"]
        return worlds.joint_q[:, 2], *motion, turned, moving, worlds.action

    def reward_terms(self, xp: Namespace, worlds: Worlds) -> Mapping[str, Array]:
        """Return the terms, before their weights."""
        return {
            "ahead": worlds.joint_qd[:, 0],
            "sideways": worlds.joint_qd[:, 1] * worlds.joint_qd[:, 1],
            "action": squares(xp, worlds.action),
            "action rate": squares(xp, worlds.action - worlds.previous_action),
            "fall": 1.0 * self.terminated(xp, worlds),
        }

    def terminated(self, xp: Namespace, worlds: Worlds) -> Array:
        """Return which ants are upside down, too low or too high."""
        height = worlds.joint_q[:, 2]
        return (worlds.memory["gravity"][:, 2] > 0.0) | (height < self.lowest) | (height > self.highest)

    def metrics(self, xp: Namespace, worlds: Worlds) -> Mapping[str, Array]:
        """Return ``speed``, the mean velocity along x since the start [m/s], and ``fell``."""
        own = worlds.memory
        time = xp.maximum(own["time"], 0.0 * own["time"] + CONTROL_DT)
        return {"speed": own["distance"] / time, "fell": self.terminated(xp, worlds)}

    def mirrored(self) -> Mirror:
        """Return left and right exchanged."""
        joints = ([2, 3, 0, 1, 6, 7, 4, 5], [-1, 1] * 4)
        return Mirror(
            {
                "height": ([0], [1]),
                "gravity": POLAR,
                "ahead": ([0, 1], [1, -1]),
                "velocity": POLAR,
                "angular velocity": AXIAL,
                "joint positions": joints,
                "joint velocities": joints,
                "last action": joints,
            },
            joints,
        )
