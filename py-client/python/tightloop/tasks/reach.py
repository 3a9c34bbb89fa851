"""A Franka arm brings its hand to a pose that changes every four seconds.

After Isaac Lab's ``Isaac-Reach-Franka-v0`` (its ranges, weights and rates), with this project's arm and quaternions
(x, y, z, w). Physics at 60 Hz, control at 30 Hz, episodes of 12 s. Isaac Lab's actions have no bounds; here they end
where all goals are in reach: within ±1, that is 0.5 rad of the start, the hand comes to two thirds of them.

| place | observation | range | unit |
|---|---|---|---|
| 0–8 | joint positions less those of the start | ±6; fingers ±0.1 | rad, m |
| 9–17 | joint velocities | ±10 | rad/s, m/s |
| 18–20 | goal: position of the tcp | x 0.35–0.65, y ±0.2, z 0.15–0.5 | m |
| 21–24 | goal: orientation (x, y, z, w), downwards, turned by any angle about z | ±1 | – |
| 25–31 | last action | ±4 | – |

| action | range | what 1 means |
|---|---|---|
| 0–6 | ±4 | 0.5 rad from the start (``joint_target``); ±1 with the other controls, and what they mean |

Reward: -0.2 |e| + 0.1 (1 - tanh(|e|/0.1)) - 0.1 φ - 1e-4 |a - a'|² - 1e-4 |q̇|², e the distance of the tcp from the
goal [m], φ the angle between the orientations [rad], a' the action before. A success is |e| < 2 cm.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

import tightloop as tl
from tightloop.env.controls import Control
from tightloop.env.names import Names
from tightloop.env.observed import Observed
from tightloop.env.task import Array, Namespace, Task, Worlds
from tightloop.planning.policy_terms import Input, LastAction
from tightloop.tasks import franka
from tightloop.tasks.geometry import angle, distance, in_box, squares

START = [0.0, -0.569, 0.0, -2.81, 0.0, 3.037, 0.741, 0.04, 0.04]  # [rad, m]
LIMIT = 4.0  # of actions: 2 rad from the start
LOW, HIGH = (0.35, -0.2, 0.15), (0.65, 0.2, 0.5)  # of the goals [m]


class FrankaReach(Task):
    """Reach poses. ``control`` is one of `tightloop.tasks.franka.CONTROLS`."""

    fields = ("joint_q", "joint_qd", "site_q")
    max_episode_steps = 360
    goal_radius = 0.02
    goal_draws = 4
    goal_steps = 120

    def __init__(self, control: str = "joint_target") -> None:
        self._control = control
        self._arm_controls = franka.controls(control, scale=0.5 if control == "joint_target" else 0.1, limit=LIMIT)
        (self._arm_control,) = self._arm_controls

    def scene(self) -> tl.Scene:
        """The arm alone; it starts within a quarter of a radian of the same place."""
        scene = tl.Scene(dt=1 / 60, substeps=2)
        franka.add_arm(scene, START, driven=self._control != "torque")
        scene.randomize(joint_q=dict.fromkeys(franka.ARM, tl.Uniform(-0.25, 0.25)))
        return scene

    def controls(self) -> Sequence[Control]:
        """Seven joints, or the hand."""
        return self._arm_controls

    def observed(self) -> Sequence[Observed]:
        """The table above."""
        limit = self._arm_control.limit
        return [
            *franka.joints_observed(START),
            Observed("goal: position", LOW, HIGH, 3, "m", source=Input("goal: position", 3)),
            Observed("goal: orientation", -1, 1, 4, source=Input("goal: orientation", 4)),
            Observed("last action", -limit, limit, self._arm_control.size, source=LastAction()),
        ]

    def bind(self, names: Names) -> None:
        """Look up the tcp."""
        self._tcp = names.site(franka.TCP)
        self._start = np.array(START, np.float32)

    def goal(self, xp: Namespace, worlds: Worlds, draws: Array) -> Array:
        """Position in the box, and the hand's z axis downwards: half a turn about x, then a turn about z."""
        place = in_box(draws, LOW, HIGH)
        yaw = np.pi * (2.0 * draws[:, 3] - 1.0)
        zero = 0.0 * yaw
        return xp.stack([*place, xp.cos(0.5 * yaw), xp.sin(0.5 * yaw), zero, zero], 1)

    def observe(self, xp: Namespace, worlds: Worlds) -> Sequence[Array]:
        """Joints, goal, last action."""
        turned = worlds.joint_q - xp.asarray(self._start)
        return turned, worlds.joint_qd, worlds.goal[:, :3], worlds.goal[:, 3:], worlds.action

    def error(self, xp: Namespace, worlds: Worlds) -> Array:
        """Distance of the tcp from the goal [m], shape ``(worlds,)``."""
        return distance(xp, worlds.site_q[:, self._tcp, :3], worlds.goal[:, :3])

    def reward(self, xp: Namespace, worlds: Worlds) -> Array:
        """Near, turned as asked, smooth."""
        error = self.error(xp, worlds)
        turn = angle(xp, worlds.site_q[:, self._tcp, 3:], worlds.goal[:, 3:])
        effort = squares(xp, worlds.action - worlds.previous_action) + squares(xp, worlds.joint_qd)
        return -0.2 * error + 0.1 * (1.0 - xp.tanh(error / 0.1)) - 0.1 * turn - 1e-4 * effort

    def metrics(self, xp: Namespace, worlds: Worlds) -> Mapping[str, Array]:
        """``error``, the distance from the goal [m]."""
        return {"error": self.error(xp, worlds)}

    def success(self, xp: Namespace, worlds: Worlds) -> Array:
        """Within 2 cm."""
        return self.error(xp, worlds) < 0.02
