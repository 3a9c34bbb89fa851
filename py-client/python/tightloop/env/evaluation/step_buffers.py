"""Buffers for the results of a step: new arrays, or a ring of them."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

#: Alignment that torch and JAX take without a copy [bytes].
_ALIGNMENT = 64


#: Observations of all worlds: an array, or arrays by name.
Observations = Any


class StepBuffers:
    """The arrays of one step: ``obs``, ``reward``, ``terminated``, ``truncated``, ``final_obs``.

    Args:
        worlds: Number of worlds.
        observations: Makes arrays for observations of so many worlds.
        dtype: Type of rewards.
    """

    def __init__(self, worlds: int, observations: Callable[[int], Observations], dtype: DTypeLike = np.float32) -> None:
        self._make = lambda: observations(worlds)
        self.obs = self._make()
        self.reward = aligned((worlds,), dtype)
        self.terminated = aligned((worlds,), np.bool_)
        self.truncated = aligned((worlds,), np.bool_)

    @cached_property
    def final_obs(self) -> Observations:
        """Last observations, like ``obs``; made on demand, since most steps end no episode."""
        return self._make()


class BufferRing:
    """BufferRing in turn. A ring's arrays are valid until as many further steps were taken as it has slots."""

    def __init__(
        self,
        worlds: int,
        observations: Callable[[int], Observations],
        count: int,
        dtype: DTypeLike = np.float32,
    ) -> None:
        self._ring = [StepBuffers(worlds, observations, dtype) for _ in range(count)]
        self._index = 0

    def next(self) -> StepBuffers:
        """Return the buffers of the next step."""
        self._index = (self._index + 1) % len(self._ring)
        return self._ring[self._index]


def arrays_of(obs: Observations) -> list[NDArray[Any]]:
    """Return the arrays of observations."""
    return [*obs.values()] if isinstance(obs, dict) else [obs]


def zero(obs: Observations, worlds: NDArray[np.bool_]) -> None:
    """Set the observations of some worlds to 0."""
    for array in arrays_of(obs):
        array[worlds] = 0


def zero_nan(obs: Observations) -> None:
    """Set NaN in observations to 0."""
    for array in arrays_of(obs):
        array[np.isnan(array)] = 0


def with_nan(obs: Observations) -> NDArray[np.bool_]:
    """Return which worlds have NaN in their observations."""
    return np.logical_or.reduce([np.isnan(array).any(axis=tuple(range(1, array.ndim))) for array in arrays_of(obs)])


def aligned(shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
    """Return an uninitialised array that starts at a multiple of 64 bytes."""
    count = int(np.prod(shape)) * np.dtype(dtype).itemsize
    block = np.empty(count + _ALIGNMENT, np.uint8)
    start = -block.ctypes.data % _ALIGNMENT
    return block[start : start + count].view(dtype).reshape(shape)
