"""Packs the parts of an observation into one array."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import DTypeLike, NDArray

from tightloop import _core
from tightloop.env.evaluation.past import Past
from tightloop.env.evaluation.step_buffers import aligned
from tightloop.env.observed import Observed
from tightloop.env.task import Array
from tightloop.errors import ArgumentError

_TYPES = [np.dtype(name) for name in ("f4", "f8", "i4", "i8", "?", "u1")]


class ObservationPacker:
    """Writes the parts that `Task.observe` returns into one array, clipped to the bounds of `Task.observed`.

    Attributes:
        size: Length of an observation, history included.
        space: Observation space of one world.
    """

    def __init__(self, parts: Sequence[Observed], dtype: DTypeLike = np.float32) -> None:
        self._parts = list(parts)
        if not self._parts:
            raise ArgumentError("observed: there is nothing; list the parts of the observation")
        self.size = sum(part.width for part in self._parts)
        self._low, self._high = (
            np.ascontiguousarray(np.concatenate([np.tile(p.bounds[end], p.history) for p in parts])) for end in (0, 1)
        )
        self.space = Box(self._low.astype(dtype), self._high.astype(dtype), dtype=np.dtype(dtype).type)  # pyright: ignore[reportArgumentType]
        # by index of the part, where more than its values now are shown
        self._past: dict[int, Past] = {}

    @property
    def parts(self) -> list[tuple[str, int, int]]:
        """Name, size and history of each part."""
        return [(part.name, part.size, part.history) for part in self._parts]

    def empty(self, worlds: int) -> NDArray[Any]:
        """Return an array for observations of so many worlds, without values."""
        return aligned((worlds, self.size), self.space.dtype)

    def advance(self) -> None:
        """Make the values of the last call those of the step before."""
        for past in self._past.values():
            past.advance()

    def pasts(self, worlds: int) -> dict[int, Past]:
        """Return the memories of parts that have one, by the part's index."""
        if not self._past:
            needed = (index for index, part in enumerate(self._parts) if Past.is_needed(part))
            self._past = {index: Past(self._parts[index], worlds, self.space.dtype) for index in needed}
        return self._past

    def part(self, column: int) -> str:
        """Return the name of the part that has a column."""
        ends = np.cumsum([part.width for part in self._parts])
        return self._parts[int(np.searchsorted(ends, column, side="right"))].name

    def pack(self, arrays: Sequence[Array], out: NDArray[Any], begun: NDArray[np.bool_] | None = None) -> bool:
        """Write the parts into ``out``, shape ``(worlds, size)``; NaN stays NaN. Returns whether any is NaN.

        Args:
            arrays: The parts.
            out: The observations.
            begun: Worlds that begin an episode, whose history begins here.

        Raises:
            ArgumentError: There are more or fewer parts than `Task.observed` lists, or one has another shape.
        """
        if not isinstance(arrays, Sequence):
            got = "one array" if isinstance(arrays, np.ndarray) else type(arrays).__name__
            raise ArgumentError(f"observe: got {got}; return the parts as a tuple")
        if len(arrays) != len(self._parts):
            raise ArgumentError(f"observe: {len(arrays)} parts; `observed` lists {len(self._parts)}")
        for part, array in zip(self._parts, arrays, strict=True):
            if not isinstance(array, np.ndarray) or array.dtype not in _TYPES:
                got = array.dtype if isinstance(array, np.ndarray) else type(array).__name__
                types = "float32, float64, int, uint8 or bool"
                raise ArgumentError(f"observe: `{part.name}` is {got}; give an array of {types}")
            shape = (len(out),) if part.size == 1 and array.ndim == 1 else (len(out), part.size)
            if array.shape not in (shape, (len(out), *(part.shape or ()))):
                shape = (len(out), *(part.shape or (part.size,)))
                raise ArgumentError(f"observe: `{part.name}` has shape {array.shape}; `observed` says {shape}")
        packed = [_plain(array, part, len(out)) for part, array in zip(self._parts, arrays, strict=True)]
        for index, past in self.pasts(len(out)).items():
            packed[index] = past.shown(packed[index].reshape(len(out), -1), begun)
        return _core.pack(out, packed, self._low, self._high)


def _plain(array: NDArray[Any], part: Observed, worlds: int) -> NDArray[Any]:
    """Return a part as `_core.pack` takes it."""
    plain = np.asarray(array) if part.shape is None else np.asarray(array).reshape(worlds, -1)
    return plain.astype(np.float32) if plain.dtype == np.uint8 else plain
