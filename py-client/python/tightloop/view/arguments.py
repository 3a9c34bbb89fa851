"""Checks of the arguments of pictures and films."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from tightloop.checks import arguments as checks
from tightloop.errors import ArgumentError
from tightloop.view.cameras import PRESETS, Camera


def check_camera(what: str, camera: Any) -> None:
    """Check a camera: a `Camera`, the name of a preset, or None.

    Raises:
        ArgumentError: It is something else.
    """
    if not (camera is None or isinstance(camera, Camera) or (isinstance(camera, str) and camera in PRESETS)):
        known = ", ".join(PRESETS)
        raise ArgumentError(f"{what}: camera is {camera!r}; give a tightloop.view.Camera or one of: {known}")


def check_size(what: str, size: Any) -> tuple[int, int]:
    """Check width and height [pixels].

    Raises:
        ArgumentError: They are no pair of whole numbers of at least 16.
    """
    if not isinstance(size, Sequence) or isinstance(size, str) or len(size) != 2:
        raise ArgumentError(f"{what}: size is {size!r}; give width and height, such as (640, 480)")
    width, height = (
        checks.integer(f"{what}: size, {name}", pixels, least=16, error=ArgumentError)
        for name, pixels in zip(("width", "height"), size, strict=True)
    )
    return width, height


def check_contacts(what: str, contacts: Any) -> bool | None:
    """Check whether contacts are drawn; None leaves it to the number of worlds.

    Raises:
        ArgumentError: It is no bool.
    """
    return None if contacts is None else checks.flag(f"{what}: contacts", contacts, error=ArgumentError)


def check_worlds(what: str, worlds: Any) -> None:
    """Check a number of worlds, or a list of them; whether they exist is seen later.

    Raises:
        ArgumentError: It is neither.
    """
    if isinstance(worlds, int | np.integer):
        checks.integer(f"{what}: worlds", int(worlds), error=ArgumentError)
        return
    listed = isinstance(worlds, Sequence | np.ndarray | range) and not isinstance(worlds, str)
    if not listed or not len(worlds) or not all(isinstance(world, int | np.integer) for world in worlds):
        raise ArgumentError(f"{what}: worlds is {worlds!r}; give how many, or a list of which ones")
