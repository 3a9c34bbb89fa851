"""Rotations of many bodies at once, with MuJoCo's quaternions (w, x, y, z)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


def rotations(quaternions: Array) -> Array:
    """Convert quaternions ``(..., 4)`` of any norm to matrices ``(..., 3, 3)``; norm 0 is no rotation."""
    norm = np.linalg.norm(quaternions, axis=-1, keepdims=True)
    unit = np.divide(quaternions, norm, out=np.zeros(quaternions.shape), where=norm > 0.0)
    unit[..., 0] += norm[..., 0] == 0.0
    w, x, y, z = np.moveaxis(unit, -1, 0)
    matrices = np.empty((*quaternions.shape[:-1], 3, 3))
    matrices[..., 0, 0] = w * w + x * x - y * y - z * z
    matrices[..., 1, 1] = w * w - x * x + y * y - z * z
    matrices[..., 2, 2] = w * w - x * x - y * y + z * z
    matrices[..., 0, 1], matrices[..., 1, 0] = 2 * (x * y - w * z), 2 * (x * y + w * z)
    matrices[..., 0, 2], matrices[..., 2, 0] = 2 * (x * z + w * y), 2 * (x * z - w * y)
    matrices[..., 1, 2], matrices[..., 2, 1] = 2 * (y * z - w * x), 2 * (y * z + w * x)
    return matrices


def rotated(matrices: Array, vectors: Array) -> Array:
    """Rotate vectors ``(..., 3)`` by matrices ``(..., 3, 3)``."""
    return np.matmul(matrices, vectors[..., None])[..., 0]


def cross(a: Array, b: Array) -> Array:
    """Cross product of vectors ``(..., 3)``; `numpy.cross` is several times slower."""
    (ax, ay, az), (bx, by, bz) = np.moveaxis(a, -1, 0), np.moveaxis(b, -1, 0)
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)
