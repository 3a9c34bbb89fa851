"""The way of a tendon around a sphere or a cylinder (MuJoCo: ``mju_wrap``), of many at a time.

It is found in the plane of a great circle of the sphere, or across the cylinder. With d⊥ across the point d, the
tangents from d touch the circle of radius r at ``(r² d ± r √(d² - r²) d⊥) / d²``. Of the two ways around, the one
nearer to a side site counts, else the shorter one. If the side site is inside of the shape, both lines meet the circle
at one point, under the same angle α. With the ends a and b from the centre, and γ between them::

    asin(r sin α / a) + asin(r sin α / b) - 2 α + γ = 0
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: An arc is drawn as so many straight pieces.
PIECES = 8
# What is no length (MuJoCo: mjMINVAL) [m].
_TINY = 1e-15
# MuJoCo's iterations for α: how many, the first sin α, and the rest of the equation that ends them [rad].
_ITERATIONS, _START, _REST = 20, 1 - 1e-7, 1e-6


def bend(
    first: Array, last: Array, *, radius: Array, is_cylinder: Mask, side: Array, has_side: Mask
) -> tuple[Mask, Array]:
    """Return which tendons touch their shapes, and their arcs.

    All arguments are in the frames of the shapes; leading axes broadcast.

    Args:
        first: Where the tendons come from [m], shape ``(…, 3)``.
        last: Where they go to [m], shape ``(…, 3)``.
        radius: Radius of the shapes [m], shape ``(…)``.
        is_cylinder: Whether a shape is a cylinder along z, else a sphere.
        side: Side sites [m], shape ``(…, 3)``.
        has_side: Whether there is a side site.

    Returns:
        Whether they touch, shape ``(…)``, and `PIECES` + 1 points from where they meet the surface to where they leave
        it [m], shape ``(…, PIECES + 1, 3)``.
    """
    with np.errstate(all="ignore"):
        x, y = _plane(first, last)
        x = np.where(is_cylinder[..., None], np.array([1.0, 0, 0]), x)
        y = np.where(is_cylinder[..., None], np.array([0, 1.0, 0]), y)
        start, end, beside = (np.stack([_dot(p, x), _dot(p, y)], axis=-1) for p in (first, last, side))
        is_inner = has_side & (_norm(side) < radius)
        touches_inner, point = _inner(start, end, radius)
        touches_outer, outer, turn = _outer(start, end, radius, beside, has_side)
        touches = np.where(is_inner, touches_inner, touches_outer)
        meets = np.where(is_inner[..., None], point, outer[..., 0, :])
        leaves = np.where(is_inner[..., None], point, outer[..., 1, :])
        begins, ends = (np.arctan2(p[..., 1], p[..., 0]) for p in (meets, leaves))
        # with the clock where turn is 1, against it where it is -1; a rounding is no whole turn
        swept = np.mod(turn * (begins - ends), 2 * np.pi)
        swept = np.where(is_inner | (swept > 2 * np.pi - 1e-7), 0.0, swept)
        along = np.linspace(0.0, 1.0, PIECES + 1)
        angles = begins[..., None] - (turn * swept)[..., None] * along
        flat = radius[..., None, None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        points = flat[..., :1] * x[..., None, :] + flat[..., 1:] * y[..., None, :]
        # a tendon rises evenly along the unrolled cylinder
        before, after = _norm(start - meets), _norm(end - leaves)
        way = before + radius * swept + after
        rise = (last[..., 2] - first[..., 2]) / np.where(way < _TINY, 1.0, way)
        height = first[..., 2, None] + rise[..., None] * (before[..., None] + (radius * swept)[..., None] * along)
        points[..., 2] = np.where(is_cylinder[..., None], height, points[..., 2])
        is_center = (_norm(first) < _TINY) | (_norm(last) < _TINY)
        return touches & ~is_center, np.where(touches[..., None, None], points, 0.0)


def _plane(first: Array, last: Array) -> tuple[Array, Array]:
    """Axes of the plane through the centre and both ends, the first one towards the first end."""
    x = _unit(first)
    normal = np.cross(first, last)
    # where they are in line with the centre, across the axis of which x has most, as in MuJoCo
    others = 1.0 - np.eye(3)[np.argmax(np.abs(x), axis=-1)]
    normal = np.where((_norm(normal) < _TINY)[..., None], np.cross(x, others), normal)
    return x, _unit(np.cross(_unit(normal), x))


def _outer(start: Array, end: Array, radius: Array, beside: Array, has_side: Mask) -> tuple[Mask, Array, Array]:
    """Return which tendons touch the outside, where, shape ``(…, 2, 2)``, and whether they turn with the clock, ±1."""
    square, along = radius * radius, end - start
    squares, long = (_dot(start, start), _dot(end, end)), _dot(along, along)
    free = (squares[0] >= square) & (squares[1] >= square) & (long >= _TINY) & (radius >= _TINY)
    part = np.clip(-_dot(along, start) / np.where(long < _TINY, 1.0, long), 0.0, 1.0)
    nearest = start + part[..., None] * along
    misses = _dot(nearest, nearest) > square
    beside = _unit(beside) * radius[..., None]
    passes = misses & (~has_side | (_dot(beside, nearest) >= 0.0))
    ways, worths, crossings = [], [], []
    for turn in (1.0, -1.0):
        meets = _tangent(start, squares[0], radius, turn)
        leaves = _tangent(end, squares[1], radius, -turn)
        chord = meets - leaves
        worth = np.where(has_side, _dot(_unit(meets + leaves), beside), -_dot(chord, chord))
        # tangents only cross where the straight line misses the circle
        crosses = misses & _cross_each_other(start, meets, end, leaves)
        ways.append(np.stack([meets, leaves], axis=-2))
        worths.append(np.where(crosses, -1e4, worth))
        crossings.append(crosses)
    is_first = worths[0] > worths[1]
    crosses = np.where(is_first, *crossings)
    points = np.where(is_first[..., None, None], *ways)
    return free & ~passes & ~crosses, points, np.where(is_first, 1.0, -1.0)


def _tangent(point: Array, square: Array, radius: Array, turn: float) -> Array:
    """Where a tangent from a point touches the circle."""
    beyond = np.sqrt(np.maximum(square - radius * radius, 0.0))
    across = np.stack([point[..., 1], -point[..., 0]], axis=-1) * (turn * radius * beyond)[..., None]
    return ((radius * radius)[..., None] * point + across) / np.where(square < _TINY**2, 1.0, square)[..., None]


def _cross_each_other(a: Array, b: Array, c: Array, d: Array) -> Mask:
    """Whether the lines from a to b and from c to d cross."""
    first, second, apart = b - a, d - c, a - c
    determinant = _cross(first, second)
    is_parallel = np.abs(determinant) < _TINY
    inverse = 1.0 / np.where(is_parallel, 1.0, determinant)
    on_first, on_second = _cross(second, apart) * inverse, _cross(first, apart) * inverse
    return ~is_parallel & (on_first >= 0) & (on_first <= 1) & (on_second >= 0) & (on_second <= 1)


def _inner(start: Array, end: Array, radius: Array) -> tuple[Mask, Array]:
    """Return which tendons touch the inner side, and where, shape ``(…, 2)``."""
    a, b, along = _norm(start), _norm(end), end - start
    long = _dot(along, along)
    part = -_dot(along, start) / np.where(long > _TINY, long, 1.0)
    near = _norm(start + part[..., None] * along)
    goes_through = (long > _TINY) & (part > 0) & (part < 1) & (near <= radius)
    outside = (a > radius) & (b > radius) & (radius >= _TINY)
    a, b = np.where(outside, a, 1.0), np.where(outside, b, 1.0)
    # with the roundings of MuJoCo's cosine
    cosine = (a * a + b * b - long) / (2 * a * b)
    gamma = np.arccos(np.clip(cosine, -1.0, 1.0))
    touches = outside & ~goes_through & (cosine >= _TINY - 1.0)
    sine = _solved(radius / a, radius / b, gamma, touches & (cosine <= 1.0 - _TINY))
    rises = _cross(start, end) > 0
    angle = np.arcsin(sine) - np.arcsin(np.where(rises, radius / a, radius / b) * sine)
    near_end = _unit(np.where(rises[..., None], start, end))
    cos, sin = np.cos(angle), np.sin(angle)
    turned = np.stack(
        [cos * near_end[..., 0] - sin * near_end[..., 1], sin * near_end[..., 0] + cos * near_end[..., 1]], axis=-1
    )
    # where there is no answer, in the middle
    point = np.where((sine > 0)[..., None], turned, _unit(start + end))
    return touches, point * radius[..., None]


def _solved(first: Array, second: Array, gamma: Array, asked: Mask) -> Array:
    """Return sin α by Newton's method, with MuJoCo's iterations; 0 where it gives up."""

    def rest(z: Array) -> Array:
        return np.arcsin(np.minimum(first * z, 1)) + np.arcsin(np.minimum(second * z, 1)) - 2 * np.arcsin(z) + gamma

    z = np.full(gamma.shape, _START)
    off = rest(z)
    alive = asked & (off <= 0)
    for _ in range(_ITERATIONS):
        active = alive & (np.abs(off) > _REST)
        if not active.any():
            break
        slope = sum(k / np.maximum(_TINY, np.sqrt(1 - (k * z) ** 2)) for k in (first, second))
        slope = slope - 2 / np.maximum(_TINY, np.sqrt(1 - z * z))
        following = z - off / np.where(slope < -_TINY, slope, -1.0)
        alive &= ~active | ((slope <= -_TINY) & (following <= z))
        z = np.where(active & alive, following, z)
        off = rest(z)
        alive &= ~active | (off <= _REST)
    return np.where(alive & (np.abs(off) <= _REST), z, 0.0)


def _dot(a: Array, b: Array) -> Array:
    return np.sum(a * b, axis=-1)


def _cross(a: Array, b: Array) -> Array:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _norm(a: Array) -> Any:
    return np.sqrt(_dot(a, a))


def _unit(a: Array) -> Array:
    size = _norm(a)[..., None]
    return a / np.where(size < _TINY, 1.0, size)
