"""A body that is pulled by the mouse: a spring from where it is held to where the pointer is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.dynamics import Dynamics
from tightloop.errors import CommandRefused
from tightloop.view.poses import Array

# Natural frequency of the spring with the mass that it moves [rad/s]: slow beside frames of 60 a second, so that a
# force that is a frame or two old still damps.
_FREQUENCY = 2 * np.pi * 1.5
# A body moves less than this under a force of 1 N in 1 s only if it is fixed [m/s² per N].
_MOBILITY_LEAST = 1e-6


@dataclass(frozen=True)
class Grip:
    """A spring on a body.

    Attributes:
        world: Its world.
        body: Its place in ``body_names``.
        ends: Where it is held and where to [m], world axes, shape ``(2, 3)``.
        stiffness: Of the spring [N/m].
        damping: Against the body's velocity [N·s/m].
    """

    world: int
    body: int
    ends: NDArray[np.float64]
    stiffness: float
    damping: float

    def force(self, shown: Any) -> NDArray[np.float64]:
        """Force at the body's centre of mass [N], shape ``(3,)``, as it moves now."""
        velocity = np.asarray(shown.body_qd[self.world, self.body, :3], np.float64)
        return self.stiffness * (self.ends[1] - self.ends[0]) - self.damping * velocity

    def towards(self, ends: NDArray[np.float64]) -> Grip:
        """The same spring, held elsewhere."""
        return Grip(self.world, self.body, ends, self.stiffness, self.damping)


def grip(
    dynamics: Dynamics, place: tuple[int, int], ends: NDArray[np.float64], joint_q: Array, strength: float
) -> Grip:
    """A spring that suits what a body moves with it.

    Args:
        dynamics: Of the scene.
        place: The body's world, and its place in ``body_names``.
        ends: Where it is held and where to [m], shape ``(2, 3)``.
        joint_q: Positions of that world, shape ``(coords,)``.
        strength: How much stiffer than that.

    Raises:
        CommandRefused: The body is fixed.
    """
    world, body = place
    jacobian = dynamics.body_jacobian(joint_q)[body, :3]
    # how a force accelerates the body, the mean over directions: J M⁻¹ Jᵀ
    mobility = np.trace(jacobian @ np.linalg.solve(dynamics.mass_matrix(joint_q), jacobian.T)) / 3
    if mobility < _MOBILITY_LEAST:
        raise CommandRefused(f"body `{dynamics.body_names[body]}` is fixed; pull one that moves")
    mass = 1 / mobility
    return Grip(world, body, ends, strength * mass * _FREQUENCY**2, 2 * np.sqrt(strength) * mass * _FREQUENCY)
