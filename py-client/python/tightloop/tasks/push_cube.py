"""A Franka arm pushes a cube along the ground, 0.2 m away from itself.

After ManiSkill 3's ``PushCube-v1`` in its control mode ``pd_joint_delta_pos`` (its ranges, rewards, gains and rates), with
this project's arm and quaternions (x, y, z, w). Control at 20 Hz, episodes of 2.5 s, physics at 200 Hz, not 100
(`tightloop.tasks.cube` says why). Base, start and drives are those of `tightloop.tasks.pick_cube`; the cube stands within
0.1 m of the origin, its sides along the axes.

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

Reward: (1 - tanh 5 d + r (1 - tanh 5 e)) / 3, and 1 in a success; d is the distance of the tcp from a place 5 mm behind the
cube [m], r whether that is less than 1 cm, e the distance of the cube from its goal in x and y. A success is e < 0.1 m,
with the cube's centre lower than 2.5 cm; an episode goes on after it.
"""

from __future__ import annotations

from collections.abc import Sequence

import tightloop as tl
from tightloop.env.controls import Control
from tightloop.env.names import Names
from tightloop.env.task import Array, Namespace, Observed, Task, Worlds
from tightloop.tasks import cube, franka
from tightloop.tasks.pick_cube import BASE, SPREAD, START

AHEAD = 0.2  # of the goal before the cube [m]
GOAL_Z = 0.001  # [m]
RADIUS = 0.1  # of the goal [m]
BEHIND = cube.HALF + 0.005  # of the place to push from [m]
REACHED = 0.01  # [m]
FLAT = cube.HALF + 0.005  # [m]


class FrankaPushCube(Task):
    """Push a cube. ``control`` is one of `tightloop.tasks.franka.CONTROLS`."""

    fields = ("joint_q", "joint_qd", "site_q")
    max_episode_steps = 50

    def __init__(self, control: str = "joint_delta") -> None:
        self._control = control
        self._arm_controls = franka.controls(
            control, scale=0.5 if control == "joint_target" else 0.1, gripper=franka.gripper()
        )

    def scene(self) -> tl.Scene:
        """Arm and cube on the ground; the arm starts close to its pose, the cube anywhere in a square."""
        scene, _ = cube.scene(substeps=10, start=START, driven=self._control != "torque", base=BASE, cube=(0.0, 0.0))
        around = tl.Uniform(-SPREAD, SPREAD)
        scene.randomize(
            joint_q=dict.fromkeys(franka.ARM, tl.Normal(0.0, 0.02)), body_q={"cube": {"x": around, "y": around}}
        )
        return scene

    def controls(self) -> Sequence[Control]:
        """The arm and its fingers."""
        return self._arm_controls

    def observed(self) -> Sequence[Observed]:
        """The table above."""
        return [
            *franka.observed(),
            Observed("tcp: position", -2, 2, 3, "m"),
            Observed("tcp: orientation", -1, 1, 4),
            Observed("goal", (AHEAD - SPREAD, -SPREAD, 0.0), (AHEAD + SPREAD, SPREAD, GOAL_Z), 3, "m"),
            Observed("cube: position", -2, 2, 3, "m"),
            Observed("cube: orientation", -1, 1, 4),
        ]

    def bind(self, names: Names) -> None:
        """Look up tcp and cube."""
        self._at = cube.Places(names)

    def goal(self, xp: Namespace, worlds: Worlds, draws: Array) -> Array:
        """Ahead of where the cube starts."""
        x, y = (worlds.joint_q[:, self._at.pos.start + axis] for axis in range(2))
        return xp.stack([x + AHEAD, y, 0.0 * x + GOAL_Z], 1)

    def observe(self, xp: Namespace, worlds: Worlds) -> Sequence[Array]:
        """Joints, tcp, goal, cube."""
        tcp, block = worlds.site_q[:, self._at.tcp], worlds.joint_q[:, self._at.pose]
        return (
            worlds.joint_q[:, :9],
            worlds.joint_qd[:, :9],
            tcp[:, :3],
            tcp[:, 3:],
            worlds.goal,
            block[:, :3],
            block[:, 3:],
        )

    def error(self, xp: Namespace, worlds: Worlds) -> Array:
        """Distance of the cube from its goal in x and y [m], shape ``(worlds,)``."""
        block = worlds.joint_q[:, self._at.pos]
        x, y = (block[:, axis] - worlds.goal[:, axis] for axis in range(2))
        return xp.sqrt(x * x + y * y)

    def reward(self, xp: Namespace, worlds: Worlds) -> Array:
        """Behind the cube; from there, the cube near its goal."""
        tcp, block = worlds.site_q[:, self._at.tcp], worlds.joint_q[:, self._at.pos]
        x = block[:, 0] - BEHIND - tcp[:, 0]
        y, z = (block[:, axis] - tcp[:, axis] for axis in (1, 2))
        reach = xp.sqrt(x * x + y * y + z * z)
        error = self.error(xp, worlds)
        staged = (1.0 - xp.tanh(5.0 * reach)) + (reach < REACHED) * (1.0 - xp.tanh(5.0 * error))
        return xp.where(self._there(error, block), 1.0, staged / 3.0)

    def success(self, xp: Namespace, worlds: Worlds) -> Array:
        """On the goal, flat on the ground."""
        return self._there(self.error(xp, worlds), worlds.joint_q[:, self._at.pos])

    def _there(self, error: Array, block: Array) -> Array:
        return (error < RADIUS) & (block[:, 2] < FLAT)
