"""Chooses the pose in which a robot stands: one that its file keeps, or one that is searched for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from tightloop.env.mirror import Flip
from tightloop.errors import ArgumentError
from tightloop.tasks.legged_models.legs import Leg
from tightloop.tasks.legged_models.load import loads
from tightloop.tasks.legged_models.options import by_name
from tightloop.tasks.legged_models.pose import Aim, Sole, knee_of, mirrored, place_of, sole, solve, stands
from tightloop.tasks.legged_models.skeleton import Array, Skeleton

#: Heights of a quadruped's hips in shares of the legs' reach, the first of which that keeps its belly off the ground.
_HEIGHTS = (0.8, 0.87, 0.94)
#: Distance from hip to ankle of a humanoid, in shares of the greatest.
_BENT = 0.955
#: A foot may miss its place by this share of the reach, before another bend of the knees is tried.
_MISS = 0.04
#: Feet are level if their heights differ by at most this share of the reach.
_EVEN = 0.05
#: Weight of the height of feet whose common height is not chosen yet [–].
_ANY_HEIGHT = 0.3
#: Distance from a joint's limits at which its target, within these, can still hold it [rad].
_MARGIN = 0.15
#: Positions that a user gives may be rounded so much beyond a limit [rad].
_ROUNDED = 1e-3
#: Sides of the knees of front and hind legs, as people build them: -1 behind the line from hip to foot, 1 ahead of it.
_SIDES = ((-1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (1.0, -1.0))
#: Knees bend another way if that takes at most this share of the largest load [–].
_EASIER = 0.85
#: A leg whose first joint is more upright than this moves its foot around its hip.
_UPRIGHT = 0.7


def standing_pose(skeleton: Skeleton, legs: Sequence[Leg], action: Sequence[int], flip: Flip | None) -> Array:
    """Return the positions of all hinge joints when a robot stands [rad], shape ``(joints,)``.

    Args:
        skeleton: The robot.
        legs: Its legs.
        action: The joints that ``flip`` is about.
        flip: Left and right exchanged, if known.
    """
    q = skeleton.neutral.copy()
    names = [hinge.name for hinge in skeleton.joints]
    for pose in skeleton.source.poses:
        kept = q.copy()
        for name, value in pose.items():
            if name in names:
                kept[names.index(name)] = value
        if stands(skeleton, legs, kept):
            return kept
    left = None if flip is None else [leg for leg in legs if leg.hip[1] >= 0]
    solved = legs if left is None or 2 * len(left) != len(legs) else left

    def whole(found: Array) -> Array:
        return mirrored(skeleton, action, flip, legs, found) if solved is left and flip is not None else found

    if len(legs) == 2:
        return whole(_humanoid(skeleton, legs, solved, q))
    poses = [whole(found) for found in _quadruped(skeleton, legs, solved, q)]
    worst = [float(loads(skeleton, legs, pose).max()) for pose in poses]
    easiest = int(np.argmin(worst))
    return poses[easiest] if worst[easiest] < _EASIER * worst[0] else poses[0]


def with_given(
    what: str, skeleton: Skeleton, legs: Sequence[Leg], q: Array, standing: Mapping[str, float] | None
) -> Array:
    """Return a pose with the joints that the user gives; the others keep the feet in place, at one height.

    Args:
        what: What the pose is called in messages.
        skeleton: The robot.
        legs: Its legs.
        q: How it stands without [rad], shape ``(joints,)``.
        standing: Positions of joints [rad], by name or pattern.

    Raises:
        ArgumentError: A position is beyond its joint's limits, or the feet do not reach the ground together.
    """
    names = [hinge.name for hinge in skeleton.joints]
    given = {names.index(name): value for name, value in by_name(what, standing, names).items()}
    found = q.copy()
    for joint, value in given.items():
        hinge = skeleton.joints[joint]
        if not hinge.low - _ROUNDED <= value <= hinge.high + _ROUNDED:
            raise ArgumentError(
                f"{what} of {hinge.name!r} is {value:g}; give {hinge.low:.4g} to {hinge.high:.4g}, its limits"
            )
        found[joint] = value
    if not any(skeleton.moves[joint, leg.foot] for joint in given for leg in legs):
        return found
    soles = [sole(skeleton, leg, q) for leg in legs]
    apart = _places(skeleton, soles, found) - _places(skeleton, soles, q)
    reach = min(leg.reach for leg in legs)
    if np.linalg.norm(apart[:, :2], axis=1).max() > _MISS * reach or np.ptp(apart[:, 2]) > _EVEN * reach:
        found = _adapted(skeleton, legs, soles, (q, found), given)
    frames = skeleton.frames(found[None])
    lowest = np.array([skeleton.lowest(skeleton.moves[leg.joints[-1]], frames)[0] for leg in legs])
    if np.ptp(lowest) > _EVEN * reach:
        heights = zip(soles, lowest - lowest.min(), strict=True)
        feet = ", ".join(f"{skeleton.bodies[foot.body]} {height:.3f} m" for foot, height in heights)
        free = ", ".join(names[joint] for leg in legs for joint in leg.joints if joint not in given)
        cure = f"give {free} too" if free else "give positions with which all feet are level"
        raise ArgumentError(f"{what} leaves feet above the lowest one: {feet}; {cure}")
    return found


def _adapted(
    skeleton: Skeleton,
    legs: Sequence[Leg],
    soles: Sequence[Sole],
    poses: tuple[Array, Array],
    given: Mapping[int, float],
) -> Array:
    """Feet below where they are at the first pose, first at any height and then at one; given joints hold."""
    q, found = poses[0], poses[1].copy()
    frames, axes, hips = skeleton.frames(q[None]), skeleton.axes(q), skeleton.frames(found[None])[0][0]
    aims = _places(skeleton, soles, q)

    def bend(leg: Leg, foot: Sole, place: Array, height: float) -> None:
        knee = frames[0][0, skeleton.body_of(knee_of(skeleton, leg, foot))]
        hip = frames[0][0, skeleton.body_of(leg.joints[0])]
        share = np.clip((knee[2] - hip[2]) / min(place[2] - hip[2], -1e-6), 0.0, 1.0)
        own_side = float(np.sign(knee[0] - hip[0] - share * (place[0] - hip[0])))
        turn = frames[1][0, foot.body] if len(legs) == 2 else None
        is_around = len(legs) != 2 and abs(axes[leg.joints[0], 2]) > _UPRIGHT
        at_hip = replace(leg, hip=hips[skeleton.body_of(leg.joints[0])])
        # given joints may need the knee on the other side
        for side in (own_side, 0.0):
            aim = Aim(place, turn, side, is_around, height, given.keys(), _MARGIN)
            joints, miss = solve(skeleton, at_hip, foot, aim, found)
            if miss < _MISS * leg.reach:
                break
        found[list(leg.joints)] = joints

    free = [any(joint not in given for joint in leg.joints) for leg in legs]
    touched = [any(skeleton.moves[joint, leg.foot] for joint in given) for leg in legs]
    for leg, foot, aim, moves in zip(legs, soles, aims, np.logical_and(free, touched), strict=True):
        if moves:
            bend(leg, foot, aim, _ANY_HEIGHT)
    change = (_places(skeleton, soles, found) - aims)[:, 2]
    ground = float(change[touched if all(free) else ~np.array(free)].mean())
    for leg, foot, aim, moves in zip(legs, soles, aims, free, strict=True):
        if moves:
            bend(leg, foot, aim + np.array([0.0, 0.0, ground]), 2.0)
    return found


def _places(skeleton: Skeleton, soles: Sequence[Sole], q: Array) -> Array:
    """Where soles are at a pose [m], shape ``(soles, 3)``."""
    frames = skeleton.frames(q[None])
    return np.array([place_of(skeleton, foot, frames)[0] for foot in soles])


def _quadruped(skeleton: Skeleton, legs: Sequence[Leg], solved: Sequence[Leg], q: Array) -> list[Array]:
    """Feet below the hips, sideways where the neutral pose has them; with knees on each side that the limits allow."""
    frames, axes = skeleton.frames(skeleton.neutral[None]), skeleton.axes(skeleton.neutral)
    trunk = ~np.any([skeleton.moves[leg.joints[0]] for leg in legs], axis=0)
    soles = [sole(skeleton, leg, leg.deepest) for leg in solved]
    found = [q]
    for height in _HEIGHTS:
        ground = max(leg.hip[2] - height * leg.reach for leg in legs)
        aims = []
        for leg, foot in zip(solved, soles, strict=True):
            neutral = place_of(skeleton, foot, frames)[0]
            is_around = abs(axes[leg.joints[0], 2]) > _UPRIGHT
            x = neutral[0] if is_around else leg.hip[0]
            aims.append((np.array([x, neutral[1], ground + foot.radius]), is_around))
        found = _bent(skeleton, solved, soles, aims, q)
        if skeleton.lowest(trunk, skeleton.frames(found[0][None]))[0] > ground + 0.05 * legs[0].reach:
            break
    return found


def _bent(
    skeleton: Skeleton,
    legs: Sequence[Leg],
    soles: Sequence[Sole],
    aims: Sequence[tuple[Array, bool]],
    q: Array,
) -> list[Array]:
    """Poses with the knees on each side that the limits allow, or one with each as it can; shapes ``(joints,)``."""
    middle = float(np.mean([leg.hip[0] for leg in legs]))
    tries = {
        side: [
            solve(skeleton, leg, foot, Aim(place, None, side, radial), q)
            for leg, foot, (place, radial) in zip(legs, soles, aims, strict=True)
        ]
        for side in (-1.0, 1.0)
    }
    choices = []
    for front, hind in _SIDES:
        own = [tries[front if leg.hip[0] > middle else hind][place] for place, leg in enumerate(legs)]
        if all(miss < _MISS * leg.reach for leg, (_, miss) in zip(legs, own, strict=True)):
            choices.append(own)
    if not choices:
        choices.append([min(of_leg, key=lambda tried: tried[1]) for of_leg in zip(*tries.values(), strict=True)])
    poses = []
    for choice in choices:
        found = q.copy()
        for leg, (joints, _) in zip(legs, choice, strict=True):
            found[list(leg.joints)] = joints
        poses.append(found)
    return poses


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
