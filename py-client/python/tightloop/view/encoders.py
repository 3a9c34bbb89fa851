"""Encoders of pictures: PNG files, a GIF, an MP4."""

from __future__ import annotations

import contextlib
from fractions import Fraction
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tightloop.errors import ArgumentError
from tightloop.view import dependencies
from tightloop.whole_files import WholeFile, whole_file

Pixels = NDArray[np.uint8]

# CRF of H.264: lower is better, and 20 is visually close to lossless.
_QUALITY = "20"
# A GIF's time unit is 1/100 s.
_GIF_TICKS = 100
# Digits of file numbers, so that names sort in order.
_DIGITS = 6


class Encoder(Protocol):
    """Writes pictures one after the other."""

    def add(self, pixels: Pixels) -> None:
        """Add a picture, shape ``(height, width, 3)``."""
        ...

    def close(self) -> None:
        """Finish the file."""
        ...

    def discard(self) -> None:
        """Leave no file; one that was there stays."""
        ...


class PngFile:
    """One PNG file of the first picture."""

    def __init__(self, path: Path) -> None:
        dependencies.check("PIL")
        self._path = path
        self._done = False

    def add(self, pixels: Pixels) -> None:
        """Write the first picture; ignore later ones."""
        if not self._done:
            with whole_file(self._path) as part:
                _image(pixels).save(part)
            self._done = True

    def close(self) -> None:
        """Do nothing: the picture is already written."""

    def discard(self) -> None:
        """Do nothing: the picture is already written."""


class PngFolder:
    """A folder of PNG files, ``000000.png`` and so on.

    Raises:
        ArgumentError: The folder has files in it.
    """

    def __init__(self, folder: Path) -> None:
        dependencies.check("PIL")
        folder.mkdir(parents=True, exist_ok=True)
        there = next(folder.iterdir(), None)
        if there is not None:
            raise ArgumentError(f"film: {folder} has files in it, such as {there.name}; give a new folder")
        self._folder = folder
        self._count = 0

    def add(self, pixels: Pixels) -> None:
        """Write the next file."""
        # a wait for the disk after each picture would take longer than the picture
        with whole_file(self._folder / f"{self._count:0{_DIGITS}}.png", durable=False) as part:
            _image(pixels).save(part)
        self._count += 1

    def close(self) -> None:
        """Do nothing: each picture is already written."""

    def discard(self) -> None:
        """Do nothing: each picture is already written, and is whole."""


class GifEncoder:
    """An endless GIF with the 256 colours of its first picture."""

    def __init__(self, path: Path, fps: float) -> None:
        dependencies.check("PIL")
        self._path = path
        self._fps = fps
        self._images: list[Any] = []

    def add(self, pixels: Pixels) -> None:
        """Keep a picture until `close`, one byte per pixel."""
        image = _image(pixels)
        # a palette per picture would flicker
        palette = self._images[0] if self._images else None
        self._images.append(image.quantize(256) if palette is None else image.quantize(palette=palette, dither=0))

    def close(self) -> None:
        """Write the file."""
        if not self._images:
            return
        # the ends of pictures are rounded, not their durations, so that errors do not add up
        ends = [round(_GIF_TICKS * (number + 1) / self._fps) for number in range(len(self._images))]
        durations = np.diff([0, *ends]) * (1000 // _GIF_TICKS)
        first, *rest = self._images
        with whole_file(self._path) as part:
            first.save(
                part,
                save_all=True,
                append_images=rest,
                duration=[int(duration) for duration in durations],
                loop=0,
                optimize=False,
            )

    def discard(self) -> None:
        """Do nothing: nothing is written before `close`."""


class Mp4Encoder:
    """An MP4 file with H.264, which every browser and player shows.

    Raises:
        ArgumentError: A side of the pictures is odd, which the 4:2:0 colour format does not allow.
    """

    def __init__(self, path: Path, fps: float, size: tuple[int, int]) -> None:
        if size[0] % 2 or size[1] % 2:
            raise ArgumentError(f"film: size is {size[0]}x{size[1]}; an MP4 has even sides")
        dependencies.check("av")
        import av

        self._file = WholeFile(path)
        # the index comes first, so that playback can start during download
        self._container = av.open(str(self._file.part), "w", options={"movflags": "+faststart"})
        self._stream = self._container.add_stream("libx264", rate=Fraction(fps).limit_denominator(1001))
        self._stream.width, self._stream.height = size
        self._stream.pix_fmt = "yuv420p"
        self._stream.options = {"crf": _QUALITY, "preset": "medium"}

    def add(self, pixels: Pixels) -> None:
        """Encode a picture."""
        import av

        frame = av.VideoFrame.from_ndarray(pixels, format="rgb24")
        with self._file.writing():
            self._container.mux(self._stream.encode(frame))

    def close(self) -> None:
        """Encode the remaining frames, and finish the file."""
        with self._file.writing():
            self._container.mux(self._stream.encode(None))
            self._container.close()
        self._file.keep()

    def discard(self) -> None:
        """Remove what was encoded."""
        with contextlib.suppress(OSError):
            self._container.close()
        self._file.discard()


def _image(pixels: Pixels) -> Any:
    from PIL import Image

    return Image.fromarray(pixels)
