"""A Franka arm pushes a cube along the ground, 0.2 m away from itself.

After ManiSkill 3's ``PushCube-v1`` in its control mode ``pd_joint_delta_pos`` (its ranges, rewards, gains and rates),
with this project's arm and quaternions (x, y, z, w). Control at 20 Hz, episodes of 2.5 s, physics at 200 Hz, not 100
(`tightloop.tasks.cube` says why). Base, start and drives are those of `tightloop.tasks.pick_cube`; the cube stands
within 0.1 m of the origin, its sides along the axes. The fingers start open, and a cube fits between them.

| place | observation | range | unit |
|---|---|---|---|
| 0–8 | joint positions, fingers last | ±6; fingers ±0.1 | rad, m |
| 9–17 | joint velocities | ±10 | rad/s, m/s |
| 18–24 | pose of the tcp | ±2; ±1 | m, – |
| 25–27 | goal: on the ground, 0.2 m in x from where the cube started | x 0.1–0.3, y ±0.1, z 0–0.001 | m |
| 28–34 | pose of the cube | ±2; ±1 | m, – |

| action | range | what 1 means |
|---|---|---|
| 0–6 | ±1 | the joint's target moves by 0.1 rad (``joint_delta``), or what the chosen control means |
| last | ±1 | target of the fingers: 4 cm, open; at -1 it is -1 cm, closed |

Reward: (1 - tanh 5 d + r (1 - tanh 5 e)) / 3, and 1 in a success; d is the distance of the tcp from a place 5 mm behind
the cube [m], r whether that is less than 1 cm, e the distance of the cube from its goal in x and y. A success is
e < 0.1 m, with the cube's centre lower than 2.5 cm; an episode goes on after it.
"""

from __future__ import annotations

from collections.abc import Sequence

import tightloop as tl
from tightloop.env.observed import Observed
from tightloop.env.task import Array, Namespace, Worlds
from tightloop.tasks import franka
from tightloop.tasks.cube import HALF, CubeTask
from tightloop.tasks.pick_cube import BASE, SPREAD, START

AHEAD = 0.2  # of the goal before the cube [m]
GOAL_Z = 0.001  # [m]
RADIUS = 0.1  # of the goal [m]
BEHIND = HALF + 0.005  # of the place to push from [m]
REACHED = 0.01  # [m]
FLAT = HALF + 0.005  # [m]


class FrankaPushCube(CubeTask):
    """Push a cube. ``control`` is one of `tightloop.tasks.franka.CONTROLS`."""

    fields = ("joint_q", "joint_qd", "site_q")
    max_episode_steps = 50
    goal_radius = 0.03
    substeps = 10
    start = START
    base = BASE
    place = (0.0, 0.0)
    noise = tl.Normal(0.0, 0.02)
    spread = {"x": tl.Uniform(-SPREAD, SPREAD), "y": tl.Uniform(-SPREAD, SPREAD)}  # noqa: RUF012

    def __init__(self, control: str = "joint_delta") -> None:
        super().__init__(control)

    def observed(self) -> Sequence[Observed]:
        """The table above."""
        return [
            *franka.joints_observed(),
            Observed("tcp: position", -2, 2, 3, "m"),
            Observed("tcp: orientation", -1, 1, 4),
            Observed("goal", (AHEAD - SPREAD, -SPREAD, 0.0), (AHEAD + SPREAD, SPREAD, GOAL_Z), 3, "m"),
            Observed("cube: position", -2, 2, 3, "m"),
            Observed("cube: orientation", -1, 1, 4),
        ]

    def goal(self, xp: Namespace, worlds: Worlds, draws: Array) -> Array:
        """Ahead of where the cube starts."""
        x, y, z = (worlds.joint_q[:, self._pos][:, axis] for axis in range(3))
        return xp.stack([x + AHEAD, y, 0.0 * z + GOAL_Z], 1)

    def observe(self, xp: Namespace, worlds: Worlds) -> Sequence[Array]:
        """Joints, tcp, goal, cube."""
        tcp = worlds.site_q[:, self._tcp]
        return (
            worlds.joint_q[:, :9],
            worlds.joint_qd[:, :9],
            tcp[:, :3],
            tcp[:, 3:],
            worlds.goal,
            worlds.joint_q[:, self._pos],
            worlds.joint_q[:, self._quat],
        )

    def error(self, xp: Namespace, worlds: Worlds) -> Array:
        """Distance of the cube from its goal in x and y [m], shape ``(worlds,)``."""
        pos = worlds.joint_q[:, self._pos]
        x, y = (pos[:, axis] - worlds.goal[:, axis] for axis in range(2))
        return xp.sqrt(x * x + y * y)

    def reward(self, xp: Namespace, worlds: Worlds) -> Array:
        """Behind the cube; from there, the cube near its goal."""
        tcp, pos = worlds.site_q[:, self._tcp], worlds.joint_q[:, self._pos]
        x, y, z = (pos[:, axis] - tcp[:, axis] for axis in range(3))
        x = x - BEHIND
        reach = xp.sqrt(x * x + y * y + z * z)
        error = self.error(xp, worlds)
        staged = 1.0 - xp.tanh(5.0 * reach) + (reach < REACHED) * (1.0 - xp.tanh(5.0 * error))
        return xp.where((error < RADIUS) & (pos[:, 2] < FLAT), 1.0, staged / 3.0)

    def success(self, xp: Namespace, worlds: Worlds) -> Array:
        """On the goal, flat on the ground."""
        return (self.error(xp, worlds) < RADIUS) & (worlds.joint_q[:, self._pos][:, 2] < FLAT)
