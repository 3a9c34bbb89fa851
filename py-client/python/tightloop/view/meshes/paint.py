"""Colours: red, green, blue and opacity of faces, 0 to 255, as a screen shows them."""

from __future__ import annotations

import colorsys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.files import named as named_files

Color = tuple[int, int, int, int]
Colors = NDArray[np.uint8]

#: What has no colour of its own: robots, what stands still, and the fields of a plane's checkers.
PLAIN = (214, 216, 220, 255)
STILL = (178, 170, 158, 255)
CHECKERS = ((196, 202, 210, 255), (172, 180, 190, 255))
# Where a face looks a texture up: its middle, and near its corners.
_PLACES = np.array([[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4]]) / np.array([[3], [6], [6], [6]])
# Slopes of the ground from which it is darker [°], and what its colour is multiplied with, on light and dark squares.
_STEEP = (8.0, 25.0, 45.0)
_TONES = ((1.0, 0.93), (0.92, 0.86), (0.78, 0.78), (0.66, 0.66))
# Hues that follow one another by the golden angle are well apart.
_GOLDEN = 137.507764 / 360
# Most bytes of an image file
_IMAGE_MAX = 1 << 30


def palette(number: int) -> tuple[int, int, int, int]:
    """The colour of the body with this number where nothing gives it one."""
    red, green, blue = colorsys.hls_to_rgb((0.58 + _GOLDEN * number) % 1, 0.6 if number % 2 == 0 else 0.7, 0.5)
    return round(255 * red), round(255 * green), round(255 * blue), 255


def ground(vertices: NDArray[np.float32], faces: NDArray[np.uint32], squares: Sequence[float], color: Color) -> Colors:
    """Colours of the faces of a height field: darker where it is steeper, in squares of two tones where it is not.

    Args:
        vertices: Shape ``(vertices, 3)`` [m].
        faces: Shape ``(faces, 3)``, none of which goes beyond a square.
        squares: Lengths of a square along x and y [m]; the first begins at the lowest corner.
        color: Its colour where it is level, of the lighter squares.

    Returns:
        Shape ``(faces, 4)``.
    """
    a, b, c = (vertices[faces[:, corner]].astype(np.float64) for corner in range(3))
    normal = np.cross(b - a, c - a)
    upright = normal[:, 2] / np.maximum(np.linalg.norm(normal, axis=1), np.finfo(float).tiny)
    steep = np.searchsorted(-np.cos(np.radians(_STEEP)), -upright)
    place = np.floor(((a + b + c) / 3.0 - vertices.min(axis=0))[:, :2] / squares).astype(int)
    tones = np.array(_TONES)[steep, place.sum(axis=1) % 2]
    colors = np.tile(np.array(color, np.float64), (len(faces), 1))
    colors[:, :3] *= tones[:, None]
    return np.rint(colors).astype(np.uint8)


def of_floats(color: Sequence[float]) -> tuple[int, int, int, int]:
    """Three or four numbers from 0 to 1 as a colour."""
    red, green, blue, alpha = (round(255 * min(max(float(part), 0.0), 1.0)) for part in (*color, 1.0)[:4])
    return red, green, blue, alpha


def image_mean(image: Any) -> tuple[int, int, int, int]:
    """Mean colour of an image of pillow's."""
    red, green, blue, alpha = np.asarray(image.convert("RGBA"), np.float64).mean(axis=(0, 1)).round()
    return int(red), int(green), int(blue), int(alpha)


def open_image(path: str | Path) -> Any:
    """An image file as an image of pillow's.

    Raises:
        OSError: It cannot be read, or is no file: a pipe would be waited for.
    """
    from PIL import Image

    named_files.check("an image", Path(path), OSError, limit=_IMAGE_MAX)
    return Image.open(path)


def file_mean(path: str | Path) -> tuple[int, int, int, int]:
    """Mean colour of an image file.

    Raises:
        OSError: It cannot be read.
    """
    with open_image(path) as image:
        return image_mean(image)


def from_texture(image: Any, uv: NDArray[Any]) -> Colors:
    """What a texture has where each face lies.

    Args:
        image: An image of pillow's, row 0 on top.
        uv: Places of each face's corners in it, (0, 0) bottom left, (1, 1) top right; it repeats beyond.
            Shape ``(faces, 3, 2)``.

    Returns:
        Shape ``(faces, 4)``.
    """
    texels = np.asarray(image.convert("RGBA"))
    height, width = texels.shape[:2]
    total = np.zeros((len(uv), 4))
    for place in _PLACES:
        across, up = np.einsum("c,fcd->df", place, np.asarray(uv, np.float64))
        columns = np.minimum((np.mod(across, 1) * width).astype(int), width - 1)
        rows = np.minimum((np.mod(1 - up, 1) * height).astype(int), height - 1)
        total += texels[rows, columns]
    return np.round(total / len(_PLACES)).astype(np.uint8)
