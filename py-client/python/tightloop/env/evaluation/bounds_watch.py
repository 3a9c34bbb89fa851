"""Watches for observations that are clipped for a large share of steps, which hides them from a policy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.checks import advice
from tightloop.env.observed import Observed

#: Worlds that are looked at, calls that make a window, and of how many later calls one is looked at.
_WORLDS, _WINDOW, _EVERY = 64, 64, 32
#: Share of a window in which a value is beyond its bounds, from which on a warning reports it.
_SHARE = 0.5
#: A value this far beyond its bounds, as a share of their distance, is not rounding.
_SLACK = 1e-3


class BoundsWatch:
    """Counts how often values are beyond the bounds of their part, and tells of each part once.

    Args:
        task: Name of the task, for messages.
        parts: The parts of an observation.
    """

    def __init__(self, task: str, parts: Sequence[Observed]) -> None:
        self._task, self._parts = task, list(parts)
        self._limits = []
        for part in parts:
            low, high = part.bounds.astype(np.float64)
            with np.errstate(invalid="ignore"):
                slack = np.where(np.isfinite(high - low), _SLACK * (high - low), 0.0)
            self._limits.append((low - slack, high + slack))
        self._told: set[int] = set()
        self._calls = 0
        self._begin()

    def _begin(self) -> None:
        self._seen = 0
        self._beyond = [np.zeros(part.size) for part in self._parts]
        self._largest = [np.zeros(part.size) for part in self._parts]

    def look(self, arrays: Sequence[NDArray[Any]]) -> None:
        """Look at the parts of an observation before they are clipped, each ``(worlds,)`` or ``(worlds, size)``."""
        self._calls += 1
        # the first window looks at each call, so that short runs are reported, too
        if self._calls > _WINDOW and self._calls % _EVERY:
            return
        worlds = min(len(arrays[0]), _WORLDS)
        for place, (array, (low, high)) in enumerate(zip(arrays, self._limits, strict=True)):
            if place in self._told:
                continue
            values = np.asarray(array)[:worlds].reshape(worlds, -1)
            beyond = (values < low) | (values > high)
            if beyond.any():
                self._beyond[place] += beyond.mean(axis=0)
                where = np.where(beyond, np.maximum(low - values, values - high), 0.0)
                self._largest[place] = np.maximum(self._largest[place], where.max(axis=0))
        self._seen += 1
        if self._seen == _WINDOW:
            self._tell()
            self._begin()

    def _tell(self) -> None:
        for place, (part, beyond) in enumerate(zip(self._parts, self._beyond, strict=True)):
            share, worst = float(beyond.max()) / self._seen, int(beyond.argmax())
            if share < _SHARE:
                continue
            self._told.add(place)
            value = f"value {worst} of " if part.size > 1 else ""
            low, high = part.bounds[:, worst]
            advice.warn_of_values(
                f"{self._task}.observe: {value}`{part.name}` was beyond its bounds, {low:g} to {high:g}, in "
                f"{share:.0%} of the steps, by up to {self._largest[place][worst]:.3g}, and was clipped, so that a "
                f'policy cannot tell such values apart. Give Observed("{part.name}", …) wider bounds, or scale what '
                "`observe` returns. Wrong units have the same effect"
            )
