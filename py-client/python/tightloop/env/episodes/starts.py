"""Where episodes start: curriculum levels, and states that a task sets after a reset."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop import _core
from tightloop.checks import arguments as checks
from tightloop.env.episodes.episodes import Episodes
from tightloop.env.evaluation.evaluation import Evaluation
from tightloop.env.task import Task, Worlds
from tightloop.errors import ArgumentError, TightloopWarning
from tightloop.sim.sim import Sim

#: Streams of random numbers: of first levels, and of states at the start.
_LEVELS, _STATES = 1, 2
#: The last level of tasks that state no number of them.
_LAST = np.iinfo(np.int32).max


class Starts:
    """Levels of the worlds, and their states at the start of an episode.

    Attributes:
        level: Curriculum level of each world, shape ``(worlds,)``, int32.
    """

    def __init__(self, task: Task, worlds: int) -> None:
        self._task, self._name = task, type(task).__name__
        self._last = (
            _LAST
            if task.levels is None
            else checks.integer(f"{self._name}: levels", task.levels, error=ArgumentError) - 1
        )
        self._first_levels = checks.integer(f"{self._name}: first_levels", task.first_levels, error=ArgumentError)
        self._writes = type(task).initial_state is not Task.initial_state
        self._moves = type(task).next_level is not Task.next_level
        self.level = np.zeros(worlds, np.int32)
        self._next = np.zeros(worlds, np.int32)
        self._arrays: dict[str, NDArray[Any]] = {}

    def seed(self, mask: NDArray[np.bool_], seeds: NDArray[np.uint64]) -> None:
        """Draw the first levels of worlds that got a seed."""
        rows = np.flatnonzero(mask)
        draws = np.empty((len(rows), 1), np.float32)
        _core.draw(seeds[rows], np.zeros(len(rows), np.uint32), _LEVELS, 1, draws)
        self._next[rows] = (draws[:, 0] * self._first_levels).astype(np.int32)

    def chosen(self, options: Mapping[str, Any] | None, mask: NDArray[np.bool_]) -> NDArray[Any] | None:
        """Return the levels of the options of a reset; None if they have none.

        Raises:
            ArgumentError: They are no levels of the task, one per world.
        """
        if not options or "level" not in options:
            return None
        return self._levels("reset: options, level", options["level"], mask.shape, "give")

    def choose(self, mask: NDArray[np.bool_], level: NDArray[Any] | None) -> None:
        """Take the levels that `chosen` returned for worlds that begin an episode."""
        if level is not None:
            self._next[mask] = level[mask]

    def end(self, ended: NDArray[np.bool_], evaluation: Evaluation) -> None:
        """Ask the task for the next levels of worlds whose episode ends.

        Raises:
            ArgumentError: The levels are no levels of the task, one per world.
        """
        if not self._moves or not ended.any():
            return
        rows = np.flatnonzero(ended)
        level = self._task.next_level(np, evaluation.worlds.rows(rows))
        if level is None:
            return
        self._next[rows] = self._levels(f"{self._name}.next_level", level, rows.shape, "return")

    def _levels(self, what: str, level: Any, shape: tuple[int, ...], verb: str) -> NDArray[Any]:
        """Return levels that were checked."""
        try:
            given = np.asarray(level)
        except ValueError as problem:
            raise ArgumentError(f"{what}: {problem}; {verb} whole numbers, shape {shape}") from None
        if given.shape != shape or given.dtype.kind not in "iu":
            raise ArgumentError(
                f"{what}: got {given.dtype} of shape {given.shape}; {verb} whole numbers, shape {shape}"
            )
        wrong = np.flatnonzero((given < 0) | (given > self._last))
        if len(wrong):
            raise ArgumentError(f"{what}: got {given[wrong[0]]} at {wrong[0]}; {verb} 0 to {self._last}")
        return given

    def begin(self, mask: NDArray[np.bool_]) -> None:
        """Set the levels of worlds that begin an episode."""
        self.level[mask] = self._next[mask]

    def reset(
        self,
        sim: Sim,
        mask: NDArray[np.bool_],
        seeds: NDArray[np.uint64] | None,
        episodes: Episodes,
        seen: Callable[[Any], Worlds],
    ) -> Any:
        """Reset worlds, to the states that the task chooses if it does; returns the frame there.

        Args:
            sim: The simulation.
            mask: The worlds.
            seeds: New seeds of all worlds, if they get any.
            episodes: The episodes that begin.
            seen: Makes worlds of a frame.

        Raises:
            ArgumentError: The states are no dict of arrays with a row per world.
            CommandRefused: A value is wrong.
        """
        if not self._writes:
            return sim.reset(mask=mask, seed=seeds)
        rows = np.flatnonzero(mask)
        scene_start = _SceneStart(lambda: sim.reset(mask=mask, seed=seeds), seen, rows)
        count = self._task.initial_draws
        draws = np.empty((len(rows), count), np.float32)
        _core.draw(episodes.seeds[rows], episodes.numbers[rows], _STATES, count, draws)
        states = self._task.initial_state(np, scene_start, draws)
        if not isinstance(states, Mapping):
            raise ArgumentError(
                f"{self._name}.initial_state: got {type(states).__name__}; return a dict of arrays by name"
            )
        for name, state in states.items():
            own = np.asarray(state)
            if own.ndim == 0 or len(own) != len(rows) or own.dtype.kind not in "fiub":
                raise ArgumentError(
                    f"{self._name}.initial_state: {name!r} is {own.dtype} of shape {own.shape}; return numbers of "
                    f"{len(rows)} worlds"
                )
            whole = self._arrays.get(name)
            if whole is None or whole.shape[1:] != own.shape[1:]:
                whole = self._arrays[name] = np.zeros((len(mask), *own.shape[1:]), own.dtype)
            whole[rows] = own
        arrays = {name: self._arrays[name] for name in states}
        frame = scene_start.frame
        with warnings.catch_warnings():
            if not self._task.warns_of_starts:
                warnings.simplefilter("ignore", TightloopWarning)
            if frame is None and arrays.keys() <= {"joint_q", "joint_qd"}:
                return sim.reset(mask=mask, seed=seeds, joint_q=arrays.get("joint_q"), joint_qd=arrays.get("joint_qd"))
            if frame is None:
                frame = sim.reset(mask=mask, seed=seeds)
            return sim.write(mask=mask, **arrays) if arrays else frame


class _SceneStart(Worlds):
    """Worlds as the scene starts them; they are reset when a task first reads something of them."""

    def __init__(self, reset: Callable[[], Any], seen: Callable[[Any], Worlds], rows: NDArray[np.intp]) -> None:
        self.__dict__.update(_reset=reset, _seen=seen, _rows=rows, _worlds=None, _frame=None)

    @property
    def frame(self) -> Any:
        """Frame of the reset; None if nothing has been read."""
        return self.__dict__["_frame"]

    def __getattr__(self, name: str) -> Any:
        own = self.__dict__
        if own["_worlds"] is None:
            own["_frame"] = own["_reset"]()
            own["_worlds"] = own["_seen"](own["_frame"]).rows(own["_rows"])
        return getattr(own["_worlds"], name)
