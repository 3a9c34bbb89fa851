"""The simulations of a call."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tightloop.errors import ArgumentError


class Selection:
    """Simulations by sorted unique indices or by a mask.

    Args:
        ids: Integers, a bool mask ``(num_sims,)``, or None for all.
        num_sims: Number of simulations.

    Attributes:
        indices: The simulations, int64.
        mask: The same as a mask ``(num_sims,)``.
        ids: What indexes arrays: a slice if all are chosen.

    Raises:
        ArgumentError: The indices are not sorted, not unique, out of range or no integers.
    """

    def __init__(self, ids: ArrayLike | None, num_sims: int) -> None:
        self.mask = np.ones(num_sims, bool)
        if ids is not None:
            self._choose(np.asarray(ids), num_sims)
        self.indices: NDArray[np.int64] = np.flatnonzero(self.mask)
        self.ids: Any = slice(None) if len(self.indices) == num_sims else self.indices

    def _choose(self, given: NDArray[Any], num_sims: int) -> None:
        if given.ndim != 1 or (given.dtype.kind not in "iub" and given.size):
            raise ArgumentError("ids must be integers or a bool mask, with one axis")
        if given.dtype == np.bool_:
            if len(given) != num_sims:
                raise ArgumentError(f"ids: the mask has {len(given)} entries; give {num_sims}")
            self.mask = given.copy()
            return
        given = given.astype(np.int64)
        if given.size and (given[0] < 0 or given[-1] >= num_sims or (np.diff(given) <= 0).any()):
            raise ArgumentError(f"ids must be sorted, unique and between 0 and {num_sims - 1}")
        self.mask = np.zeros(num_sims, bool)
        self.mask[given] = True

    def __len__(self) -> int:
        return len(self.indices)
