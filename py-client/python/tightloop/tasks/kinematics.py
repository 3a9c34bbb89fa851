"""Velocities, gravity and headings of bodies in their own axes; arrays have the worlds first."""

from __future__ import annotations

from tightloop.env.task import Array, Namespace


def rotate_inverse(xp: Namespace, quats: Array, vectors: Array) -> Array:
    """Return vectors in the axes of a body, by the body's quaternions (x, y, z, w), both ``(worlds, …)``.

    v' = v (w² - |u|²) + 2 u (u·v) - 2 w (u x v), with u the vector part.
    """
    x, y, z, w = (quats[:, part] for part in range(4))
    a, b, c = (vectors[:, part] for part in range(3))
    along = 2.0 * (x * a + y * b + z * c)
    scale = w * w - x * x - y * y - z * z
    double = 2.0 * w
    return xp.stack(
        [
            scale * a + along * x - double * (y * c - z * b),
            scale * b + along * y - double * (z * a - x * c),
            scale * c + along * z - double * (x * b - y * a),
        ],
        1,
    )


def projected_gravity(xp: Namespace, quats: Array) -> Array:
    """Return the direction of gravity in the axes of a body, (0, 0, -1) where it is upright, shape ``(worlds, 3)``."""
    x, y, z, w = (quats[:, part] for part in range(4))
    return xp.stack([2.0 * (w * y - x * z), -2.0 * (w * x + y * z), 2.0 * (x * x + y * y) - 1.0], 1)


def heading(xp: Namespace, quats: Array) -> Array:
    """Return the angle of a body's x axis about the world's z axis [rad], shape ``(worlds,)``."""
    x, y, z, w = (quats[:, part] for part in range(4))
    return xp.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
