"""Buffers for the results of a step: new arrays, or a ring of them."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

#: Alignment that torch and JAX take without a copy [bytes].
_ALIGNMENT = 64


class StepBuffers:
    """The arrays of one step: ``obs`` ``(worlds, size)``, ``reward``, ``terminated``, ``truncated``, ``final_obs``."""

    def __init__(self, worlds: int, size: int, dtype: DTypeLike = np.float32) -> None:
        self.obs = aligned((worlds, size), dtype)
        self.reward = aligned((worlds,), dtype)
        self.terminated = aligned((worlds,), np.bool_)
        self.truncated = aligned((worlds,), np.bool_)

    @cached_property
    def final_obs(self) -> NDArray[Any]:
        """Last observations, like ``obs``; made on demand, since most steps end no episode."""
        return aligned(self.obs.shape, self.obs.dtype)


class BufferRing:
    """BufferRing in turn. A ring's arrays are valid until as many further steps were taken as it has slots."""

    def __init__(self, worlds: int, size: int, count: int, dtype: DTypeLike = np.float32) -> None:
        self._ring = [StepBuffers(worlds, size, dtype) for _ in range(count)]
        self._index = 0

    def next(self) -> StepBuffers:
        """Return the buffers of the next step."""
        self._index = (self._index + 1) % len(self._ring)
        return self._ring[self._index]


def aligned(shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
    """Return an uninitialised array that starts at a multiple of 64 bytes."""
    count = int(np.prod(shape)) * np.dtype(dtype).itemsize
    block = np.empty(count + _ALIGNMENT, np.uint8)
    start = -block.ctypes.data % _ALIGNMENT
    return block[start : start + count].view(dtype).reshape(shape)
