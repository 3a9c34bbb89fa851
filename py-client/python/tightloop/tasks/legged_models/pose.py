"""Finds how a robot stands: feet below the hips at a share of their reach, by least squares over the joints' limits."""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass

import numpy as np

from tightloop.env.mirror import Flip
from tightloop.tasks.legged_models.legs import Leg
from tightloop.tasks.legged_models.skeleton import Array, Skeleton, Solid

#: Starts of the search and its iterations [–].
_STARTS, _ITERATIONS = 24, 40
#: Weight of a joint's distance from its neutral position, of a leg's reach per radian [–].
_NEUTRAL = 3e-3
#: Points of a sole are this share of the leg's reach above the lowest, at most [–].
_SOLE = 0.01
#: A pose that stands has feet at one height, up to this share of the reach [–].
_LEVEL = 0.1
#: Joints of a file's pose may be this far beyond their limits, as rounded numbers are [rad].
_BEYOND = 0.01


@dataclass(frozen=True)
class Sole:
    """Where a leg touches the ground.

    Attributes:
        body: The body.
        place: A point in the body's frame [m].
        radius: Height of this point on level ground [m].
    """

    body: int
    place: Array
    radius: float


@dataclass(frozen=True)
class Aim:
    """Where a foot should be.

    Attributes:
        place: Of its point, in the base's frame [m].
        turn: Orientation of its body, shape ``(3, 3)``; None for any.
        side: Where its knee should be: 1 ahead of the line from hip to foot, -1 behind it.
        radial: Whether only the distance from the hip counts in the plane, less than the height does.
        height: Weight of the foot's height, in multiples of that of its place in the plane.
        held: Joints that stay as they are.
        margin: Least distance of the others from their limits [rad].
    """

    place: Array
    turn: Array | None
    side: float
    radial: bool = False
    height: float = 2.0
    held: Container[int] = ()
    margin: float = 0.0


def sole(skeleton: Skeleton, leg: Leg, q: Array) -> Sole:
    """Return the lowest place of a leg at a pose ``(joints,)``: the middle of a ball, or of the lowest points."""
    frames = skeleton.frames(q[None])
    own = [solid for solid in skeleton.solids if skeleton.moves[leg.joints[-1], solid.body]]
    heights = [skeleton.points(solid, frames)[0, :, 2] - solid.radius for solid in own]
    lowest = min(height.min() for height in heights)
    points, radii, bodies = [], [], []
    for solid, height in zip(own, heights, strict=True):
        near = height < lowest + _SOLE * leg.reach
        points.append(skeleton.points(solid, frames)[0][near])
        radii += [solid.radius] * int(near.sum())
        bodies += [solid.body] * int(near.sum())
    all_points = np.concatenate(points)
    body = bodies[int(np.argmin(all_points[:, 2] - radii))]
    middle = 0.5 * (all_points.min(0) + all_points.max(0))
    radius = radii[0] if len(radii) == 1 else 0.0
    middle[2] = lowest + radius
    places, turns = frames
    return Sole(body, turns[0, body].T @ (middle - places[0, body]), radius)


def place_of(skeleton: Skeleton, foot: Sole, frames: tuple[Array, Array]) -> Array:
    """Return where a sole's point is, shape ``(n, 3)``."""
    return skeleton.points(Solid(foot.body, foot.place[None], 0.0), frames)[:, 0]


def knee_of(skeleton: Skeleton, leg: Leg, foot: Sole) -> int:
    """Return the joint of a leg that is farthest from both its ends."""
    frames = skeleton.frames(skeleton.neutral[None])
    end = place_of(skeleton, foot, frames)[0]
    places = [frames[0][0, skeleton.body_of(joint)] for joint in leg.joints]
    apart = [min(np.linalg.norm(place - leg.hip), np.linalg.norm(place - end)) for place in places]
    return leg.joints[int(np.argmax(apart))]


def solve(skeleton: Skeleton, leg: Leg, foot: Sole, aim: Aim, q: Array) -> tuple[Array, float]:
    """Return a leg's joints for an aim [rad], shape ``(joints of the leg,)``, and how far they miss it [m].

    Args:
        skeleton: The robot.
        leg: The leg.
        foot: Its sole.
        aim: The aim.
        q: Positions of the other joints [rad], shape ``(joints,)``.
    """
    own = [joint for joint in leg.joints if joint not in aim.held]
    middle = 0.5 * (skeleton.low + skeleton.high)[own]
    low, high = np.minimum(skeleton.low[own] + aim.margin, middle), np.maximum(skeleton.high[own] - aim.margin, middle)
    knee = skeleton.body_of(knee_of(skeleton, leg, foot))
    neutral = np.clip(skeleton.zero[own], low, high)

    def misses(poses: Array) -> Array:
        """Residuals in shares of the reach, shape ``(n, m)``."""
        whole = np.tile(q, (len(poses), 1))
        whole[:, own] = poses
        frames = skeleton.frames(whole)
        end = place_of(skeleton, foot, frames)
        apart = (end - aim.place) / leg.reach
        if aim.radial:
            out = np.linalg.norm(end[:, :2] - leg.hip[:2], axis=1)
            wanted = np.linalg.norm(aim.place[:2] - leg.hip[:2])
            plane = np.stack([0.2 * (out - wanted) / leg.reach, 0.0 * out], 1)
        else:
            plane = apart[:, :2]
        parts = [plane, aim.height * apart[:, 2:], _NEUTRAL * (poses - neutral)]
        if aim.turn is not None:
            turned = frames[1][:, foot.body] - aim.turn
            parts.append(0.5 * turned.reshape(len(poses), 9))
        if aim.radial:  # as those of insects, whose knees are outside
            return np.concatenate(parts, axis=1)
        place = frames[0][:, knee]
        share = (place[:, 2] - leg.hip[2]) / np.minimum(end[:, 2] - leg.hip[2], -0.1 * leg.reach)
        line = leg.hip[0] + np.clip(share, 0, 1) * (end[:, 0] - leg.hip[0])
        wrong = np.maximum(0.0, 0.02 - aim.side * (place[:, 0] - line) / leg.reach)
        return np.concatenate([*parts, wrong[:, None]], axis=1)

    poses = np.random.default_rng(0).uniform(low, high, (_STARTS, len(own)))
    poses[0] = np.clip(q[own], low, high)
    poses = _least_squares(misses, poses, low, high)
    best = poses[int(np.argmin((misses(poses) ** 2).sum(1)))]
    off = misses(best[None])[0]
    off[3 : 3 + len(own)] = 0.0
    whole = q.copy()
    whole[own] = best
    return whole[list(leg.joints)], float(np.linalg.norm(off) * leg.reach)


def _least_squares(misses: Callable[[Array], Array], poses: Array, low: Array, high: Array) -> Array:
    """Levenberg and Marquardt's method from many starts at once, within limits."""
    count, size = poses.shape
    damping = np.full(count, 1e-2)
    residual = misses(poses)
    step = 1e-5
    for _ in range(_ITERATIONS):
        moved = np.repeat(poses[:, None], size, axis=1) + step * np.eye(size)
        slope = (misses(moved.reshape(-1, size)).reshape(count, size, -1) - residual[:, None]) / step
        normal = slope @ slope.swapaxes(1, 2)
        wanted = -(slope @ residual[:, :, None])[:, :, 0]
        # joints at a limit that would go beyond it stay there
        stuck = ((poses <= low) & (wanted < 0)) | ((poses >= high) & (wanted > 0))
        free = ~stuck
        normal = normal * free[:, :, None] * free[:, None, :]
        normal += np.eye(size) * (damping[:, None, None] + stuck[:, :, None])
        change = np.linalg.solve(normal, (wanted * free)[:, :, None])[:, :, 0]
        tried = np.clip(poses + np.clip(change, -0.5, 0.5), low, high)
        new = misses(tried)
        better = (new**2).sum(1) < (residual**2).sum(1)
        poses = np.where(better[:, None], tried, poses)
        residual = np.where(better[:, None], new, residual)
        damping = np.where(better, np.maximum(0.3 * damping, 1e-9), np.minimum(5.0 * damping, 1e3))
    return poses


def stands(skeleton: Skeleton, legs: Sequence[Leg], q: Array) -> bool:
    """Return whether all legs end at one height, below all else, in the lower half of their reach, within limits."""
    if ((q < skeleton.low - _BEYOND) | (q > skeleton.high + _BEYOND)).any():
        return False
    frames = skeleton.frames(q[None])
    feet = np.array([skeleton.lowest(skeleton.moves[leg.joints[-1]], frames)[0] for leg in legs])
    reach = min(leg.reach for leg in legs)
    others = ~np.any([skeleton.moves[leg.joints[0]] for leg in legs], axis=0)
    deep = all(leg.hip[2] - foot > 0.35 * leg.reach for leg, foot in zip(legs, feet, strict=True))
    return bool(deep and np.ptp(feet) < _LEVEL * reach and skeleton.lowest(others, frames)[0] > feet.min())


def mirrored(skeleton: Skeleton, joints: Sequence[int], flip: Flip, legs: Sequence[Leg], q: Array) -> Array:
    """Return a pose whose right legs are the mirror image of its left ones; legs that lie in the middle stay."""
    order, signs = flip
    found = q.copy()
    right = {joint for leg in legs if leg.hip[1] < 0 for joint in leg.joints}
    for place, joint in enumerate(joints):
        if joint in right:
            found[joint] = np.clip(signs[place] * q[joints[order[place]]], skeleton.low[joint], skeleton.high[joint])
    return found
