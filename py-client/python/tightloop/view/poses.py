"""Poses as arrays: position [m], then quaternion (x, y, z, w), in the last axis of seven. viser has w first."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

#: The pose that changes nothing.
IDENTITY = np.array([0, 0, 0, 0, 0, 0, 1], dtype=np.float32)


def rotate(quat: Array, vectors: Array) -> Array:
    """Vectors turned by quaternions (x, y, z, w): ``v + 2 w (u × v) + 2 u × (u × v)``; leading axes broadcast."""
    u, w = quat[..., :3], quat[..., 3:]
    across = 2 * np.cross(u, vectors)
    return vectors + w * across + np.cross(u, across)


def place(pose: Array, points: Array) -> Array:
    """Points ``(n, 3)`` of a frame, in the frame that its pose ``(7,)`` is given in."""
    return pose[:3] + rotate(pose[3:], points)


def compose(outer: Array, inner: Array) -> Array:
    """Poses ``inner`` in frames whose own poses are ``outer``, as poses in what those are in; leading axes cast."""
    u, w = outer[..., 3:6], outer[..., 6:]
    v, s = inner[..., 3:6], inner[..., 6:]
    position = outer[..., :3] + rotate(outer[..., 3:], inner[..., :3])
    turned = w * v + s * u + np.cross(u, v)
    return np.concatenate([position, turned, w * s - np.sum(u * v, axis=-1, keepdims=True)], axis=-1)


def wxyz(quat: Array) -> Array:
    """Quaternions (x, y, z, w) as viser has them, w first."""
    return quat[..., [3, 0, 1, 2]]
