"""Frames in memory of their own, and the meaning of a frame's ``status``."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from tightloop.errors import UnknownField

#: Bits of ``status`` of a faulted world: no longer finite, or beyond the bounds of the run.
FAULTED = 1 | 8


class FrameCopy:
    """The arrays of a frame in memory of its own; `Frame.copy` makes it. Its attributes are those of the frame.

    Raises:
        UnknownField: The frame does not carry that field; the message lists the fields it carries.
    """

    def __init__(self, arrays: dict[str, NDArray[Any]]) -> None:
        self.__dict__.update(arrays)

    def __getattr__(self, name: str) -> NDArray[Any]:
        raise UnknownField(f"this frame carries no field {name!r}; it carries: {', '.join(self.__dict__)}")
