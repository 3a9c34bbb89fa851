"""How much of their effort limits the joints of a robot need to stand."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tightloop.checks import advice
from tightloop.tasks.legged_models.drives import standing_torques, unlimited
from tightloop.tasks.legged_models.legs import Leg
from tightloop.tasks.legged_models.pose import sole
from tightloop.tasks.legged_models.skeleton import Array, Skeleton

#: A robot that needs this share of a joint's effort limit to stand has too little left to walk [–].
_HEAVY = 0.5


def loads(skeleton: Skeleton, legs: Sequence[Leg], q: Array) -> Array:
    """Return the share of each joint's effort limit that standing takes [–], shape ``(joints,)``.

    Joints outside of the legs, and those without a real limit, have 0.

    Args:
        skeleton: The robot.
        legs: Its legs.
        q: The pose in which it stands [rad], shape ``(joints,)``.
    """
    torques = standing_torques(skeleton, [sole(skeleton, leg, q) for leg in legs], q)
    limited = {joint for leg in legs for joint in leg.joints} - unlimited(skeleton, legs)
    shares = [abs(torques[j]) / hinge.effort if j in limited else 0.0 for j, hinge in enumerate(skeleton.joints)]
    return np.array(shares)


def warn_of_load(what: str, skeleton: Skeleton, legs: Sequence[Leg], q: Array) -> None:
    """Warn of a pose in which a joint needs half of its effort limit or more.

    Args:
        what: What the robot is called in messages.
        skeleton: The robot.
        legs: Its legs.
        q: The pose in which it stands [rad], shape ``(joints,)``.
    """
    shares = loads(skeleton, legs, q)
    worst = int(np.argmax(shares))
    if shares[worst] < _HEAVY:
        return
    hinge = skeleton.joints[worst]
    advice.warn(
        f"{what}: standing takes {shares[worst] * hinge.effort:.3g} N·m of {hinge.name!r}, whose effort limit is "
        f"{hinge.effort:.3g} N·m, so little is left to walk with; check mass and effort limits in the file, or give "
        "straighter legs by standing="
    )
