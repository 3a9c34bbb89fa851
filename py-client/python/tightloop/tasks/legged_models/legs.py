"""Finds which joints of a robot are its legs, and which joints of the left side are those of the right."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tightloop.env.mirror import Flip
from tightloop.tasks.legged_models.skeleton import Array, Skeleton

#: Random poses of a chain whose deepest is how far it reaches [–].
_SAMPLES = 1024
#: Joints whose farthest point is nearer than this share of the largest such distance are small, as fingers are [–].
_SMALL = 0.25
#: Legs end at most this share of their reach above the deepest one [–].
_LEVEL = 0.3


@dataclass(frozen=True)
class Leg:
    """A leg.

    Attributes:
        joints: Its joints, from the base outwards.
        hip: Place of the first one at the neutral pose, in the base's frame [m].
        foot: The body that its last joint moves first.
        reach: How far its lowest point is below the hip at most [m].
        deepest: Pose of the robot there [rad], shape ``(joints,)``.
    """

    joints: tuple[int, ...]
    hip: Array
    foot: int
    reach: float
    deepest: Array


def small_joints(skeleton: Skeleton) -> set[int]:
    """Return fingers and the like: two or more small joints side by side at the end of a limb, and what they carry."""
    extents = _extents(skeleton)
    limit = _SMALL * max(extents, default=0.0)
    children: dict[int | None, list[int]] = {}
    for joint in range(len(skeleton.joints)):
        children.setdefault(_parent(skeleton, joint), []).append(joint)
    found: set[int] = set()
    for parent, own in children.items():
        if parent is not None and len(own) > 1 and all(extents[joint] < limit for joint in own):
            found |= {joint for child in own for joint in range(len(extents)) if _carries(skeleton, child, joint)}
    return found


def wheels(skeleton: Skeleton) -> set[int]:
    """Return joints without limits at the ends of chains, whose shapes turn about their own middle."""
    places, turns = skeleton.frames(skeleton.neutral[None])
    axes, found = skeleton.axes(skeleton.neutral), set()
    for joint, hinge in enumerate(skeleton.joints):
        is_last = not any(_carries(skeleton, joint, other) for other in range(len(skeleton.joints)) if other != joint)
        own = [solid for solid in skeleton.solids if skeleton.moves[joint, solid.body]]
        if not (is_last and own and np.isinf(hinge.high)):
            continue
        points = np.concatenate([skeleton.points(solid, (places, turns))[0] for solid in own])
        arm = points - places[0, skeleton.body_of(joint)]
        across = arm - np.outer(arm @ axes[joint], axes[joint])
        radius = max([float(np.linalg.norm(across, axis=1).max()), *(solid.radius for solid in own)])
        if np.linalg.norm(across.max(0) + across.min(0)) / 2 < 0.1 * radius:
            found.add(joint)
    return found


def find(skeleton: Skeleton, left_out: set[int]) -> list[Leg]:
    """Return the legs: chains of two or more joints whose ends are below their beginning, and are the deepest.

    Args:
        skeleton: The robot.
        left_out: Joints that belong to no leg.
    """
    joints = [joint for joint in range(len(skeleton.joints)) if joint not in left_out]
    ends = [
        joint for joint in joints if not any(_carries(skeleton, joint, other) for other in joints if other != joint)
    ]
    chains = [[other for other in joints if _carries(skeleton, other, end)] for end in ends]
    legs, depths = [], []
    for chain in chains:
        # the trunk's joints carry other chains too
        own = [joint for joint in chain if sum(joint in other for other in chains) == 1]
        if len(own) < 2:
            continue
        found = _leg(skeleton, own)
        if found is not None:
            legs.append(found[0])
            depths.append(found[1])
    if not legs:
        return []
    ground = min(depths)
    return [leg for leg, depth in zip(legs, depths, strict=True) if depth - ground < _LEVEL * leg.reach]


def alike(legs: Sequence[Leg], count: int) -> list[Leg]:
    """Return ``count`` legs that have as many joints each and reach as far, if there are more legs than that."""
    for leg in legs if len(legs) > count else ():
        own = [
            other
            for other in legs
            if len(other.joints) == len(leg.joints) and abs(other.reach - leg.reach) < 0.2 * leg.reach
        ]
        if len(own) == count:
            return own
    return list(legs)


def mirror(skeleton: Skeleton, joints: Sequence[int]) -> Flip | None:
    """Return which of these joints is which in the mirror image, and its sign; None if that is not clear.

    At the pose of the file, a joint at (x, y, z) with the axis (a, b, c) has its twin at (x, -y, z) with the axis
    ±(-a, b, -c): rotations are axial.
    """
    places, _ = skeleton.frames(skeleton.zero[None])
    origins = np.array([places[0, skeleton.body_of(joint)] for joint in joints])
    axes = skeleton.axes(skeleton.zero)[list(joints)]
    tolerance = 0.02 * float(np.ptp(origins, axis=0).max())
    order, signs = [], []
    for origin, axis in zip(origins, axes, strict=True):
        near = np.linalg.norm(origins - origin * [1, -1, 1], axis=1) < tolerance
        along = axes @ (axis * [-1, 1, -1])
        twins = np.flatnonzero(near & (np.abs(along) > 0.99))
        if len(twins) != 1:
            return None
        order.append(int(twins[0]))
        signs.append(float(np.sign(along[twins[0]])))
    twice = all(order[twin] == place and signs[twin] == signs[place] for place, twin in enumerate(order))
    return (order, signs) if twice else None


def _leg(skeleton: Skeleton, own: list[int]) -> tuple[Leg, float] | None:
    """A chain as a leg, and the height of its deepest point; None if its end is not below its beginning."""
    rng = np.random.default_rng(0)
    poses = np.tile(skeleton.neutral, (_SAMPLES, 1))
    poses[1:, own] = rng.uniform(skeleton.low[own], skeleton.high[own], (_SAMPLES - 1, len(own)))
    frames = skeleton.frames(poses)
    hip = frames[0][0, skeleton.body_of(own[0])]
    heights = skeleton.lowest(skeleton.moves[own[-1]], frames)
    deepest = int(np.argmin(heights))
    reach = hip[2] - heights[deepest]
    middle = np.tile(0.5 * (skeleton.low + skeleton.high), (1, 1))
    at_middle = skeleton.lowest(skeleton.moves[own[-1]], skeleton.frames(middle))[0]
    hangs = min(heights[0], at_middle) < hip[2] - 0.2 * reach
    if not np.isfinite(reach) or reach <= 0.0 or not hangs:
        return None
    foot = skeleton.body_of(own[-1])
    return Leg(tuple(own), hip, foot, float(reach), poses[deepest]), float(heights[deepest])


def _carries(skeleton: Skeleton, joint: int, other: int) -> bool:
    """Whether a joint moves another one; each moves itself."""
    return joint <= other and bool((skeleton.moves[joint] | ~skeleton.moves[other]).all())


def _parent(skeleton: Skeleton, joint: int) -> int | None:
    """The last joint that moves a joint."""
    above = [other for other in range(joint) if _carries(skeleton, other, joint)]
    return above[-1] if above else None


def _extents(skeleton: Skeleton) -> list[float]:
    """Distance of the farthest point that each joint moves from it [m]."""
    frames = skeleton.frames(skeleton.neutral[None])
    places = frames[0][0]
    found = []
    for joint, moved in enumerate(skeleton.moves):
        origin = places[skeleton.body_of(joint)]
        points = [places[moved], *(skeleton.points(s, frames)[0] for s in skeleton.solids if moved[s.body])]
        found.append(float(np.linalg.norm(np.concatenate(points) - origin, axis=1).max()))
    return found


def of_bodies(skeleton: Skeleton, legs: Sequence[Leg]) -> NDArray[np.bool_]:
    """Return which bodies belong to no leg, shape ``(bodies,)``."""
    return ~np.any([skeleton.moves[leg.joints[0]] for leg in legs], axis=0)
