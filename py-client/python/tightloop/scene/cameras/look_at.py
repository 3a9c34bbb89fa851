"""The orientation of a camera that looks at a point."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tightloop.checks.arguments import Quaternion, Triple


def towards(eye: Triple, target: Triple) -> Quaternion:
    """Return the orientation of a camera that looks at a point, with the frame's z axis up in the image."""
    forward = np.subtract(target, eye)
    forward = forward / np.linalg.norm(forward)
    # of a camera that looks along z, the y axis is up
    up = np.array([0.0, 0.0, 1.0]) if abs(forward[2]) < 1.0 - 1e-9 else np.array([0.0, 1.0, 0.0])
    right = np.cross(forward, up)
    right = right / np.linalg.norm(right)
    return _quaternion(np.stack([right, np.cross(forward, right), forward], axis=1))


def _quaternion(matrix: NDArray[np.float64]) -> Quaternion:
    """Return the quaternion (x, y, z, w) of a rotation matrix, from its largest part (Shepperd's method)."""
    m = matrix
    squares = np.array(
        [
            1.0 + m[0, 0] - m[1, 1] - m[2, 2],
            1.0 - m[0, 0] + m[1, 1] - m[2, 2],
            1.0 - m[0, 0] - m[1, 1] + m[2, 2],
            1.0 + m[0, 0] + m[1, 1] + m[2, 2],
        ]
    )
    products = np.array(
        [
            [0.0, m[1, 0] + m[0, 1], m[2, 0] + m[0, 2], m[2, 1] - m[1, 2]],
            [m[1, 0] + m[0, 1], 0.0, m[2, 1] + m[1, 2], m[0, 2] - m[2, 0]],
            [m[2, 0] + m[0, 2], m[2, 1] + m[1, 2], 0.0, m[1, 0] - m[0, 1]],
            [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], 0.0],
        ]
    )
    largest = int(squares.argmax())
    row = products[largest]
    row[largest] = squares[largest]
    x, y, z, w = (row / np.linalg.norm(row)).tolist()
    return x, y, z, w
