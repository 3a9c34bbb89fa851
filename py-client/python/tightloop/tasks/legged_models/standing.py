"""Chooses the pose in which a robot stands: one that its file keeps, or one that is searched for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from tightloop.env.mirror import Flip
from tightloop.tasks.legged_models.legs import Leg
from tightloop.tasks.legged_models.pose import Aim, Sole, mirrored, place_of, sole, solve, stands
from tightloop.tasks.legged_models.skeleton import Array, Skeleton

#: Heights of a quadruped's hips in shares of the legs' reach, the first of which that keeps its belly off the ground.
_HEIGHTS = (0.8, 0.87, 0.94)
#: Distance from hip to ankle of a humanoid, in shares of the greatest.
_BENT = 0.955
#: A foot may miss its place by this share of the reach, before another bend of the knees is tried.
_MISS = 0.04
#: Knees behind the line from hip to foot, else ahead of it.
_SIDES = (-1.0, 1.0)
#: A leg whose first joint is more upright than this moves its foot around its hip.
_UPRIGHT = 0.7


def standing_pose(
    skeleton: Skeleton, legs: Sequence[Leg], action: Sequence[int], flip: Flip | None, given: Mapping[int, float]
) -> Array:
    """Return the positions of all hinge joints when a robot stands [rad], shape ``(joints,)``.

    Args:
        skeleton: The robot.
        legs: Its legs.
        action: The joints that ``flip`` is about.
        flip: Left and right exchanged, if known.
        given: Positions that the user chose, by joint.
    """
    q = skeleton.neutral.copy()
    names = [hinge.name for hinge in skeleton.joints]
    for pose in skeleton.source.poses:
        kept = q.copy()
        for name, value in pose.items():
            if name in names:
                kept[names.index(name)] = value
        if stands(skeleton, legs, kept):
            return _with(kept, given)
    q = _with(q, given)
    if all(joint in given for leg in legs for joint in leg.joints):
        return q
    left = None if flip is None or given else [leg for leg in legs if leg.hip[1] >= 0]
    solved = legs if left is None or 2 * len(left) != len(legs) else left
    find = _humanoid if len(legs) == 2 else _quadruped
    q = find(skeleton, legs, solved, q)
    if solved is left and flip is not None:
        q = mirrored(skeleton, action, flip, legs, q)
    return _with(q, given)


def _with(q: Array, given: Mapping[int, float]) -> Array:
    found = q.copy()
    for joint, value in given.items():
        found[joint] = value
    return found


def _quadruped(skeleton: Skeleton, legs: Sequence[Leg], solved: Sequence[Leg], q: Array) -> Array:
    """Feet below the hips, sideways where the neutral pose has them; knees behind, if the limits allow."""
    frames, axes = skeleton.frames(skeleton.neutral[None]), skeleton.axes(skeleton.neutral)
    trunk = ~np.any([skeleton.moves[leg.joints[0]] for leg in legs], axis=0)
    soles = [sole(skeleton, leg, leg.deepest) for leg in solved]
    found = q
    for height in _HEIGHTS:
        ground = max(leg.hip[2] - height * leg.reach for leg in legs)
        aims = []
        for leg, foot in zip(solved, soles, strict=True):
            neutral = place_of(skeleton, foot, frames)[0]
            is_around = abs(axes[leg.joints[0], 2]) > _UPRIGHT
            x = neutral[0] if is_around else leg.hip[0]
            aims.append((np.array([x, neutral[1], ground + foot.radius]), is_around))
        found = _bent(skeleton, solved, soles, aims, q)
        if skeleton.lowest(trunk, skeleton.frames(found[None]))[0] > ground + 0.05 * legs[0].reach:
            break
    return found


def _bent(
    skeleton: Skeleton,
    legs: Sequence[Leg],
    soles: Sequence[Sole],
    aims: Sequence[tuple[Array, bool]],
    q: Array,
) -> Array:
    """Knees of all legs on one side if their limits allow it, else each as it can."""
    tries = []
    for side in _SIDES:
        own = [
            solve(skeleton, leg, foot, Aim(place, None, side, radial), q)
            for leg, foot, (place, radial) in zip(legs, soles, aims, strict=True)
        ]
        tries.append(own)
        if all(miss < _MISS * leg.reach for leg, (_, miss) in zip(legs, own, strict=True)):
            break
    else:
        tries = [[min(of_leg, key=lambda tried: tried[1]) for of_leg in zip(*tries, strict=True)]]
    found = q.copy()
    for leg, (joints, _) in zip(legs, tries[-1], strict=True):
        found[list(leg.joints)] = joints
    return found


def _humanoid(skeleton: Skeleton, legs: Sequence[Leg], solved: Sequence[Leg], q: Array) -> Array:
    """Feet level as in the file's own pose, knees slightly bent and ahead, the centre of mass above the soles."""
    frames = skeleton.frames(skeleton.zero[None])
    straight = [skeleton.frames(leg.deepest[None])[0][0, leg.foot] for leg in legs]
    soles = [sole(skeleton, leg, skeleton.zero) for leg in solved]
    grounds = []
    for leg, end in zip(legs, straight, strict=True):
        foot = frames[0][0, leg.foot]
        longest = max(float(np.linalg.norm(place - leg.hip)) for place in (foot, end))
        lowest = float(skeleton.lowest(skeleton.moves[leg.joints[-1]], frames)[0])
        grounds.append(leg.hip[2] - _BENT * longest - (foot[2] - lowest))
    ground, found = max(grounds), q
    ahead = None
    for _ in range(3):
        found = found.copy()
        for leg, foot in zip(solved, soles, strict=True):
            place = place_of(skeleton, foot, frames)[0]
            x = place[0] if ahead is None else ahead
            aim = Aim(np.array([x, place[1], ground + foot.radius]), frames[1][0, foot.body], 1.0)
            found[list(leg.joints)] = solve(skeleton, leg, foot, aim, found)[0]
        ahead = float(skeleton.center(found)[0])
    return found
