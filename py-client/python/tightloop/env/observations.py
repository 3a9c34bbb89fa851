"""Packs the parts of an observation into one array."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from tightloop import _core
from tightloop.env.task import Array, Observed
from tightloop.errors import ArgumentError

_TYPES = [np.dtype(name) for name in ("f4", "f8", "i4", "i8", "?")]


class ObservationPacker:
    """Writes the parts that `Task.observe` returns into one array, clipped to the bounds of `Task.observed`.

    Attributes:
        size: Length of an observation.
        space: Observation space of one world.
    """

    def __init__(self, parts: Sequence[Observed]) -> None:
        self._parts = list(parts)
        if not self._parts:
            raise ArgumentError("observed: there is nothing; list the parts of the observation")
        self.size = sum(part.size for part in self._parts)
        self._low, self._high = (np.ascontiguousarray(np.concatenate([p.bounds[end] for p in parts])) for end in (0, 1))
        self.space = Box(self._low, self._high, dtype=np.float32)

    def part(self, column: int) -> str:
        """Return the name of the part that has a column."""
        ends = np.cumsum([part.size for part in self._parts])
        return self._parts[int(np.searchsorted(ends, column, side="right"))].name

    def pack(self, arrays: Sequence[Array], out: NDArray[np.float32]) -> bool:
        """Write the parts into ``out``, shape ``(worlds, size)``; NaN stays NaN. Returns whether any is NaN.

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
        return _core.pack(out, [np.asarray(array) for array in arrays], self._low, self._high)
