"""Packs the parts of an observation into a dict: images by name, and all other parts in one array."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Dict, Space
from numpy.typing import DTypeLike, NDArray

from tightloop.env.evaluation.observations import ObservationPacker
from tightloop.env.evaluation.past import Past
from tightloop.env.evaluation.step_buffers import aligned
from tightloop.env.observed import Observed
from tightloop.env.task import Array
from tightloop.errors import ArgumentError

#: The entry with the parts that have no shape.
STATE = "state"
#: Bounds of images of bytes.
_BYTES = (0.0, 255.0)


class DictPacker:
    """Writes the parts that `Task.observe` returns into the arrays of a dict.

    Parts with a shape are arrays of their own, ``(worlds, *shape)``, or ``(worlds, history, *shape)`` with a history:
    uint8 if their bounds are 0 and 255, else float32. The others are in ``state``, as in observations that are one
    array.

    Attributes:
        space: Observation space of one world.
    """

    def __init__(self, parts: Sequence[Observed], dtype: DTypeLike = np.float32) -> None:
        self._parts, self._of_state = list(parts), [place for place, part in enumerate(parts) if part.shape is None]
        self._images = {part.name: (place, part) for place, part in enumerate(parts) if part.shape is not None}
        if len(self._images) + len(self._of_state) != len(self._parts) or STATE in self._images:
            raise ArgumentError(f"observed: in a dict, images need names of their own, other than {STATE!r}")
        self._packers: dict[str, ObservationPacker | _BytePacker] = {}
        spaces: dict[str, Space[Any]] = {}
        if self._of_state:
            state = self._packers[STATE] = ObservationPacker([parts[place] for place in self._of_state], dtype)
            spaces[STATE] = state.space
        for name, (_, part) in self._images.items():
            packer = self._packers[name] = _BytePacker(part) if _is_of_bytes(part) else ObservationPacker([part])
            shape = shape_of(part)
            low, high = (end.reshape(shape) for end in (packer.space.low, packer.space.high))
            spaces[name] = Box(low, high, dtype=packer.space.dtype.type)  # pyright: ignore[reportArgumentType, reportOptionalMemberAccess]

        self.space = Dict(spaces)

    @property
    def parts(self) -> list[tuple[str, int, int]]:
        """Name, size and history of each part."""
        return [(part.name, part.size, part.history) for part in self._parts]

    def empty(self, worlds: int) -> dict[str, NDArray[Any]]:
        """Return arrays for observations of so many worlds, without values."""
        made: dict[str, NDArray[Any]] = {}
        for name, packer in self._packers.items():
            shape = self.space[name].shape or ()
            made[name] = aligned((worlds, *shape), packer.space.dtype)
        return made

    def advance(self) -> None:
        """Make the values of the last call those of the step before."""
        for packer in self._packers.values():
            packer.advance()

    def pasts(self, worlds: int) -> dict[int, Past]:
        """Return the memories of parts that have one, by the part's index."""
        pasts: dict[int, Past] = {}
        for name, packer in self._packers.items():
            places = self._of_state if name == STATE else [self._images[name][0]]
            pasts |= {places[index]: past for index, past in packer.pasts(worlds).items()}
        return dict(sorted(pasts.items()))

    def part(self, name: str, column: int) -> str:
        """Return the name of the part that has a column of an entry."""
        packer = self._packers[name]
        return packer.part(column) if isinstance(packer, ObservationPacker) else name

    def pack(
        self, arrays: Sequence[Array], out: dict[str, NDArray[Any]], begun: NDArray[np.bool_] | None = None
    ) -> bool:
        """Write the parts into ``out``; NaN stays NaN. Returns whether any is NaN.

        Args:
            arrays: The parts.
            out: The observations.
            begun: Worlds that begin an episode, whose history begins here.

        Raises:
            ArgumentError: There are more or fewer parts than `Task.observed` lists, or one has another shape or type.
        """
        if not isinstance(arrays, Sequence) or len(arrays) != len(self._parts):
            kind = "one array" if isinstance(arrays, np.ndarray) else type(arrays).__name__
            got = f"{len(arrays)} parts" if isinstance(arrays, Sequence) else kind
            raise ArgumentError(f"observe: got {got}; return a tuple of the {len(self._parts)} parts of `observed`")
        spoiled = False
        if self._of_state:
            spoiled |= self._packers[STATE].pack([arrays[place] for place in self._of_state], out[STATE], begun)
        for name, (place, _) in self._images.items():
            array = out[name]
            spoiled |= self._packers[name].pack([arrays[place]], array.reshape(len(array), -1), begun)
        return spoiled


class _BytePacker:
    """Writes an image of bytes, like `ObservationPacker`."""

    def __init__(self, part: Observed) -> None:
        self._part = part
        width = part.width
        self.space = Box(np.zeros(width, np.uint8), np.full(width, 255, np.uint8), dtype=np.uint8)
        self._past: Past | None = None

    def advance(self) -> None:
        if self._past is not None:
            self._past.advance()

    def pasts(self, worlds: int) -> dict[int, Past]:
        if self._past is None and Past.is_needed(self._part):
            self._past = Past(self._part, worlds, np.uint8)
        return {} if self._past is None else {0: self._past}

    def pack(self, arrays: Sequence[Array], out: NDArray[np.uint8], begun: NDArray[np.bool_] | None = None) -> bool:
        part, (array,), count = self._part, arrays, len(out)
        if not isinstance(array, np.ndarray) or array.dtype != np.uint8:
            got = array.dtype if isinstance(array, np.ndarray) else type(array).__name__
            raise ArgumentError(f"observe: `{part.name}` is {got}; its bounds are 0 and 255: give an array of uint8")
        if array.shape not in ((count, part.size), (count, *(part.shape or ()))):
            expected = (count, *(part.shape or ()))
            raise ArgumentError(f"observe: `{part.name}` has shape {array.shape}; `observed` says {expected}")
        now = np.asarray(array).reshape(count, part.size)
        for past in self.pasts(count).values():
            now = past.shown(now, begun)
        out[:] = now
        return False


def shape_of(part: Observed) -> tuple[int, ...]:
    """Return the shape of an image in a dict, with its history in front if it has one."""
    return (*([part.history] if part.history > 1 else []), *(part.shape or ()))


def _is_of_bytes(part: Observed) -> bool:
    return bool((part.bounds == np.array(_BYTES, np.float32)[:, None]).all())
