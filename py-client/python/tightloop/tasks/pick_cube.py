"""A Franka arm grasps a cube and takes it to a place in the air.

After ManiSkill 3's ``PickCube-v1`` in its control mode ``pd_joint_delta_pos`` (its ranges, rewards, gains and rates), with
this project's arm and quaternions (x, y, z, w). Control at 20 Hz, episodes of 2.5 s, physics at 200 Hz, not 100
(`tightloop.tasks.cube` says why). The base stands at x = -0.615 m, the cube within 0.1 m of the origin, turned anyhow.
A step of the arm is one of its drive targets, not from where the joints are; and the arm's weight is borne by its drives:
it sags by 2 cm.

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

Reward: (1 - tanh 5 d + h + h (1 - tanh 5 e) + p (1 - tanh 5 |q̇|)) / 5, and 1 in a success; d is the distance of the cube
from the tcp [m], e that from its goal, h whether the fingers hold it, p whether e is at most 2.5 cm, q̇ the velocities of
the arm's joints. A success is p with no joint of the arm faster than 0.2 rad/s; an episode goes on after it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

import tightloop as tl
from tightloop.env.controls import Control
from tightloop.env.names import Names
from tightloop.env.task import Array, Namespace, Observed, Task, Worlds
from tightloop.tasks import cube, franka
from tightloop.tasks.geometry import distance, squares

START = [0.0, np.pi / 8, 0.0, -np.pi * 5 / 8, 0.0, np.pi * 3 / 4, np.pi / 4, 0.04, 0.04]  # [rad, m]
BASE = (-0.615, 0.0, 0.0)  # [m]
SPREAD = 0.1  # of cubes and goals in x and y [m]
LOW, HIGH = (-SPREAD, -SPREAD, cube.HALF), (SPREAD, SPREAD, cube.HALF + 0.3)  # of the goals [m]
CLOSE = 0.025  # [m]
STILL = 0.2  # [rad/s]


class FrankaPickCube(Task):
    """Pick a cube. ``control`` is one of `tightloop.tasks.franka.CONTROLS`."""

    fields = ("joint_q", "joint_qd", "site_q", "contact_sensor")
    max_episode_steps = 50
    goal_draws = 3

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
            joint_q=dict.fromkeys(franka.ARM, tl.Normal(0.0, 0.02)),
            body_q={"cube": {"x": around, "y": around, "yaw": tl.Uniform(-np.pi, np.pi)}},
        )
        return scene

    def controls(self) -> Sequence[Control]:
        """The arm and its fingers."""
        return self._arm_controls

    def observed(self) -> Sequence[Observed]:
        """The table above."""
        return [
            *franka.observed(),
            Observed("held", 0, 1),
            Observed("tcp: position", -2, 2, 3, "m"),
            Observed("tcp: orientation", -1, 1, 4),
            Observed("goal", LOW, HIGH, 3, "m"),
            Observed("cube: position", -2, 2, 3, "m"),
            Observed("cube: orientation", -1, 1, 4),
            Observed("from the tcp to the cube", -2, 2, 3, "m"),
            Observed("from the cube to its goal", -2, 2, 3, "m"),
        ]

    def bind(self, names: Names) -> None:
        """Look up tcp, cube and sensors."""
        self._at = cube.Places(names)

    def goal(self, xp: Namespace, worlds: Worlds, draws: Array) -> Array:
        """A place in the box."""
        place = [low + (high - low) * draws[:, axis] for axis, (low, high) in enumerate(zip(LOW, HIGH, strict=True))]
        return xp.stack(place, 1)

    def observe(self, xp: Namespace, worlds: Worlds) -> Sequence[Array]:
        """Joints, grasp, tcp, goal, cube."""
        tcp, block = worlds.site_q[:, self._at.tcp], worlds.joint_q[:, self._at.pose]
        return (
            worlds.joint_q[:, :9],
            worlds.joint_qd[:, :9],
            1.0 * self.held(xp, worlds),
            tcp[:, :3],
            tcp[:, 3:],
            worlds.goal,
            block[:, :3],
            block[:, 3:],
            block[:, :3] - tcp[:, :3],
            worlds.goal - block[:, :3],
        )

    def held(self, xp: Namespace, worlds: Worlds) -> Array:
        """Whether the fingers hold the cube, bool, shape ``(worlds,)``."""
        left, right = (worlds.contact_sensor[:, finger] for finger in self._at.touch)
        return cube.grasped(xp, worlds.site_q[:, self._at.tcp, 3:], left, right)

    def error(self, xp: Namespace, worlds: Worlds) -> Array:
        """Distance of the cube from its goal [m], shape ``(worlds,)``."""
        return distance(xp, worlds.joint_q[:, self._at.pos], worlds.goal)

    def reward(self, xp: Namespace, worlds: Worlds) -> Array:
        """Near the cube, holding it, near the goal, still."""
        held, error = self.held(xp, worlds), self.error(xp, worlds)
        reach = distance(xp, worlds.joint_q[:, self._at.pos], worlds.site_q[:, self._at.tcp, :3])
        speed = xp.sqrt(squares(xp, worlds.joint_qd[:, :7]))
        placed = error <= CLOSE
        staged = (
            (1.0 - xp.tanh(5.0 * reach)) + held * (2.0 - xp.tanh(5.0 * error)) + placed * (1.0 - xp.tanh(5.0 * speed))
        )
        return xp.where(placed & self._still(xp, worlds), 1.0, 0.2 * staged)

    def success(self, xp: Namespace, worlds: Worlds) -> Array:
        """At the goal, and the arm is still."""
        return (self.error(xp, worlds) <= CLOSE) & self._still(xp, worlds)

    def _still(self, xp: Namespace, worlds: Worlds) -> Array:
        return xp.max(abs(worlds.joint_qd[:, :7]), axis=1) <= STILL
