"""A quadruped follows velocity commands on flat ground.

The command is a velocity ahead and to the left and a turning rate, drawn anew every five seconds. Physics at 200 Hz,
control at 50 Hz, episodes of 20 s. Rewards and rates follow legged_gym (Rudin et al. 2022, arXiv 2109.11978).

| place | observation | range | unit |
|---|---|---|---|
| 0–2 | velocity of the trunk in its axes | ±10 | m/s |
| 3–5 | angular velocity of the trunk in its axes | ±30 | rad/s |
| 6–8 | direction of gravity in its axes | ±1 | – |
| 9–11 | command: ahead, left, turn | ±2 | m/s, rad/s |
| 12–23 | joint positions less those of standing | ±4 | rad |
| 24–35 | joint velocities | ±60 | rad/s |
| 36–47 | last action | ±4 | – |
| 48, 49 | sine and cosine of the gait's phase; 0 and 1 when told to stand | ±1 | – |

| action | range | what 1 means |
|---|---|---|
| 0–11 | ±4 | a target 0.3 rad from standing |

The reward is the weighted sum of the terms of `QuadrupedVelocityFlat.reward_terms`. An episode ends when the trunk
tilts by more than 60° or is closer than 15 cm to the ground. ``velocity_error`` in ``infos`` is the distance of the
velocity from the command in the plane [m/s], a mean over about a second.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

import tightloop as tl
from tightloop.assets import QUADRUPED
from tightloop.env.controls import Control, JointTarget
from tightloop.env.disturbances import Push
from tightloop.env.mirror import Flip, Mirror
from tightloop.env.names import Names
from tightloop.env.task import Array, Namespace, Observed, Task, Worlds
from tightloop.tasks.geometry import squares
from tightloop.tasks.kinematics import projected_gravity, rotate_inverse

LEGS = ("FL", "FR", "RL", "RR")
JOINTS = tuple(f"dog/{leg}_{joint}" for leg in LEGS for joint in ("hip", "thigh", "calf"))
STANDING = (0.0, 0.8, -1.6) * 4  # [rad]
HEIGHT = 0.32  # of the trunk at the start [m]
LIMIT = 4.0  # of actions
SCALE = 0.3  # [rad]
STIFFNESS, DAMPING, ARMATURE = 40.0, 1.0, 0.01  # [N·m/rad, N·m·s/rad, kg·m²]
DT, SUBSTEPS = 1 / 200, 4  # [s, –]
CONTROL_DT = DT * SUBSTEPS  # [s]
SPEED, SIDE, TURN = 1.0, 0.6, 1.0  # greatest command [m/s, m/s, rad/s]
STILL = 0.1  # share of the commands that are to stand
GAIT, SWING, FOOT = 2.5, 0.07, 0.02  # steps of a leg, height of its swing, radius of a foot [Hz, m, m]
DIAGONALS = [0, 1, 1, 0]  # which feet swing together


class QuadrupedVelocityFlat(Task):
    """Follow velocity commands. ``pushes`` is the largest push of the trunk [N·s]; 0 for none."""

    fields = ("joint_q", "joint_qd", "joint_torque", "site_q")
    max_episode_steps = 1000
    goal_draws = 4
    goal_steps = 250
    reward_weights: Mapping[str, float] = {
        "follow velocity": 1.5 * CONTROL_DT,
        "follow turn": 0.75 * CONTROL_DT,
        "bounce": -1.0 * CONTROL_DT,
        "roll and pitch rate": -0.05 * CONTROL_DT,
        "tilt": -2.5 * CONTROL_DT,
        "torque": -2e-4 * CONTROL_DT,
        "action rate": -0.01 * CONTROL_DT,
        "gait": 1.0 * CONTROL_DT,
        "pose": -0.1 * CONTROL_DT,
        "fall": -1.0,
    }

    def __init__(self, pushes: float = 4.0) -> None:
        self._pushes = pushes

    def scene(self) -> tl.Scene:
        """The robot on flat ground, with friction and masses of each world's own."""
        scene = tl.Scene(dt=DT, substeps=SUBSTEPS)
        scene.solver(cone="pyramidal", impratio=1.0)  # MuJoCo's defaults, which feet need no more than
        scene.add_ground()
        dog = scene.add_urdf(QUADRUPED, name="dog", floating=True, pos=(0.0, 0.0, HEIGHT))
        dog.joint_q = STANDING
        dog.joint_target_q = STANDING
        dog.joint_target_ke, dog.joint_target_kd, dog.joint_armature = STIFFNESS, DAMPING, ARMATURE
        for leg in LEGS:
            scene.add_site(body=f"dog/{leg}_foot", name=leg)
        scene.randomize(joint_q={"dog": tl.Uniform(-0.1, 0.1)}, body_q={"dog": {"yaw": tl.Uniform(-np.pi, np.pi)}})
        return scene

    def controls(self) -> Sequence[Control]:
        """Joint targets."""
        return [JointTarget(JOINTS, SCALE, limit=LIMIT)]

    def disturbances(self) -> Sequence[Push]:
        """Pushes of the trunk."""
        return [Push("dog/trunk", self._pushes, (4.0, 8.0))] if self._pushes else []

    def observed(self) -> Sequence[Observed]:
        """The table above."""
        return [
            Observed("velocity", -10, 10, 3, "m/s"),
            Observed("angular velocity", -30, 30, 3, "rad/s"),
            Observed("gravity", -1, 1, 3),
            Observed("command", -2, 2, 3, "m/s, rad/s"),
            Observed("joint positions", -4, 4, 12, "rad"),
            Observed("joint velocities", -60, 60, 12, "rad/s"),
            Observed("last action", -LIMIT, LIMIT, 12),
            Observed("phase", -1, 1, 2),
        ]

    def bind(self, names: Names) -> None:
        """Look up the joints and feet."""
        self._joints = slice(names.coord(JOINTS[0]), names.coord(JOINTS[-1]) + 1)
        self._dofs = slice(names.dof(JOINTS[0]), names.dof(JOINTS[-1]) + 1)
        self._feet = slice(names.site(LEGS[0]), names.site(LEGS[-1]) + 1)
        self._standing = np.array(STANDING, np.float32)

    def goal(self, xp: Namespace, worlds: Worlds, draws: Array) -> Array:
        """Return the next command: ahead, left, turn; or to stand."""
        moves = draws[:, 3] >= STILL
        signed = 2.0 * draws - 1.0
        return xp.stack([most * signed[:, axis] * moves for axis, most in enumerate((SPEED, SIDE, TURN))], 1)

    def remember(self, xp: Namespace, worlds: Worlds, memory: Mapping[str, Array] | None) -> Mapping[str, Array]:
        """Return velocities in the trunk's axes, the phase, how far feet are from their gait, and the mean error."""
        quats = worlds.joint_q[:, 3:7]
        velocity = rotate_inverse(xp, quats, worlds.joint_qd[:, 0:3])
        turning = rotate_inverse(xp, quats, worlds.joint_qd[:, 3:6])
        apart = worlds.goal[:, :2] - velocity[:, :2]
        error = xp.sqrt(squares(xp, apart))
        phase = 0.0 * error
        if memory is not None:
            error = memory["error"] + 0.03 * (error - memory["error"])
            phase = (memory["phase"] + 2.0 * np.pi * GAIT * CONTROL_DT) * (squares(xp, worlds.goal) > 0.0)
        # a trot: diagonal feet swing together
        swing = xp.sin(phase)
        lift = SWING * xp.stack([xp.maximum(swing, 0.0 * swing), xp.maximum(-swing, 0.0 * swing)], 1)
        feet = worlds.site_q[:, self._feet, 2] - FOOT - lift[:, DIAGONALS]
        return {
            "velocity": velocity,
            "turning": turning,
            "gravity": projected_gravity(xp, quats),
            "phase": phase,
            "clock": xp.stack([swing, xp.cos(phase)], 1),
            "feet": squares(xp, feet),
            "error": error,
        }

    def observe(self, xp: Namespace, worlds: Worlds) -> Sequence[Array]:
        """Return the parts of the table above."""
        own = worlds.memory
        turned = worlds.joint_q[:, self._joints] - xp.asarray(self._standing)
        moving = worlds.joint_qd[:, self._dofs]
        return own["velocity"], own["turning"], own["gravity"], worlds.goal, turned, moving, worlds.action, own["clock"]

    def reward_terms(self, xp: Namespace, worlds: Worlds) -> Mapping[str, Array]:
        """Return the terms, before their weights."""
        own = worlds.memory
        velocity, turning, gravity, command = own["velocity"], own["turning"], own["gravity"], worlds.goal
        turn = command[:, 2] - turning[:, 2]
        return {
            "follow velocity": xp.exp(-4.0 * squares(xp, command[:, :2] - velocity[:, :2])),
            "follow turn": xp.exp(-4.0 * turn * turn),
            "bounce": velocity[:, 2] * velocity[:, 2],
            "roll and pitch rate": squares(xp, turning[:, :2]),
            "tilt": squares(xp, gravity[:, :2]),
            "torque": squares(xp, worlds.joint_torque[:, self._dofs]),
            "action rate": squares(xp, worlds.action - worlds.previous_action),
            "gait": xp.exp(-200.0 * own["feet"]),
            "pose": squares(xp, worlds.joint_q[:, self._joints] - xp.asarray(self._standing)),
            "fall": 1.0 * self.terminated(xp, worlds),
        }

    def terminated(self, xp: Namespace, worlds: Worlds) -> Array:
        """Return which robots fell."""
        return (worlds.memory["gravity"][:, 2] > -0.5) | (worlds.joint_q[:, 2] < 0.15)

    def metrics(self, xp: Namespace, worlds: Worlds) -> Mapping[str, Array]:
        """Return ``velocity_error``, the mean distance of the velocity from the command [m/s], and ``fell``."""
        return {"velocity_error": worlds.memory["error"], "fell": self.terminated(xp, worlds)}

    def mirrored(self) -> Mirror:
        """Return left and right exchanged."""
        swap = [3, 4, 5, 0, 1, 2, 9, 10, 11, 6, 7, 8]
        joints: Flip = (swap, [-1, 1, 1] * 4)
        polar, axial = ([0, 1, 2], [1, -1, 1]), ([0, 1, 2], [-1, 1, -1])
        return Mirror(
            {
                "velocity": polar,
                "angular velocity": axial,
                "gravity": polar,
                "command": ([0, 1, 2], [1, -1, -1]),
                "joint positions": joints,
                "joint velocities": joints,
                "last action": joints,
                "phase": ([0, 1], [-1, -1]),
            },
            joints,
        )
