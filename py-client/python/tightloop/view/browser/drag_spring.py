"""The force of a mouse drag: a spring from the grabbed point of a body to the pointer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.errors import CommandRefused
from tightloop.planning.dynamics import Dynamics
from tightloop.view.poses import Array

# Natural frequency of the spring with the mass that it moves [rad/s]. It is low for 60 frames per second, so that a
# force that is one or two frames old still damps.
_FREQUENCY = 2 * np.pi * 1.5
# A body moves less than this under a force of 1 N in 1 s only if it is fixed [m/s² per N].
_MOBILITY_LEAST = 1e-6


@dataclass(frozen=True)
class DragSpring:
    """A damped spring that pulls a body.

    Attributes:
        world: World of the body.
        body: Index of the body in ``body_names``.
        ends: The grabbed point and the pointer [m], world axes, shape ``(2, 3)``.
        stiffness: Stiffness of the spring [N/m].
        damping: Damping of the body's velocity [N·s/m].
    """

    world: int
    body: int
    ends: NDArray[np.float64]
    stiffness: float
    damping: float

    def force(self, shown: Any) -> NDArray[np.float64]:
        """Return the force at the body's centre of mass [N], shape ``(3,)``, at its current velocity."""
        velocity = np.asarray(shown.body_qd[self.world, self.body, :3], np.float64)
        return self.stiffness * (self.ends[1] - self.ends[0]) - self.damping * velocity

    def towards(self, ends: NDArray[np.float64]) -> DragSpring:
        """Return the same spring between other points."""
        return DragSpring(self.world, self.body, ends, self.stiffness, self.damping)


def drag_spring(
    dynamics: Dynamics, place: tuple[int, int], ends: NDArray[np.float64], joint_q: Array, strength: float
) -> DragSpring:
    """Make a spring whose stiffness suits the mass that moves with a body.

    Args:
        dynamics: Dynamics of the scene.
        place: World of the body, and its index in ``body_names``.
        ends: The grabbed point and the pointer [m], shape ``(2, 3)``.
        joint_q: Joint positions of that world, shape ``(coords,)``.
        strength: Factor on the stiffness [–].

    Raises:
        CommandRefused: The body is fixed.
    """
    world, body = place
    jacobian = dynamics.body_jacobian(joint_q)[body, :3]
    # mobility: acceleration per force, mean over directions, of J M⁻¹ Jᵀ
    mobility = np.trace(jacobian @ np.linalg.solve(dynamics.mass_matrix(joint_q), jacobian.T)) / 3
    if mobility < _MOBILITY_LEAST:
        raise CommandRefused(f"body `{dynamics.body_names[body]}` is fixed; pull one that moves")
    mass = 1 / mobility
    return DragSpring(world, body, ends, strength * mass * _FREQUENCY**2, 2 * np.sqrt(strength) * mass * _FREQUENCY)
