"""Where a step's results go: new arrays, or the slots of a ring."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

#: What torch and JAX take without a copy [bytes].
_ALIGNMENT = 64


class Slot:
    """Arrays of one step: ``obs`` (worlds, size), ``reward``, ``terminated``, ``truncated``, and ``final_obs``."""

    def __init__(self, worlds: int, size: int) -> None:
        self.obs = aligned((worlds, size), np.float32)
        self.reward = aligned((worlds,), np.float32)
        self.terminated = aligned((worlds,), np.bool_)
        self.truncated = aligned((worlds,), np.bool_)

    @cached_property
    def final_obs(self) -> NDArray[np.float32]:
        """Like ``obs``; most steps end no episode, and need none."""
        return aligned(self.obs.shape, np.float32)


class Slots:
    """Slots in turn. A ring's arrays are valid until as many further steps were taken as it has slots."""

    def __init__(self, worlds: int, size: int, count: int) -> None:
        self._ring = [Slot(worlds, size) for _ in range(count)]
        self._turn = 0

    def next(self) -> Slot:
        """The slot of the next step."""
        self._turn = (self._turn + 1) % len(self._ring)
        return self._ring[self._turn]


def aligned(shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
    """An array whose first byte lies at a multiple of 64; its numbers are whatever they are."""
    count = int(np.prod(shape)) * np.dtype(dtype).itemsize
    block = np.empty(count + _ALIGNMENT, np.uint8)
    start = -block.ctypes.data % _ALIGNMENT
    return block[start : start + count].view(dtype).reshape(shape)
