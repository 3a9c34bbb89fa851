"""Values of an observation's part in the steps before, where it has a history or comes late."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from tightloop.env.observed import Observed


class Past:
    """The last values of a part, of which observations hold some.

    Args:
        part: The part.
        worlds: Number of worlds.
        dtype: Type of the values.
    """

    def __init__(self, part: Observed, worlds: int, dtype: DTypeLike) -> None:
        self._least, self._longest = part.delays
        self._history = part.history
        # the oldest first
        self._rows = np.zeros((worlds, part.history + self._longest, part.size), dtype)
        self._delay = np.full(worlds, self._least)
        self._anew = np.zeros(worlds, bool)

    @property
    def varies(self) -> bool:
        """Whether the delay is drawn."""
        return self._least < self._longest

    @staticmethod
    def is_needed(part: Observed) -> bool:
        """Whether observations hold more of a part than its values now."""
        return part.history > 1 or part.delays[1] > 0

    def restart(self, rows: NDArray[np.intp]) -> None:
        """Take the next values of some worlds for those before as well."""
        self._anew[rows] = True

    def advance(self) -> None:
        """Make the values of the last call those of the step before."""
        self._rows[:, :-1] = self._rows[:, 1:]

    def draw(self, rows: NDArray[np.intp], draws: NDArray[np.float32]) -> None:
        """Choose the delays of worlds that begin an episode, by uniform random numbers in [0, 1)."""
        self._delay[rows] = self._least + np.floor(draws * (self._longest - self._least + 1)).astype(np.intp)

    def shown(self, now: NDArray[Any], begun: NDArray[np.bool_] | None) -> NDArray[Any]:
        """Return what observations hold, shape ``(worlds, width)``.

        Args:
            now: Values now, shape ``(worlds, size)``.
            begun: Worlds that begin an episode, for which these were the values before as well.
        """
        rows = self._rows
        rows[:, -1] = now
        anew = self._anew if begun is None else self._anew | begun
        if anew.any():
            rows[anew] = now[anew, None]
            self._anew[:] = False
        if self._longest:
            last = rows.shape[1] - 1 - self._delay
            places = last[:, None] + np.arange(1 - self._history, 1)
            rows = rows[np.arange(len(rows))[:, None], places]
        return rows.reshape(len(rows), -1)
