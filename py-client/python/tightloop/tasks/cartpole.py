"""A cart that balances a pole, or swings it up first.

| place | observation | range | unit |
|---|---|---|---|
| 0 | position of the cart | ±3 | m |
| 1, 2 | sine and cosine of the pole's angle; 0 is upright | ±1 | – |
| 3 | velocity of the cart | ±20 | m/s |
| 4 | angular velocity of the pole | ±50 | rad/s |

| action | range | what 1 means |
|---|---|---|
| 0 | ±1 | a force of 10 N on the cart (swing-up: 20 N) |

Balance (the rules of Barto, Sutton and Anderson 1983, with a force of any size): reward 1 a step, over when the pole is
0.21 rad (12°) from upright or the cart 2.4 m from the middle. Swing-up: reward (1 + cos θ)/2 · (1 + 1/(1 + θ̇²/25))/2 ·
(1 + 1 - x²/2.4²)/2 · (1 - a²/5), in the manner of dm_control's cartpole (Tassa et al. 2018), never over; a success is a
pole within 0.2 rad of upright that turns slower than 1 rad/s.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

import tightloop as tl
from tightloop.assets import CARTPOLE
from tightloop.env.controls import Control, JointTorque
from tightloop.env.observed import Observed
from tightloop.env.task import Array, Namespace, Task, Worlds
from tightloop.planning.policy_terms import Values

URDF = CARTPOLE
TRACK = 2.4  # [m]


class CartPoleBalance(Task):
    """Keep the pole upright, from a start close to it."""

    max_episode_steps = 500
    force = 10.0  # [N]
    start = 0.05  # position [m] and angle [rad] at the start, at most
    fallen = 0.2095  # [rad]

    def scene(self) -> tl.Scene:
        """A cart on a rail, stepped at 200 Hz and controlled at 50 Hz."""
        scene = tl.Scene(dt=1 / 200, substeps=4)
        scene.add_urdf(URDF, name="cart")
        around = tl.Uniform(-self.start, self.start)
        scene.randomize(joint_q={"cart": around}, joint_qd={"cart": around})
        return scene

    def controls(self) -> Sequence[Control]:
        """A force on the cart."""
        return [JointTorque(["cart/slide"], self.force)]

    def observed(self) -> Sequence[Observed]:
        """The table above."""
        slide, hinge = "cart/slide", "cart/hinge"
        return [
            Observed("position of the cart", -3, 3, unit="m", source=Values("joint_q", of=slide)),
            Observed("sine of the angle", -1, 1, source=Values("joint_q", of=hinge, function="sin")),
            Observed("cosine of the angle", -1, 1, source=Values("joint_q", of=hinge, function="cos")),
            Observed("velocity of the cart", -20, 20, unit="m/s", source=Values("joint_qd", of=slide)),
            Observed("angular velocity of the pole", -50, 50, unit="rad/s", source=Values("joint_qd", of=hinge)),
        ]

    def observe(self, xp: Namespace, worlds: Worlds) -> Sequence[Array]:
        """Position, angle and velocities."""
        x, angle = worlds.joint_q[:, 0], worlds.joint_q[:, 1]
        return x, xp.sin(angle), xp.cos(angle), worlds.joint_qd[:, 0], worlds.joint_qd[:, 1]

    def reward(self, xp: Namespace, worlds: Worlds) -> Array:
        """1 a step."""
        return worlds.joint_q[:, 0] * 0.0 + 1.0

    def terminated(self, xp: Namespace, worlds: Worlds) -> Array:
        """The pole has fallen, or the cart is at the end of the rail."""
        return (abs(worlds.joint_q[:, 1]) > self.fallen) | (abs(worlds.joint_q[:, 0]) > TRACK)


class CartPoleSwingUp(CartPoleBalance):
    """Swing the pole up from below and keep it there."""

    force = 20.0

    def scene(self) -> tl.Scene:
        """The pole starts hanging, turned by up to 0.3 rad."""
        scene = super().scene()
        scene.robots["cart"].joint_q = [0.0, np.pi]
        scene.randomize(joint_q={"cart/hinge": tl.Uniform(-0.3, 0.3)})
        return scene

    def reward(self, xp: Namespace, worlds: Worlds) -> Array:
        """Upright, in the middle, quiet, with little force."""
        x, angle, rate = worlds.joint_q[:, 0], worlds.joint_q[:, 1], worlds.joint_qd[:, 1]
        force = worlds.action[:, 0]
        middle, quiet = 1.0 - (x / TRACK) ** 2, 1.0 / (1.0 + (rate / 5.0) ** 2)
        return 0.25 * (1.0 + xp.cos(angle)) * (1.0 + quiet) * (0.5 + 0.5 * middle) * (1.0 - 0.2 * force * force)

    def terminated(self, xp: Namespace, worlds: Worlds) -> None:
        """It is never over before its time."""
        return None

    def success(self, xp: Namespace, worlds: Worlds) -> Array:
        """The pole stands."""
        return (xp.cos(worlds.joint_q[:, 1]) > np.cos(0.2)) & (abs(worlds.joint_qd[:, 1]) < 1.0)
