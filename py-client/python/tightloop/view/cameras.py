"""Cameras and their presets by name, for the page in the browser and for pictures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

#: Directions from the target to the camera, x forward, z up; "follow" is a "three-quarter" camera that moves along.
PRESETS = {
    "three-quarter": (1.0, -1.0, 0.7),
    "front": (1.0, 0.0, 0.15),
    "side": (0.0, -1.0, 0.15),
    # not exactly vertical: the up direction would be undefined
    "top": (0.0, -1e-3, 1.0),
    "follow": (1.0, -1.0, 0.7),
}

# Fraction of the picture that the target fills.
_MARGIN = 0.9
_LEAST_DISTANCE = 0.1


@dataclass(frozen=True)
class Camera:
    """A point of view.

    Attributes:
        position: Position of the camera [m].
        target: Point that it looks at [m].
        fov: Vertical field of view [rad].
        up: Direction that points up in the picture.
    """

    position: tuple[float, float, float]
    target: tuple[float, float, float]
    fov: float = 0.7
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)


def camera(preset: str, box: NDArray[np.float64], *, aspect: float = 1.0, fov: float = 0.7) -> Camera:
    """Return a preset camera that shows a whole box.

    Args:
        preset: A name of `PRESETS`.
        box: Lower and upper corner of the box [m], shape ``(2, 3)``.
        aspect: Width of the picture divided by its height.
        fov: Vertical field of view [rad].
    """
    centre = box.mean(axis=0)
    towards = np.array(PRESETS[preset]) / np.linalg.norm(PRESETS[preset])
    across = np.cross((0.0, 0.0, 1.0), towards)
    across /= np.linalg.norm(across)
    upward = np.cross(towards, across)
    corners = np.stack(np.meshgrid(*box.T), axis=-1).reshape(-1, 3) - centre
    # a corner is visible if its offset over its distance is at most the tangent of half the view angle, both ways
    tangent = np.tan(fov / 2) * _MARGIN
    needed = np.maximum(np.abs(corners @ across) / (tangent * aspect), np.abs(corners @ upward) / tangent)
    distance = float(np.max(corners @ towards + needed))
    x, y, z = (float(value) for value in centre + towards * max(distance, _LEAST_DISTANCE))
    return Camera((x, y, z), (float(centre[0]), float(centre[1]), float(centre[2])), fov)
