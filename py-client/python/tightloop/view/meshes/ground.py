"""Large height fields: ground that all worlds of a scene share, so worlds are drawn in place and it is drawn once."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from tightloop.view.parts import Part
from tightloop.view.poses import place

# Smaller height fields are objects, of which each world has its own on the grid [m].
_SIZE = 4.0


def is_ground(part: Part) -> bool:
    """Return whether a part is a large height field."""
    return part.body < 0 and part.shape == "hfield" and bool(np.ptp(part.mesh.vertices, axis=0).max() > _SIZE)


def extent(parts: Iterable[Part]) -> NDArray[np.float64] | None:
    """Return the bounding box of all large height fields [m], shape ``(2, 3)``; None if there are none.

    Args:
        parts: Parts of one world.
    """
    corners = [_corners(part) for part in parts if is_ground(part)]
    if not corners:
        return None
    points = np.concatenate(corners)
    return np.stack([points.min(axis=0), points.max(axis=0)])


def inside(box: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which points, shape ``(n, 3)``, are on or above the ground, and not beside it."""
    return np.all(points >= box[0], axis=-1) & np.all(points[:, :2] <= box[1, :2], axis=-1)


def _corners(part: Part) -> NDArray[np.float64]:
    vertices = part.mesh.vertices
    box = np.stack([vertices.min(axis=0), vertices.max(axis=0)]).astype(float)
    return place(np.asarray(part.pose), np.stack(np.meshgrid(*box.T), axis=-1).reshape(-1, 3))
