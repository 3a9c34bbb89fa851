"""Cameras of a scene, whose images are fields of frames."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tightloop.checks.arguments import Quaternion, Triple

#: What a camera sees of robots whose files have both visuals and collision shapes.
Sees = Literal["visuals", "collisions"]


@dataclass(frozen=True)
class Camera:
    """A pinhole camera, made by `Scene.add_camera`.

    Its frame has x to the right of the image, y down and z forward, as in OpenCV and in optical frames of ROS.

    Attributes:
        name: Name, of which its fields have theirs.
        body: Body or ``robot/link`` that carries it; None for the world.
        pos: Position in the frame of the body [m].
        quat: Orientation in that frame (x, y, z, w).
        width: Pixels of a row.
        height: Rows.
        focal: Focal lengths along x and y [pixels].
        center: Principal point from the upper left corner of the image [pixels].
        near: Nearest depth that is seen [m].
        far: Farthest depth that is seen [m].
        every: Control frames from one image to the next.
        worlds: Numbers of the worlds that have images; None for all.
        sees: What is seen of robots: ``"visuals"`` or ``"collisions"``.
        depth_noise: Standard deviation of a depth: so much [m], and so much times its square [1/m].
    """

    name: str
    body: str | None
    pos: Triple
    quat: Quaternion
    width: int
    height: int
    focal: tuple[float, float]
    center: tuple[float, float]
    near: float
    far: float
    every: int
    sees: Sees
    depth_noise: tuple[float, float] = (0.0, 0.0)
    worlds: tuple[int, ...] | None = None

    @property
    def depth(self) -> str:
        """Name of the field of depths, ``(worlds, height, width)``, f32 [m]: 0 where nothing is seen."""
        return f"{self.name}_depth"

    @property
    def segmentation(self) -> str:
        """Name of the field of labels, ``(worlds, height, width)``, i32: places in ``sim.segment_names``, or -1."""
        return f"{self.name}_segmentation"

    @property
    def rgb(self) -> str:
        """Name of the field of colours, ``(worlds, height, width, 3)``, u8: red, green and blue."""
        return f"{self.name}_rgb"

    @property
    def fields(self) -> tuple[str, str, str]:
        """Names of all of its fields."""
        return self.depth, self.segmentation, self.rgb

    @property
    def intrinsics(self) -> NDArray[np.float64]:
        """The matrix of the projection, as OpenCV has it, shape ``(3, 3)`` [pixels]."""
        (fx, fy), (cx, cy) = self.focal, self.center
        return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])

    def table(self) -> dict[str, Any]:
        """Return the camera as a table of a scene file."""
        return {name: value for name, value in vars(self).items() if value is not None}
