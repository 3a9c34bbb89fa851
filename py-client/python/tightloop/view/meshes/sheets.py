"""Sheets of square fields, which stand for planes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.view.meshes import paint

Color = tuple[int, int, int, int]

# Edge of the sheet that is shown of a larger plane, and of one of its fields [m].
_SHEET = 10.0
_FIELD = 0.5
# How much lighter and darker than the plane its fields are [–].
_CONTRAST = 0.07


def fields(color: Color | None) -> tuple[Color, Color]:
    """The two colours of fields whose mean is this colour."""
    if color is None:
        return paint.CHECKERS
    light, dark = (
        tuple(min(round(part * factor), 255) for part in color[:3]) for factor in (1 + _CONTRAST, 1 - _CONTRAST)
    )
    return (light[0], light[1], light[2], color[3]), (dark[0], dark[1], dark[2], color[3])


def checkers(
    half_extents: Sequence[float | None], colors: tuple[Color, Color]
) -> tuple[NDArray[np.float32], NDArray[np.uint32], NDArray[np.uint8]]:
    """A sheet around the origin, seen from above and from below.

    Args:
        half_extents: Half of each edge [m]; None for no end.
        colors: Colours of the fields.

    Returns:
        Vertices [m], corners of faces, and colours of faces, shapes ``(vertices, 3)``, ``(faces, 3)``, ``(faces, 4)``.
    """
    edges = [_edges(_SHEET / 2 if half is None else min(half, _SHEET / 2)) for half in half_extents]
    x, y = np.meshgrid(*edges, indexing="ij")
    vertices = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3).astype(np.float32)
    counts = [len(edge) - 1 for edge in edges]
    row, column = (index.ravel() for index in np.meshgrid(*map(np.arange, counts), indexing="ij"))
    corner = row * (counts[1] + 1) + column
    beyond = corner + counts[1] + 1
    faces = np.stack([corner, beyond, beyond + 1, corner, beyond + 1, corner + 1], axis=-1).reshape(-1, 3)
    painted = np.array(colors, np.uint8)[np.repeat((row + column) % 2, 2)]
    return vertices, faces.astype(np.uint32), painted


def _edges(half: float) -> NDArray[Any]:
    """Where fields begin and end along an edge: an even number of equal ones."""
    return np.linspace(-half, half, 2 * max(round(half / _FIELD), 1) + 1)
