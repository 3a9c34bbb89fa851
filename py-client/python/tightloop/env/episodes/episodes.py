"""Seeds and episodes of the worlds, and their goals."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tightloop import _core
from tightloop.arrays.inputs import reals, whole_seed
from tightloop.env.task import Task, Worlds
from tightloop.errors import ArgumentError

#: Stream of random numbers for goals.
_GOALS = 0


class Episodes:
    """Seed, episode, elapsed steps and goal of each world.

    The daemon counts episodes the same way, so that start and goals of a world depend only on its seed and episode.

    Attributes:
        elapsed: Control steps since the reset, shape ``(worlds,)``, int32.
        goal: Goals, shape ``(worlds, …)``.
        seeds: Seed of each world, shape ``(worlds,)``.
        numbers: Episodes since that seed, shape ``(worlds,)``.
    """

    def __init__(self, task: Task, worlds: int, first_env: int) -> None:
        self._task, self._first = task, first_env
        self.seeds = np.zeros(worlds, np.uint64)
        self.numbers = np.zeros(worlds, np.uint32)
        self._goals = np.zeros(worlds, np.uint32)  # of this episode so far
        self.elapsed = np.zeros(worlds, np.int32)
        self.goal: NDArray[Any] = np.zeros((worlds, 0), np.float32)
        self._known = False

    def seed(
        self, seed: int | Sequence[int | None] | None, mask: NDArray[np.bool_], entropy: np.random.Generator
    ) -> NDArray[np.uint64] | None:
        """Set seeds of the worlds in the mask, or count their next episode.

        Returns:
            Seeds of all worlds for `Sim.reset`; None if each world starts its next episode.

        Raises:
            ArgumentError: A seed is not valid.
        """
        worlds = len(self.seeds)
        if seed is None and self._known:
            self.numbers[mask] += 1
            return None
        given = _seeds(seed, worlds, self._first)
        for world in np.flatnonzero(mask):
            own = given[world]
            self.seeds[world] = entropy.integers(2**63) if own is None else own
        self.numbers[mask] = 0
        # worlds outside the first mask have no seed yet
        self._known = self._known or bool(mask.all())
        return self.seeds

    def set_elapsed(self, steps: ArrayLike) -> None:
        """Set the elapsed steps of all worlds.

        Raises:
            ArgumentError: They are no whole numbers of at least 0, one or one per world.
        """
        given = reals("elapsed", steps)
        if given.shape not in ((), self.elapsed.shape) or (given < 0).any() or (given != given.astype(np.int32)).any():
            expected = f"give whole numbers of at least 0, one or {len(self.elapsed)}"
            raise ArgumentError(f"elapsed is {steps!r:.80}; {expected}")
        self.elapsed[:] = given

    def next(self, mask: NDArray[np.bool_]) -> None:
        """Count the next episode of the worlds in the mask, as `Sim.reset` without seeds does."""
        self.numbers[mask] += 1

    def begin(self, mask: NDArray[np.bool_], worlds: Worlds) -> None:
        """Start episodes of the worlds in the mask, and draw their goals at the state ``worlds``."""
        self.elapsed[mask] = 0
        self._goals[mask] = 0
        self._draw(np.flatnonzero(mask), worlds)

    def due(self) -> NDArray[np.bool_] | None:
        """Return which worlds are due for their next goal; None if the task has one goal per episode."""
        steps = self._task.goal_steps
        if steps is None:
            return None
        # not `==`: `elapsed` may have been set ahead, and then goals follow at one per step. An episode that ends here
        # keeps its goal for its last observation, also if a wrapper counts its steps
        return (self.elapsed >= steps * (self._goals + 1)) & (self.elapsed != self._task.max_episode_steps)

    def renew(self, mask: NDArray[np.bool_], worlds: Worlds) -> None:
        """Draw the next goal of the worlds in the mask."""
        self._goals[mask] += 1
        self._draw(np.flatnonzero(mask), worlds)

    def _draw(self, rows: NDArray[np.intp], worlds: Worlds) -> None:
        count, draws = self._task.goal_draws, np.empty((len(rows), self._task.goal_draws), np.float32)
        _core.draw(self.seeds[rows], self.numbers[rows], _GOALS, count, draws, self._goals[rows] * np.uint32(count))
        goal = np.asarray(self._task.goal(np, worlds.rows(rows), draws))
        if goal.ndim == 0 or len(goal) != len(rows) or goal.dtype.kind not in "fiub":
            expected = f"expected numbers of {len(rows)} worlds"
            raise ArgumentError(f"{type(self._task).__name__}.goal: {expected}; got {goal.dtype} of shape {goal.shape}")
        if self.goal.shape[1:] != goal.shape[1:]:
            self.goal = np.zeros((len(self.seeds), *goal.shape[1:]), np.float32)
        self.goal[rows] = goal


def check_seeds(seed: Any, worlds: int) -> None:
    """Check the seeds of a reset.

    Raises:
        ArgumentError: A seed is not valid, or there are not as many as environments.
    """
    _seeds(seed, worlds, 0)


def _seeds(seed: Any, worlds: int, first: int) -> list[int | None]:
    if seed is None:
        return [None] * worlds
    entries: list[Any]
    if isinstance(seed, int | np.integer) and not isinstance(seed, bool):
        entries = [int(seed) + first + world for world in range(worlds)]
    elif isinstance(seed, Sequence | np.ndarray) and not isinstance(seed, str):
        entries = list(seed)
    else:
        raise ArgumentError(f"reset: seed is {seed!r}; give a whole number, or a list with one an environment")
    if len(entries) != worlds:
        raise ArgumentError(
            f"reset: seed has {len(entries)} entries for {worlds} environments; give a number, or one each"
        )
    for world, entry in enumerate(entries):
        if entry is not None and whole_seed(entry) is None:
            raise ArgumentError(
                f"reset: seed of environment {world} is {entry!r}; give a whole number from 0 to 2**64 - 1"
            )
    return entries
