"""What pictures are kept as: PNG files, a GIF, an MP4."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tightloop.errors import ArgumentError
from tightloop.view import needs

Pixels = NDArray[np.uint8]

# Quality of H.264, less is better: at 20 hardly anybody sees a difference.
_QUALITY = "20"
# A GIF counts hundredths of a second.
_GIF_TICKS = 100
# Files are numbered in their names' order up to this many.
_DIGITS = 6


class Roll(Protocol):
    """Takes pictures one after the other."""

    def add(self, pixels: Pixels) -> None:
        """Keep a picture, shape ``(height, width, 3)``."""
        ...

    def close(self) -> None:
        """Finish the file."""
        ...


class Png:
    """One picture: the first."""

    def __init__(self, path: Path) -> None:
        needs.check("PIL")
        self._path = path
        self._done = False

    def add(self, pixels: Pixels) -> None:
        """Write it; later ones are left out."""
        if not self._done:
            _image(pixels).save(self._path)
            self._done = True

    def close(self) -> None:
        """Nothing is left to do."""


class Pngs:
    """A folder of pictures, ``000000.png`` and so on.

    Raises:
        ArgumentError: The folder has files in it.
    """

    def __init__(self, folder: Path) -> None:
        needs.check("PIL")
        folder.mkdir(parents=True, exist_ok=True)
        there = next(folder.iterdir(), None)
        if there is not None:
            raise ArgumentError(f"film: {folder} has files in it, such as {there.name}; give a new folder")
        self._folder = folder
        self._count = 0

    def add(self, pixels: Pixels) -> None:
        """Write the next file."""
        _image(pixels).save(self._folder / f"{self._count:0{_DIGITS}}.png")
        self._count += 1

    def close(self) -> None:
        """Nothing is left to do."""


class Gif:
    """A GIF with the 256 colours of its first picture, which runs for ever."""

    def __init__(self, path: Path, fps: float) -> None:
        needs.check("PIL")
        self._path = path
        self._fps = fps
        self._images: list[Any] = []

    def add(self, pixels: Pixels) -> None:
        """Keep a picture until `close`: a byte a pixel."""
        image = _image(pixels)
        # colours of each picture's own would flicker
        palette = self._images[0] if self._images else None
        self._images.append(image.quantize(256) if palette is None else image.quantize(palette=palette, dither=0))

    def close(self) -> None:
        """Write the file."""
        if not self._images:
            return
        # ends of pictures are rounded, not their lengths, so that it keeps the pace
        ends = [round(_GIF_TICKS * (number + 1) / self._fps) for number in range(len(self._images))]
        durations = np.diff([0, *ends]) * (1000 // _GIF_TICKS)
        first, *rest = self._images
        first.save(
            self._path,
            save_all=True,
            append_images=rest,
            duration=[int(duration) for duration in durations],
            loop=0,
            optimize=False,
        )


class Mp4:
    """H.264 in an MP4, as every browser and player shows it.

    Raises:
        ArgumentError: A side of the pictures is odd, which its colours cannot have.
    """

    def __init__(self, path: Path, fps: float, size: tuple[int, int]) -> None:
        if size[0] % 2 or size[1] % 2:
            raise ArgumentError(f"film: size is {size[0]}x{size[1]}; an MP4 has even sides")
        needs.check("av")
        import av

        # readers see the frames' times before the frames
        self._container = av.open(str(path), "w", options={"movflags": "+faststart"})
        self._stream = self._container.add_stream("libx264", rate=Fraction(fps).limit_denominator(1001))
        self._stream.width, self._stream.height = size
        self._stream.pix_fmt = "yuv420p"
        self._stream.options = {"crf": _QUALITY, "preset": "medium"}

    def add(self, pixels: Pixels) -> None:
        """Encode a picture."""
        import av

        frame = av.VideoFrame.from_ndarray(pixels, format="rgb24")
        self._container.mux(self._stream.encode(frame))

    def close(self) -> None:
        """Encode what is left, and finish the file."""
        self._container.mux(self._stream.encode(None))
        self._container.close()


def _image(pixels: Pixels) -> Any:
    from PIL import Image

    return Image.fromarray(pixels)
