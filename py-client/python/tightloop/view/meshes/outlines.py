"""Outlines of meshes: the few vertices that decide how large a mesh looks from any side."""

from __future__ import annotations

from functools import cache
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from tightloop.view.parts import Mesh

# An outline has a mesh's farthest vertex in each of so many directions: it is less than 1 % smaller than the mesh.
_DIRECTIONS = 256
# Directions at a time: they bound the memory that a mesh of many vertices takes.
_CHUNK = 32
_outlines: WeakKeyDictionary[Mesh, NDArray[np.float64]] = WeakKeyDictionary()


def outline(mesh: Mesh) -> NDArray[np.float64]:
    """Return vertices whose convex hull is nearly that of the mesh [m], shape ``(n, 3)``."""
    if mesh not in _outlines:
        vertices = mesh.vertices
        if len(vertices) > _DIRECTIONS:
            chunks = np.array_split(_directions(), _DIRECTIONS // _CHUNK)
            farthest = np.concatenate([np.argmax(vertices @ chunk.T, axis=0) for chunk in chunks])
            vertices = vertices[np.unique(farthest)]
        _outlines[mesh] = vertices.astype(np.float64)
    return _outlines[mesh]


@cache
def _directions() -> NDArray[np.float32]:
    """Return unit vectors all around, spaced evenly: the six axes, then a Fibonacci spiral."""
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    count = _DIRECTIONS - len(axes)
    height = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    angle = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    radius = np.sqrt(1.0 - height**2)
    spiral = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=-1)
    return np.concatenate([axes, spiral]).astype(np.float32)
