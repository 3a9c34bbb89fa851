"""What a task remembers from step to step."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.env.evaluation.evaluation import Evaluation
from tightloop.env.task import Task
from tightloop.errors import ArgumentError


class Memory:
    """The arrays that `Task.remember` returned last, which every function of the task sees as ``worlds.memory``.

    Attributes:
        arrays: Arrays by name, shape ``(worlds, …)``. They are overwritten in place by every step.
        is_used: Whether the task defines `Task.remember`.
    """

    def __init__(self, task: Task, worlds: int) -> None:
        self._task, self._count = task, worlds
        self.is_used = type(task).remember is not Task.remember
        self.arrays: dict[str, NDArray[Any]] = {}

    def begin(self, rows: NDArray[np.intp], evaluation: Evaluation) -> None:
        """Fill the rows of worlds that begin an episode.

        Raises:
            ArgumentError: The result is no dict of arrays with a row per world.
        """
        if not self.is_used:
            return
        made = self._checked(self._task.remember(np, evaluation.worlds.rows(rows), None), len(rows))
        if not self.arrays:
            self.arrays.update({name: np.zeros((self._count, *new.shape[1:]), new.dtype) for name, new in made.items()})
        self._check_alike(made)
        for name, new in made.items():
            self.arrays[name][rows] = new

    def advance(self, evaluation: Evaluation) -> None:
        """Take a step into account, in every world.

        Raises:
            ArgumentError: As `begin`.
        """
        if not self.is_used:
            return
        made = self._checked(evaluation.call("remember", evaluation.worlds.memory), self._count)
        self._check_alike(made)
        for name, new in made.items():
            np.copyto(self.arrays[name], new, casting="same_kind")

    def _checked(self, made: Any, rows: int) -> dict[str, NDArray[Any]]:
        what = f"{type(self._task).__name__}.remember"
        if not isinstance(made, Mapping):
            raise ArgumentError(f"{what}: got {type(made).__name__}; return a dict of arrays by name")
        arrays = {}
        for name, new in made.items():
            array = np.asarray(new)
            if array.ndim == 0 or len(array) != rows or array.dtype.kind not in "fiub":
                raise ArgumentError(
                    f"{what}: {name!r} is {array.dtype} of shape {array.shape}; return numbers of {rows} worlds"
                )
            arrays[name] = array
        return arrays

    def _check_alike(self, made: Mapping[str, NDArray[Any]]) -> None:
        what = f"{type(self._task).__name__}.remember"
        if made.keys() != self.arrays.keys():
            apart = ", ".join(sorted(made.keys() ^ self.arrays.keys()))
            raise ArgumentError(f"{what}: not every call returns {apart}; return the same names at start and in steps")
        for name, new in made.items():
            kept = self.arrays[name]
            if new.shape[1:] != kept.shape[1:] or not np.can_cast(new.dtype, kept.dtype, "same_kind"):
                raise ArgumentError(
                    f"{what}: {name!r} is {new.dtype} of shape {new.shape} now, and was {kept.dtype} with "
                    f"{kept.shape[1:]} per world; return the same kind at start and in steps"
                )
