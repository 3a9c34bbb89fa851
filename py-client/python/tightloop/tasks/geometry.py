"""Lengths, distances and angles; arrays have the worlds first."""

from __future__ import annotations

from collections.abc import Sequence

from tightloop.env.task import Array, Namespace


def squares(xp: Namespace, rows: Array) -> Array:
    """Sum of squares of each row, shape ``(worlds,)``."""
    return xp.vecdot(rows, rows)


def distance(xp: Namespace, points: Array, others: Array) -> Array:
    """Distance of points from others [m], shape ``(worlds,)``."""
    # by columns: NumPy takes twice as long over rows of three
    x, y, z = (points[:, axis] - others[:, axis] for axis in range(3))
    return xp.sqrt(x * x + y * y + z * z)


def angle(xp: Namespace, quats: Array, others: Array) -> Array:
    """Angle between orientations, of unit quaternions [rad], from 0 to π, shape ``(worlds,)``."""
    alike = abs(xp.vecdot(quats, others))
    # rounding may take it above 1
    return 2.0 * xp.acos(xp.minimum(alike, alike * 0.0 + 1.0))


def in_box(draws: Array, low: Sequence[float], high: Sequence[float]) -> list[Array]:
    """Return a point in a box, one array of shape ``(worlds,)`` per axis.

    Args:
        draws: Uniform random numbers in [0, 1), shape ``(worlds, 3)`` or wider.
        low: Lower corner of the box.
        high: Upper corner of the box.
    """
    return [start + (end - start) * draws[:, axis] for axis, (start, end) in enumerate(zip(low, high, strict=True))]
