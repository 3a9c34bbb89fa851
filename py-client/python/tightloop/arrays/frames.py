"""Frames in memory of their own, and the meaning of a frame's ``status``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from numpy.typing import NDArray

from tightloop.checks.attributes import nearest
from tightloop.errors import UnknownField
from tightloop.notebook import frame_html

#: Bits of ``status`` of a faulted world: no longer finite, or beyond the bounds of the run.
FAULTED = 1 | 8


def unknown_field(name: str, carried: Sequence[str], known: Sequence[str]) -> UnknownField:
    """Return the error of a field that a frame does not carry, with the one that is most likely meant.

    Args:
        name: The name that was asked for.
        carried: Fields of the frame.
        known: Fields that frames may carry.
    """
    there = f"frames of this run carry: {', '.join(carried)}"
    if name in known:
        return UnknownField(f"frames carry no `{name}`; add {name!r} to `fields` at launch. The {there}")
    if name.endswith(("_depth", "_segmentation", "_rgb")):
        cure = "images of a camera (`Scene.add_camera`) are fields if `launch(fields=...)` names them"
        return UnknownField(f"frames carry no `{name}`; {cure}. The {there}")
    if near := nearest(name, carried):
        return UnknownField(f"there is no field `{name}`; did you mean `{near[0]}`? The {there}")
    if near := nearest(name, known):
        cure = f"did you mean `{near[0]}`? Add it to `fields` at launch"
        return UnknownField(f"there is no field `{name}`; {cure}. The {there}")
    return UnknownField(f"there is no field `{name}`. The {there}")


class FrameCopy:
    """The arrays of a frame in memory of its own; `Frame.copy` makes it. Its attributes are those of the frame.

    Raises:
        UnknownField: The frame does not carry that field; the message lists the fields it carries.
    """

    def __init__(self, arrays: dict[str, NDArray[Any]], known: Sequence[str] = ()) -> None:
        self.__dict__.update(arrays)
        self._known = known

    @property
    def fields(self) -> list[str]:
        """Names of the fields."""
        return [name for name in self.__dict__ if name[0] != "_"]

    def _repr_html_(self) -> str:
        return frame_html(self)

    def __getattr__(self, name: str) -> NDArray[Any]:
        if name.startswith("_"):
            raise AttributeError(name)
        raise unknown_field(name, self.fields, self._known)
