"""Frames in memory of their own, and the meaning of a frame's ``status``."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from tightloop.errors import UnknownField
from tightloop.notebook import frame_html

#: Bits of ``status`` of a faulted world: no longer finite, or beyond the bounds of the run.
FAULTED = 1 | 8


class FrameCopy:
    """The arrays of a frame in memory of its own; `Frame.copy` makes it. Its attributes are those of the frame.

    Raises:
        UnknownField: The frame does not carry that field; the message lists the fields it carries.
    """

    def __init__(self, arrays: dict[str, NDArray[Any]]) -> None:
        self.__dict__.update(arrays)

    @property
    def fields(self) -> list[str]:
        """Names of the fields."""
        return [*self.__dict__]

    def _repr_html_(self) -> str:
        return frame_html(self)

    def __getattr__(self, name: str) -> NDArray[Any]:
        if name.startswith("_"):
            raise AttributeError(name)
        raise UnknownField(f"this frame carries no field {name!r}; it carries: {', '.join(self.__dict__)}")
