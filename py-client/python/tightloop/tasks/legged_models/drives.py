"""Gains of a robot's drives, from its mass, the length of its legs and what each joint moves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tightloop.tasks.legged_models.legs import Leg
from tightloop.tasks.legged_models.pose import Sole, place_of
from tightloop.tasks.legged_models.skeleton import Array, Skeleton

GRAVITY = 9.81  # [m/s²]
#: Stiffness in shares of the robot's weight times the reach of its legs, N·m/rad per N·m. The robots of tightloop have
#: about these: 40 N·m/rad at 14.7 kg and 0.45 m, and those of the humanoid at 35 kg and 0.7 m.
QUADRUPED = 0.63
HIP, KNEE, ANKLE, TRUNK, ARM = 0.40, 0.60, 0.16, 0.48, 0.16
#: A drive turns a joint by at least this with its largest torque, so a stiffer one would only saturate [rad].
TURN_MIN = 0.25
#: Torques below this share of the weight times the reach are no real limits: such a drive could not hold its own leg.
EFFORT_MIN = 0.02
#: Damping in multiples of √(stiffness · armature).
DAMPED, DAMPED_HUMANOID = 1.6, 2.3
#: A held joint swings with this frequency [rad/s].
HELD_RATE = 20.0


@dataclass(frozen=True)
class Drive:
    """A drive.

    Attributes:
        stiffness: Its stiffness [N·m/rad].
        damping: Its damping, without that of the joint [N·m·s/rad].
        armature: Inertia of its rotor [kg·m²].
    """

    stiffness: float
    damping: float
    armature: float


def scale_of(skeleton: Skeleton, legs: Sequence[Leg]) -> float:
    """Return the robot's weight times the reach of its legs [N·m]."""
    return skeleton.mass * GRAVITY * float(np.mean([leg.reach for leg in legs]))


def unlimited(skeleton: Skeleton, legs: Sequence[Leg]) -> set[int]:
    """Return the joints whose torque limit is no real one."""
    least = EFFORT_MIN * scale_of(skeleton, legs)
    in_legs = {joint for leg in legs for joint in leg.joints}
    return {
        j for j, hinge in enumerate(skeleton.joints) if hinge.effort <= 0.0 or (j in in_legs and hinge.effort < least)
    }


def drives(skeleton: Skeleton, legs: Sequence[Leg], action: Sequence[int], q: Array) -> list[Drive]:
    """Return the drive of each joint: of those of the action by its place, of the others to hold them.

    Args:
        skeleton: The robot.
        legs: Its legs.
        action: Joints of the action.
        q: The pose in which it stands [rad], shape ``(joints,)``.
    """
    scale, free, inertias = scale_of(skeleton, legs), unlimited(skeleton, legs), skeleton.inertias(q)
    two = len(legs) == 2
    keeps = all(skeleton.joints[joint].gains for joint in action)
    found = []
    for joint, hinge in enumerate(skeleton.joints):
        if hinge.gains is not None and (keeps or joint not in action):
            found.append(Drive(*hinge.gains, hinge.armature))
            continue
        least = inertias[joint] * HELD_RATE**2
        stiffness = _share(skeleton, legs, joint, q) * scale if joint in action else least + 0.02 * scale
        if joint not in free:
            stiffness = min(stiffness, hinge.effort / TURN_MIN)
        armature = hinge.armature or 0.01 * float(np.sqrt(stiffness / 40.0))
        damping = (DAMPED_HUMANOID if two else DAMPED) * float(np.sqrt(stiffness * armature))
        if joint not in action:
            damping += 1.4 * float(np.sqrt(stiffness * inertias[joint]))
        found.append(Drive(stiffness, max(damping - hinge.damping, 0.1 * damping), armature))
    return found


def _share(skeleton: Skeleton, legs: Sequence[Leg], joint: int, q: Array) -> float:
    """Stiffness of a joint in shares of the robot's weight times the reach of its legs."""
    if len(legs) != 2:
        return QUADRUPED
    places, _ = skeleton.frames(q[None])
    own = next((leg for leg in legs if joint in leg.joints), None)
    if own is None:
        carried = skeleton.moves[joint]
        is_trunk = any(joint < leg.joints[0] and carried[leg.foot] for leg in legs) or carried.mean() > 0.25
        return TRUNK if is_trunk else ARM
    hip, foot = (places[0, skeleton.body_of(end), 2] for end in (own.joints[0], own.joints[-1]))
    share = (hip - places[0, skeleton.body_of(joint), 2]) / max(hip - foot, 1e-6)
    return HIP if share < 0.3 else KNEE if share < 0.85 else ANKLE


def standing_torques(skeleton: Skeleton, soles: Sequence[Sole], q: Array) -> Array:
    """Return the torques of all joints that hold the robot at a pose against gravity [N·m], shape ``(joints,)``.

    Feet bear the weight as evenly as its centre allows. Torques are those of gravity less those of the feet's forces.
    """
    places = np.array([place_of(skeleton, foot, skeleton.frames(q[None]))[0] for foot in soles])
    level = np.stack([np.ones(len(soles)), places[:, 0], places[:, 1]])
    forces = np.linalg.pinv(level) @ (skeleton.mass * GRAVITY * np.array([1.0, *skeleton.center(q)[:2]]))
    step = 1e-5
    moved = skeleton.frames(q + step * np.eye(len(q)))
    torques = skeleton.gravity(q)
    for foot, place, force in zip(soles, places, np.maximum(forces, 0.0), strict=True):
        torques = torques - force * (place_of(skeleton, foot, moved)[:, 2] - place[2]) / step
    return torques


def targets(
    skeleton: Skeleton, soles: Sequence[Sole], action: Sequence[int], q: Array, stiffness: Sequence[float]
) -> Array:
    """Return targets with which drives hold the robot at its pose against gravity [rad], shape ``(actions,)``."""
    torques = standing_torques(skeleton, soles, q)
    effort = np.array([skeleton.joints[joint].effort for joint in action])
    own = np.clip(torques[list(action)], -effort, effort) / np.maximum(stiffness, 1e-9)
    return np.clip(q[list(action)] + own, skeleton.low[list(action)], skeleton.high[list(action)])
