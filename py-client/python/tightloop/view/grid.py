"""Where worlds stand when many are shown: on a grid that one world fits into, with the first at its own place."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from tightloop.view.parts import Part
from tightloop.view.poses import IDENTITY, Array, place

# A floor reaches further than what happens on it; the grid is for the latter.
_FLOOR_SIZE = 4.0
# Room for what moves beyond where it stands at first, and between neighbours.
_ROOM = 1.25
_LEAST_SIZE = 0.5


def extent(parts: Iterable[Part], body_q: Array) -> NDArray[np.float64]:
    """The box around one world, floors left out [m].

    Args:
        parts: What it looks like.
        body_q: Poses of its bodies, shape ``(bodies, 7)``.

    Returns:
        Its least and its largest corner, shape ``(2, 3)``; a cube about the origin where there is nothing.
    """
    corners: list[Array] = []
    for part in parts:
        low, high = part.mesh.vertices.min(axis=0), part.mesh.vertices.max(axis=0)
        if part.body < 0 and np.max(high - low) > _FLOOR_SIZE:
            continue
        box = np.stack(np.meshgrid(*zip(low, high, strict=True)), axis=-1).reshape(-1, 3)
        inside = place(part.pose, box)
        corners.append(place(IDENTITY if part.body < 0 else body_q[part.body], inside))
    if not corners:
        return np.array([[-1, -1, -1], [1, 1, 1]]) * _LEAST_SIZE
    points = np.concatenate(corners)
    return np.stack([points.min(axis=0), points.max(axis=0)]).astype(np.float64)


def offsets(worlds: int, box: NDArray[np.float64]) -> NDArray[np.float32]:
    """What is added to the positions of each world [m], shape ``(worlds, 3)``; nothing to those of the first.

    Args:
        worlds: How many.
        box: What `extent` gives for one.
    """
    columns = math.ceil(math.sqrt(worlds))
    size = np.maximum(box[1] - box[0], _LEAST_SIZE) * _ROOM
    index = np.arange(worlds)
    places = np.zeros((worlds, 3), np.float32)
    places[:, 0] = index % columns * size[0]
    places[:, 1] = index // columns * size[1]
    return places
