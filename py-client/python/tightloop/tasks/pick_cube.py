"""A Franka arm grasps a cube and takes it to a place in the air.

After ManiSkill 3's ``PickCube-v1`` in its control mode ``pd_joint_delta_pos`` (its ranges, rewards, gains and rates),
with this project's arm and quaternions (x, y, z, w). Control at 20 Hz, episodes of 2.5 s, physics at 200 Hz, not 100
(`tightloop.tasks.cube` says why). The base stands at x = -0.615 m, the cube within 0.1 m of the origin, turned anyhow.
A step of the arm is one of its drive targets, not from where the joints are. The drives bear the arm's weight, which
ManiSkill leaves out: at rest the hand is 3 cm lower than its targets.

| place | observation | range | unit |
|---|---|---|---|
| 0–8 | joint positions, fingers last | ±6; fingers ±0.1 | rad, m |
| 9–17 | joint velocities | ±10 | rad/s, m/s |
| 18 | whether the fingers hold the cube | 0 or 1 | – |
| 19–25 | pose of the tcp | ±2; ±1 | m, – |
| 26–28 | goal of the cube | x, y ±0.1, z 0.02–0.32 | m |
| 29–35 | pose of the cube | ±2; ±1 | m, – |
| 36–38 | from the tcp to the cube | ±2 | m |
| 39–41 | from the cube to its goal | ±2 | m |

| action | range | what 1 means |
|---|---|---|
| 0–6 | ±1 | the joint's target moves by 0.1 rad (``joint_delta``), or what the chosen control means |
| last | ±1 | target of the fingers: 4 cm, open; at -1 it is -1 cm, closed |

Reward: (1 - tanh 5 d + h + h (1 - tanh 5 e) + p (1 - tanh 5 |q̇|)) / 5, and 1 in a success; d is the distance of the
cube from the tcp [m], e that from its goal, h whether the fingers hold it, p whether e is at most 2.5 cm, q̇ the
velocities of the arm's joints. A success is p with no joint of the arm faster than 0.2 rad/s; an episode goes on after
it.
"""

from __future__ import annotations

import operator
from collections.abc import Sequence
from functools import reduce

import numpy as np

import tightloop as tl
from tightloop.env.observed import Observed
from tightloop.env.task import Array, Namespace, Worlds
from tightloop.tasks import franka
from tightloop.tasks.cube import HALF, CubeTask, grasped
from tightloop.tasks.geometry import distance, in_box

START = [0.0, np.pi / 8, 0.0, -np.pi * 5 / 8, 0.0, np.pi * 3 / 4, np.pi / 4, 0.04, 0.04]  # [rad, m]
BASE = (-0.615, 0.0, 0.0)  # [m]
SPREAD = 0.1  # of cubes and goals in x and y [m]
LOW, HIGH = (-SPREAD, -SPREAD, HALF), (SPREAD, SPREAD, HALF + 0.3)  # of the goals [m]
CLOSE = 0.025  # [m]
STILL = 0.2  # [rad/s]


class FrankaPickCube(CubeTask):
    """Pick a cube. ``control`` is one of `tightloop.tasks.franka.CONTROLS`."""

    fields = ("joint_q", "joint_qd", "site_q", "contact_sensor")
    max_episode_steps = 50
    goal_radius = 0.025
    goal_draws = 3
    substeps = 10
    start = START
    base = BASE
    place = (0.0, 0.0)
    noise = tl.Normal(0.0, 0.02)
    spread = {  # noqa: RUF012
        "x": tl.Uniform(-SPREAD, SPREAD),
        "y": tl.Uniform(-SPREAD, SPREAD),
        "yaw": tl.Uniform(-np.pi, np.pi),
    }

    def __init__(self, control: str = "joint_delta") -> None:
        super().__init__(control)

    def observed(self) -> Sequence[Observed]:
        """The table above."""
        return [
            *franka.joints_observed(),
            Observed("held", 0, 1),
            Observed("tcp: position", -2, 2, 3, "m"),
            Observed("tcp: orientation", -1, 1, 4),
            Observed("goal", LOW, HIGH, 3, "m"),
            Observed("cube: position", -2, 2, 3, "m"),
            Observed("cube: orientation", -1, 1, 4),
            *(Observed(f"from the tcp to the cube, {axis}", -2, 2, unit="m") for axis in "xyz"),
            *(Observed(f"from the cube to its goal, {axis}", -2, 2, unit="m") for axis in "xyz"),
        ]

    def goal(self, xp: Namespace, worlds: Worlds, draws: Array) -> Array:
        """A place in the box."""
        place = in_box(draws, LOW, HIGH)
        return xp.stack(place, 1)

    def observe(self, xp: Namespace, worlds: Worlds) -> Sequence[Array]:
        """Joints, grasp, tcp, goal, cube."""
        tcp, pos = worlds.site_q[:, self._tcp], worlds.joint_q[:, self._pos]
        return (
            worlds.joint_q[:, :9],
            worlds.joint_qd[:, :9],
            self.held(xp, worlds),
            tcp[:, :3],
            tcp[:, 3:],
            worlds.goal,
            pos,
            worlds.joint_q[:, self._quat],
            # by columns: NumPy takes twice as long over rows of three
            *(pos[:, axis] - tcp[:, axis] for axis in range(3)),
            *(worlds.goal[:, axis] - pos[:, axis] for axis in range(3)),
        )

    def held(self, xp: Namespace, worlds: Worlds) -> Array:
        """Whether the fingers hold the cube, bool, shape ``(worlds,)``."""
        left, right = (worlds.contact_sensor[:, finger] for finger in self._touch)
        return grasped(xp, worlds.site_q[:, self._tcp, 3:], left, right)

    def error(self, xp: Namespace, worlds: Worlds) -> Array:
        """Distance of the cube from its goal [m], shape ``(worlds,)``."""
        return distance(xp, worlds.joint_q[:, self._pos], worlds.goal)

    def reward(self, xp: Namespace, worlds: Worlds) -> Array:
        """Near the cube, holding it, near the goal, still."""
        reach = distance(xp, worlds.joint_q[:, self._pos], worlds.site_q[:, self._tcp, :3])
        held, error = self.held(xp, worlds), self.error(xp, worlds)
        placed = error <= CLOSE
        squares = _squares(worlds)
        calm = placed * (1.0 - xp.tanh(5.0 * xp.sqrt(reduce(operator.add, squares))))
        staged = 1.0 - xp.tanh(5.0 * reach) + held * (2.0 - xp.tanh(5.0 * error)) + calm
        return xp.where(placed & _still(xp, squares), 1.0, 0.2 * staged)

    def success(self, xp: Namespace, worlds: Worlds) -> Array:
        """At the goal, and the arm is still."""
        return (self.error(xp, worlds) <= CLOSE) & _still(xp, _squares(worlds))


def _squares(worlds: Worlds) -> list[Array]:
    """Squares of the velocities of the arm's joints [rad²/s²], each of shape ``(worlds,)``."""
    # by columns: NumPy takes five times as long over rows of seven
    return [worlds.joint_qd[:, joint] * worlds.joint_qd[:, joint] for joint in range(7)]


def _still(xp: Namespace, squares: Sequence[Array]) -> Array:
    return reduce(xp.maximum, squares) <= STILL**2
