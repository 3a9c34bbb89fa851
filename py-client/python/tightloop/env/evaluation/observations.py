"""Packs the parts of an observation into one array."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import DTypeLike, NDArray

from tightloop import _core
from tightloop.env.task import Array, Observed
from tightloop.errors import ArgumentError

_TYPES = [np.dtype(name) for name in ("f4", "f8", "i4", "i8", "?")]


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
        # values of the steps before, the oldest first, and those of the last call, by index of the part
        self._past: dict[int, NDArray[np.float32]] = {}
        self._last: dict[int, NDArray[np.float32]] = {}
        self._has_history = any(part.history > 1 for part in self._parts)

    @property
    def parts(self) -> list[tuple[str, int, int]]:
        """Name, size and history of each part."""
        return [(part.name, part.size, part.history) for part in self._parts]

    def advance(self) -> None:
        """Make the values of the last call those of the step before."""
        for index, past in self._past.items():
            past[:, :-1] = past[:, 1:]
            past[:, -1] = self._last[index]

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
                raise ArgumentError(f"observe: `{part.name}` is {got}; give an array of float32, float64, int or bool")
            shape = (len(out),) if part.size == 1 and array.ndim == 1 else (len(out), part.size)
            if array.shape != shape:
                raise ArgumentError(f"observe: `{part.name}` has shape {array.shape}; `observed` says {shape}")
        packed = [np.asarray(array) for array in arrays]
        if self._has_history:
            self._add_history(packed, begun)
        return _core.pack(out, packed, self._low, self._high)

    def _add_history(self, packed: list[NDArray[Any]], begun: NDArray[np.bool_] | None) -> None:
        """Put the steps before in front of the parts that have a history."""
        for index, part in enumerate(self._parts):
            if part.history == 1:
                continue
            worlds = len(packed[index])
            if index not in self._past:
                self._past[index] = np.zeros((worlds, part.history - 1, part.size), np.float32)
                self._last[index] = np.zeros((worlds, part.size), np.float32)
            past, last = self._past[index], self._last[index]
            last[:] = packed[index].reshape(last.shape)
            if begun is not None:
                past[begun] = last[begun, None]
            packed[index] = np.concatenate([past.reshape(worlds, -1), last], axis=1)
