"""Cameras and their presets by name, for the page in the browser and for pictures."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tightloop.checks import arguments as checks
from tightloop.checks.signatures import checked_calls
from tightloop.errors import ArgumentError

#: Directions from the target to the camera, x forward, z up; "follow" is a "three-quarter" camera that moves along.
PRESETS = {
    "three-quarter": (1.0, -1.0, 0.7),
    "front": (1.0, 0.0, 0.15),
    "side": (0.0, -1.0, 0.15),
    # not exactly vertical: the up direction would be undefined
    "top": (0.0, -1e-3, 1.0),
    "follow": (1.0, -1.0, 0.7),
}

# Fraction of the picture's width or height that the subject fills; the rest is room for motion.
_FILL = 0.8
# As seen on a height field by a camera that follows.
_GROUND_FILL = 0.4
# A subject that moves is kept within this fraction of the picture.
_KEEP = 0.96
_LEAST_DISTANCE = 0.1


@checked_calls
@dataclass(frozen=True)
class Camera:
    """A point of view.

    Attributes:
        position: Position of the camera [m].
        target: Point that it looks at [m].
        fov: Vertical field of view [rad].
        up: Direction that points up in the picture.

    Raises:
        ArgumentError: A value is not finite, or the field of view is not between 0 and π.
    """

    position: tuple[float, float, float]
    target: tuple[float, float, float]
    fov: float = 0.7
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        for name in ("position", "target", "up"):
            given = checks.triple(f"Camera: {name}", getattr(self, name), error=ArgumentError)
            object.__setattr__(self, name, given)
        line = np.subtract(self.target, self.position)
        if not line.any():
            raise ArgumentError(f"Camera: target is {self.target}, the position too; give another point to look at")
        if not any(self.up):
            raise ArgumentError("Camera: up has no direction; give one, such as (0, 0, 1)")
        fov = checks.number("Camera: fov", self.fov, above=0.0, error=ArgumentError)
        if fov >= np.pi:
            raise ArgumentError(f"Camera: fov is {fov:g}; give less than π [rad]")


def camera(
    preset: str, points: NDArray[np.float64], *, aspect: float = 1.0, fov: float = 0.7, ground: bool = False
) -> Camera:
    """Return a preset camera whose picture some points fill, in width or in height.

    Args:
        preset: A name of `PRESETS`.
        points: The points [m], shape ``(n, 3)``, at least one.
        aspect: Width of the picture divided by its height.
        fov: Vertical field of view [rad].
        ground: Whether there is ground to see: one robot then leaves more room for it.
    """
    axes = _axes(np.array(PRESETS[preset]))
    fill = _GROUND_FILL if ground and preset == "follow" else _FILL
    local = points @ axes.T
    low, high, depth = _nearest(local, _tangents(fov, aspect, fill))
    nearest, farthest = local[:, 2].min(), local[:, 2].max()
    depth = min(depth, nearest - _LEAST_DISTANCE)
    eye = np.array([*(0.5 * (high - low)), depth])
    # browsers turn around the target, so it is in the middle of the points
    target = np.array([*eye[:2], 0.5 * (nearest + farthest)])
    return Camera(_point(eye @ axes), _point(target @ axes), fov)


def kept(camera: Camera, points: NDArray[np.float64], *, aspect: float = 1.0) -> Camera:
    """Return a camera moved sideways, and backwards if need be, by as little as shows all points.

    Args:
        camera: The camera; one that shows all points is returned as it is.
        points: The points [m], shape ``(n, 3)``.
        aspect: Width of the picture divided by its height.
    """
    if not len(points):
        return camera
    eye, target = np.array(camera.position), np.array(camera.target)
    axes = _axes(eye - target)
    tangents = _tangents(camera.fov, aspect, _KEEP)
    low, high, depth = _nearest((points - eye) @ axes.T, tangents)
    depth = min(depth, 0.0)
    aside = np.clip(0.0, high + tangents * depth, -low - tangents * depth)
    moved = np.array([*aside, depth]) @ axes
    return camera if not moved.any() else replace(camera, position=_point(eye + moved), target=_point(target + moved))


def shifted(camera: Camera, by: NDArray[np.float64]) -> Camera:
    """Return a camera moved by a vector [m], which looks in the same direction."""
    return replace(
        camera,
        position=_point(np.array(camera.position) + by),
        target=_point(np.array(camera.target) + by),
    )


def _axes(towards: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the camera's axes to the right, up and into the picture, from a vector that points at the camera."""
    into = -towards / np.linalg.norm(towards)
    right = np.cross(into, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(right, into), into])


def _tangents(fov: float, aspect: float, part: float) -> NDArray[np.float64]:
    """Return the tangents of half the angles of view of a part of the picture, across and upwards."""
    return np.tan(0.5 * fov) * part * np.array([aspect, 1.0])


def _nearest(
    local: NDArray[np.float64], tangents: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Return the bounds and the depth of the nearest camera that shows some points in its axes.

    A point at (r, f) is visible from (x, z) if |r − x| ≤ t (f − z), so r − t f ≤ x − t z and −r − t f ≤ −x − t z. The
    largest left sides, high and low, give z ≤ −(high + low) / 2t and high + t z ≤ x ≤ −low − t z.
    """
    forth = local[:, 2:] * tangents
    high = (local[:, :2] - forth).max(axis=0)
    low = (-local[:, :2] - forth).max(axis=0)
    return low, high, float((-(high + low) / (2.0 * tangents)).min())


def _point(vector: NDArray[np.float64]) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in vector)
    return x, y, z
