"""Fields that are images: ``NAME_rgb``, ``NAME_depth`` and ``NAME_segmentation``, as cameras make them."""

from __future__ import annotations

import io
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tightloop.datasets import libraries
from tightloop.errors import ArgumentError

ImageKind = Literal["rgb", "depth", "segmentation"]
#: Type of an entry, and axes without those of worlds and times.
_LAYOUTS: dict[str, tuple[type[np.generic], int]] = {
    "rgb": (np.uint8, 3),
    "depth": (np.float32, 2),
    "segmentation": (np.int32, 2),
}


def image_kind(field: str) -> ImageKind | None:
    """Return what a field shows of a camera; None if it is no image."""
    camera, _, kind = field.rpartition("_")
    match kind:
        case "rgb" | "depth" | "segmentation" if camera:
            return kind
    return None


def camera_name(field: str) -> str:
    """Return the name of an image's camera."""
    return field.rpartition("_")[0]


def check_image(field: str, values: NDArray[Any]) -> None:
    """Check the type and the axes of images.

    Args:
        field: Name of the field.
        values: ``(steps, height, width)``, and 3 channels for colours.

    Raises:
        ArgumentError: They are others than the field's name says.
    """
    dtype, axes = _LAYOUTS[field.rpartition("_")[2]]
    if values.dtype != dtype or values.ndim != 1 + axes:
        raise ArgumentError(
            f"export: field {field} is {values.dtype} of shape {values.shape}; images of that name are "
            f"{np.dtype(dtype)} with {axes} axes behind the steps"
        )


def png(pixels: NDArray[np.uint8]) -> bytes:
    """Return an image as the bytes of a PNG file.

    Args:
        pixels: ``(height, width, 3)``.

    Raises:
        MissingLibrary: Pillow is not installed.
    """
    image = libraries.load("PIL.Image")
    to = io.BytesIO()
    # the fastest level: a learner reads images more often than it stores them
    image.fromarray(pixels).save(to, "PNG", compress_level=1)
    return to.getvalue()
