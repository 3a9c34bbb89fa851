"""Lengths, distances and turns; arrays have the worlds first."""

from __future__ import annotations

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
