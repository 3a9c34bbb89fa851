"""A cart on a rail swings its pole up from hanging, and keeps it there."""

from __future__ import annotations

import numpy as np

import tightloop as tl
from planning.problem import Array, Problem
from tightloop import assets

# Weights of the residuals: position [1/m], both parts of the angle, velocities [s/m, s/rad]
WEIGHTS = np.array([0.5, 1.0, 1.0, 0.1, 0.1])
# The pole stands within this angle [rad] and below this speed [rad/s]
ANGLE, SPEED = 0.2, 1.0


class CartPole(Problem):
    """The swing-up, by the force of the cart's motor. The hinge has none."""

    command, columns, rest = "joint_f", (0,), np.zeros(2)
    low, high, effort = np.array([-20.0]), np.array([20.0]), 0.02  # [N], [1/N]
    seconds, duration = 0.02, 6.0
    horizon, knot, noise, samples = 40, 4, 6.0, 256

    def scene(self) -> tl.Scene:
        """Return the cart, whose pole hangs."""
        made = tl.Scene(dt=self.seconds / 4, substeps=4)
        made.add_urdf(assets.CARTPOLE, name="cart").joint_q = [0.0, np.pi]
        return made

    def residuals(self, q: Array, qd: Array) -> Array:
        """Return what shall be zero, ``(…, 5)``: all of it is where the pole stands in the middle of the rail."""
        x, angle = q[..., 0], q[..., 1]
        return WEIGHTS * np.stack([x, np.sin(angle), 1 - np.cos(angle), qd[..., 0], qd[..., 1]], axis=-1)

    def cost(self, frame: tl.Frame) -> Array:
        """Return the sum of the squared residuals."""
        return np.square(self.residuals(frame.joint_q, frame.joint_qd)).sum(axis=-1)

    def begin(self, plant: tl.Sim, seed: int) -> None:
        """Let the pole hang, a little aside."""
        plant.reset(joint_q=[0.0, np.pi + np.random.default_rng(seed).uniform(-0.3, 0.3)])
        self._stands: list[bool] = []

    def observe(self, frame: tl.Frame) -> None:
        """Take note of whether the pole stands."""
        angle, speed = frame.joint_q[0, 1], frame.joint_qd[0, 1]
        self._stands.append(bool(np.cos(angle) > np.cos(ANGLE) and abs(speed) < SPEED))

    def judge(self) -> tuple[bool, str]:
        """Return whether the pole stood in the whole last second."""
        if not all(self._stands[-round(1 / self.seconds) :]):
            return False, "does not stand in the last second"
        falls = [frame for frame, stands in enumerate(self._stands) if not stands]
        return True, f"stands from {self.seconds * (falls[-1] + 1 if falls else 0):.1f} s on"
