"""Texts in the files of exported models, which have numbers alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def as_bytes(given: list[str]) -> NDArray[np.uint8]:
    """Return texts as bytes, each with a 0 at its end."""
    return np.frombuffer(b"".join(text.encode() + b"\0" for text in given), np.uint8)


def texts(given: NDArray[np.uint8]) -> list[str]:
    """Return texts of which `as_bytes` made bytes."""
    return [text.decode() for text in given.tobytes().split(b"\0")[:-1]]
