"""The image of a camera of the scene in the followed world."""

from __future__ import annotations

from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from tightloop.view.meshes import paint

OFF = "off"
# Small images are enlarged to about so many columns.
_COLUMNS = 320


def image_fields(info: dict[str, Any]) -> list[str]:
    """Return the fields that are images of cameras."""
    return [field["name"] for field in info["known_fields"] if "height, width" in field["axes"]]


def picture(field: str, values: NDArray[Any]) -> NDArray[np.uint8]:
    """Return an image as colours, ``(height, width, 3)``.

    Args:
        field: Name of the field. Its ending says what the values are.
        values: ``(height, width)`` depths, of which near ones are light, or labels; or ``(height, width, 3)`` colours.
    """
    if field.endswith("_rgb"):
        colors = values
    elif field.endswith("_depth"):
        seen = values > 0
        far = values.max(initial=0.0)
        light = np.where(seen, 255.0 - 215.0 * values / max(far, 1e-9), 0.0)
        colors = np.repeat(np.rint(light).astype(np.uint8)[..., None], 3, axis=2)
    else:
        table = np.array([(0, 0, 0), *(paint.palette(label)[:3] for label in range(values.max(initial=-1) + 1))])
        colors = table[values + 1].astype(np.uint8)
    factor = max(1, _COLUMNS // values.shape[1])
    return np.repeat(np.repeat(colors, factor, axis=0), factor, axis=1)


class CameraImage:
    """A control that chooses an image, and the image below it.

    Args:
        gui: GUI that holds them.
        fields: Fields to choose from.
    """

    def __init__(self, gui: viser.GuiApi, fields: list[str]) -> None:
        self._choice = gui.add_dropdown("Image", (OFF, *fields), initial_value=OFF)
        self._image = gui.add_image(np.zeros((8, 8, 3), np.uint8), visible=False)

    @property
    def field(self) -> str | None:
        """The field that is chosen, or None."""
        return None if self._choice.value == OFF else self._choice.value

    def drop(self) -> None:
        """Choose no image."""
        self._choice.value = OFF

    def show(self, shown: Any, world: int) -> None:
        """Send the image of a world in a frame. It is hidden if none is chosen, or the frame does not have it yet."""
        field = self.field
        is_there = field is not None and hasattr(shown, field)
        if field is not None and is_there:
            self._image.image = picture(field, np.asarray(getattr(shown, field)[world]))
        if self._image.visible != is_there:
            self._image.visible = is_there
