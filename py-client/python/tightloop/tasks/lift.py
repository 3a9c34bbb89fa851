"""A Franka arm lifts a cube and holds it at a place in the air.

After Isaac Lab's ``Isaac-Lift-Cube-Franka-v0`` (its ranges, weights and rates, without the curriculum that raises the
weights of the last two terms), with this project's arm and quaternions (x, y, z, w), and a cube of 4 cm. Control at
50 Hz, episodes of 5 s, physics at 200 Hz, not 100 (`tightloop.tasks.cube` says why). The arm stands at the origin, the
cube at x = 0.5 m, off by up to 0.1 m in x and 0.25 m in y, its sides along the axes. Isaac Lab's actions have
no bounds; here they end at ±3, 1.5 rad, where the hand comes to every cube: within ±1 it comes to none.

| place | observation | range | unit |
|---|---|---|---|
| 0–8 | joint positions less those of the start, fingers last | ±6; fingers ±0.1 | rad, m |
| 9–17 | joint velocities | ±10 | rad/s, m/s |
| 18–20 | position of the cube | ±2 | m |
| 21–23 | goal of the cube: position | x 0.4–0.6, y ±0.25, z 0.25–0.5 | m |
| 24–27 | goal of the cube: orientation, upright, which nothing asks for | ±1 | – |
| 28–35 | last action | ±3; gripper ±1 | – |

| action | range | what 1 means |
|---|---|---|
| 0–6 | ±3 | 0.5 rad from the start (``joint_target``); ±1 with the other controls, and what they mean |
| last | ±1 | target of the fingers: 4 cm, open, from 0 up; below it is -1 cm, closed |

With the control ``end_effector_delta`` an action has one number less, and so has the observation.

Reward: 1 - tanh(d/0.1) + u (15 + 16 (1 - tanh(e/0.3)) + 5 (1 - tanh(e/0.05))) - 1e-4 |a - a'|² - 1e-4 |q̇|²; d is the
distance of the cube from the tcp [m], e that from its goal, u whether the cube's centre is higher than 4 cm, a' the
action before, q̇ the velocities of the joints. A success is e < 2.5 cm; an episode goes on after it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

import tightloop as tl
from tightloop.env.names import Names
from tightloop.env.observed import Observed
from tightloop.env.task import Array, Namespace, Worlds
from tightloop.tasks import franka
from tightloop.tasks.cube import CubeTask
from tightloop.tasks.geometry import distance, in_box, squares
from tightloop.tasks.reach import START

LOW, HIGH = (0.4, -0.25, 0.25), (0.6, 0.25, 0.5)  # of the goals [m]
LIFTED = 0.04  # [m]
CLOSE = 0.025  # [m]


class FrankaLift(CubeTask):
    """Lift a cube. ``control`` is one of `tightloop.tasks.franka.CONTROLS`."""

    fields = ("joint_q", "joint_qd", "site_q")
    max_episode_steps = 250
    goal_radius = 0.025
    goal_draws = 3
    substeps = 4
    start = START
    base = (0.0, 0.0, 0.0)
    place = (0.5, 0.0)
    spread = {"x": tl.Uniform(-0.1, 0.1), "y": tl.Uniform(-0.25, 0.25)}  # noqa: RUF012
    binary_gripper = True

    def __init__(self, control: str = "joint_target") -> None:
        super().__init__(control)

    def observed(self) -> Sequence[Observed]:
        """The table above."""
        arm, _ = self.controls()
        return [
            *franka.joints_observed(),
            Observed("cube: position", -2, 2, 3, "m"),
            Observed("goal: position", LOW, HIGH, 3, "m"),
            Observed("goal: orientation", -1, 1, 4),
            Observed("last action: arm", -arm.limit, arm.limit, arm.size, "–"),
            Observed("last action: gripper", -1, 1),
        ]

    def bind(self, names: Names) -> None:
        """Look up tcp and cube."""
        super().bind(names)
        self._start = np.array(self.start, np.float32)

    def goal(self, xp: Namespace, worlds: Worlds, draws: Array) -> Array:
        """A place in the box, upright."""
        place = in_box(draws, LOW, HIGH)
        zero = 0.0 * place[0]
        return xp.stack([*place, zero, zero, zero, zero + 1.0], 1)

    def observe(self, xp: Namespace, worlds: Worlds) -> Sequence[Array]:
        """Joints, cube, goal, last action."""
        return (
            worlds.joint_q[:, :9] - xp.asarray(self._start),
            worlds.joint_qd[:, :9],
            worlds.joint_q[:, self._pos],
            worlds.goal[:, :3],
            worlds.goal[:, 3:],
            worlds.action[:, :-1],
            worlds.action[:, -1],
        )

    def error(self, xp: Namespace, worlds: Worlds) -> Array:
        """Distance of the cube from its goal [m], shape ``(worlds,)``."""
        return distance(xp, worlds.joint_q[:, self._pos], worlds.goal)

    def reward(self, xp: Namespace, worlds: Worlds) -> Array:
        """Near the cube; lifted, near the goal; smooth."""
        pos = worlds.joint_q[:, self._pos]
        reach, error = distance(xp, pos, worlds.site_q[:, self._tcp, :3]), self.error(xp, worlds)
        up = 36.0 - 16.0 * xp.tanh(error / 0.3) - 5.0 * xp.tanh(error / 0.05)
        effort = squares(xp, worlds.action - worlds.previous_action) + squares(xp, worlds.joint_qd[:, :9])
        return 1.0 - xp.tanh(reach / 0.1) + (pos[:, 2] > LIFTED) * up - 1e-4 * effort

    def success(self, xp: Namespace, worlds: Worlds) -> Array:
        """At the goal."""
        return self.error(xp, worlds) < CLOSE
