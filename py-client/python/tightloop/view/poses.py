"""Poses as arrays with a last axis of 7: position [m], then quaternion (x, y, z, w). viser puts w first."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

#: The identity pose.
IDENTITY = np.array([0, 0, 0, 0, 0, 0, 1], dtype=np.float32)


def rotate(quat: Array, vectors: Array) -> Array:
    """Rotate vectors by quaternions (x, y, z, w): ``v + 2 w (u × v) + 2 u × (u × v)``; leading axes broadcast."""
    u, w = quat[..., :3], quat[..., 3:]
    across = 2 * np.cross(u, vectors)
    return vectors + w * across + np.cross(u, across)


def place(pose: Array, points: Array) -> Array:
    """Transform points ``(n, 3)`` from a frame into its parent, by the frame's pose ``(7,)``."""
    return pose[:3] + rotate(pose[3:], points)


def compose(outer: Array, inner: Array) -> Array:
    """Compose poses: ``inner`` in the frames ``outer``, as poses in the parent of ``outer``; leading axes broadcast."""
    u, w = outer[..., 3:6], outer[..., 6:]
    v, s = inner[..., 3:6], inner[..., 6:]
    position = outer[..., :3] + rotate(outer[..., 3:], inner[..., :3])
    turned = w * v + s * u + np.cross(u, v)
    return np.concatenate([position, turned, w * s - np.sum(u * v, axis=-1, keepdims=True)], axis=-1)


def wxyz(quat: Array) -> Array:
    """Reorder quaternions (x, y, z, w) as viser expects them, w first."""
    return quat[..., [3, 0, 1, 2]]
