"""Writes the animated pictures of the documents."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from PIL import Image


def write(path: Path, images: Sequence[Image.Image], duration: int | Sequence[int], quality: int) -> None:
    """Write an animated WebP that repeats for ever, and print its size.

    Args:
        path: The file.
        images: Its pictures.
        duration: How long each is shown, or all of them [ms].
        quality: From 0 to 100.
    """
    first, *others = images
    first.save(path, save_all=True, append_images=others, duration=duration, loop=0, quality=quality, method=6)
    print(f"{path}: {len(images)} pictures, {path.stat().st_size / 1e3:.0f} kB")
