"""Positions of many worlds on a grid whose cells fit one world; the first world is not moved.

Worlds that share a large height field stay in place.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from tightloop.view.meshes.outlines import outline
from tightloop.view.parts import Part
from tightloop.view.poses import IDENTITY, Array, place

# Larger static parts count as floors, which do not set the size of a cell [m].
_FLOOR_SIZE = 4.0
# Factor for motion beyond the start, and for space between neighbours.
_ROOM = 1.25
_LEAST_SIZE = 0.5


def extent(parts: Iterable[Part], body_q: Array) -> NDArray[np.float64]:
    """Return the bounding box of one world without floors and sites [m].

    Args:
        parts: Parts of the world.
        body_q: Body poses, shape ``(bodies, 7)``.

    Returns:
        Lower and upper corner, shape ``(2, 3)``; a cube about the origin if there are no parts.
    """
    found: list[Array] = []
    for part in parts:
        is_floor = part.body < 0 and np.max(np.ptp(part.mesh.vertices, axis=0)) > _FLOOR_SIZE
        if is_floor or part.is_site:
            continue
        points = outline(part.mesh)
        placed = place(IDENTITY if part.body < 0 else body_q[part.body], place(part.pose, points))
        if np.isfinite(placed).all():
            found.append(placed)
    if not found:
        return np.array([[-1, -1, -1], [1, 1, 1]]) * _LEAST_SIZE
    points = np.concatenate(found)
    return np.stack([points.min(axis=0), points.max(axis=0)]).astype(np.float64)


def offsets(worlds: int, box: NDArray[np.float64], *, in_place: bool = False) -> NDArray[np.float32]:
    """Return the position of each world on the grid [m], shape ``(worlds, 3)``; the first one is zero.

    Args:
        worlds: Number of worlds.
        box: Bounding box of one world, from `extent`.
        in_place: Whether worlds share their ground, so that all positions are zero.
    """
    if in_place:
        return np.zeros((worlds, 3), np.float32)
    columns = math.ceil(math.sqrt(worlds))
    size = np.maximum(box[1] - box[0], _LEAST_SIZE) * _ROOM
    index = np.arange(worlds)
    places = np.zeros((worlds, 3), np.float32)
    places[:, 0] = index % columns * size[0]
    places[:, 1] = index // columns * size[1]
    return places
