"""Rewards as a weighted sum of named terms, each logged per episode."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.checks.attributes import suggestion
from tightloop.env.task import Task
from tightloop.errors import ArgumentError

#: Names of the sums in ``infos`` begin with this.
PREFIX = "return/"


class RewardTerms:
    """Adds up the terms of a task's reward.

    Attributes:
        is_used: Whether the task defines `Task.reward_terms`, and not `Task.reward` itself.
        now: Weighted terms of the last step by name, each of shape ``(worlds,)``.
    """

    def __init__(self, task: Task, worlds: int) -> None:
        kind = type(task)
        self.is_used = kind.reward_terms is not Task.reward_terms and kind.reward is Task.reward
        self._what, self._weights = f"{kind.__name__}.reward_terms", task.reward_weights
        self._worlds = worlds
        self._sums: dict[str, NDArray[np.float32]] = {}
        self._term = np.empty(worlds, np.float32)
        self.now: dict[str, NDArray[np.float32]] = {}

    def add(self, terms: Any, out: NDArray[Any]) -> None:
        """Write the reward of a step, shape ``(worlds,)``.

        Raises:
            ArgumentError: The terms are no dict of arrays by name, or the names are not those of the weights.
        """
        if not self.now:
            self._check(terms)
            self.now = {name: np.zeros(self._worlds, np.float32) for name in terms}
            self._sums = {name: np.zeros(self._worlds, np.float32) for name in terms}
        out[:] = 0.0
        for name, value in terms.items():
            now = self.now[name]
            np.multiply(value, self._weights[name], out=now, casting="same_kind")
            out += now

    def count(self, worlds: NDArray[np.bool_]) -> None:
        """Add the step to the sums of some worlds; a term that is no number counts as 0."""
        for name, now in self.now.items():
            np.nan_to_num(now, copy=False, posinf=0.0, neginf=0.0)
            np.add(self._sums[name], now, out=self._sums[name], where=worlds)

    def end(self, ended: NDArray[np.bool_], infos: dict[str, Any]) -> None:
        """Write the sums of episodes that ended into ``infos``, and begin them again."""
        if not ended.any():
            return
        for name, total in self._sums.items():
            infos[PREFIX + name], infos[f"_{PREFIX}{name}"] = np.where(ended, total, np.float32(0.0)), ended.copy()
            total[ended] = 0.0

    def begin(self, mask: NDArray[np.bool_]) -> None:
        """Begin the sums of worlds that are reset."""
        for total in self._sums.values():
            total[mask] = 0.0

    def _check(self, terms: Any) -> None:
        if not isinstance(terms, Mapping) or not terms:
            raise ArgumentError(f"{self._what}: got {terms!r:.60}; return a dict of arrays by name")
        for name in terms.keys() - self._weights.keys():
            raise ArgumentError(
                f"{self._what}: {name!r} has no weight in reward_weights; {suggestion(name, self._weights)}"
            )
        for name in self._weights.keys() - terms.keys():
            raise ArgumentError(
                f"{self._what}: reward_weights has {name!r}, which is not returned; return it or drop it"
            )
        for name, value in terms.items():
            if getattr(value, "shape", None) != (self._worlds,):
                got = f"shape {value.shape}" if isinstance(value, np.ndarray) else type(value).__name__
                raise ArgumentError(f"{self._what}: {name!r} has {got}; return an array of shape ({self._worlds},)")
