"""The translucent ball that marks a goal."""

from __future__ import annotations

import numpy as np

from tightloop.view.parts import Mesh

_RINGS = 16


def goal_marker(radius: float, color: tuple[int, ...]) -> Mesh:
    """Make a ball about the origin.

    Args:
        radius: Radius of the ball [m].
        color: Red, green, blue, opacity.
    """
    rings, around = np.meshgrid(np.arange(_RINGS + 1), np.arange(2 * _RINGS), indexing="ij")
    a, b = np.pi * rings / _RINGS, np.pi * around / _RINGS
    points = radius * np.stack([np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)], axis=-1)
    row, column = (index.ravel() for index in np.meshgrid(np.arange(_RINGS), np.arange(2 * _RINGS), indexing="ij"))
    beside = (column + 1) % (2 * _RINGS)
    here, right, below, across = (
        row * 2 * _RINGS + column,
        row * 2 * _RINGS + beside,
        (row + 1) * 2 * _RINGS + column,
        (row + 1) * 2 * _RINGS + beside,
    )
    faces = np.concatenate([np.stack([here, below, right], axis=-1), np.stack([right, below, across], axis=-1)])
    colors = np.tile(np.array(color, np.uint8), (len(faces), 1))
    return Mesh(points.reshape(-1, 3).astype(np.float32), faces.astype(np.uint32), colors)
