"""The functions of a task, called with what the worlds are now."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.env.arena import Arena
from tightloop.env.pack import Packer
from tightloop.env.task import Array, Task, Worlds
from tightloop.errors import ArgumentError

_REAL, _BOOL, _ANY = "fiu", "b", "fiub"


class Evaluation:
    """Calls a task's functions; what they compute lies in memory that is used again in the next call.

    The first time that a function is called, its result is checked, and what is wrong is told by name.

    Attributes:
        worlds: What the functions see.
        observed: How many numbers an observation has.
        space: Space of one world's observation.
    """

    def __init__(self, task: Task, worlds: int) -> None:
        self._task, self._count = task, worlds
        self._arena, self._tapes = Arena(), {}
        self._packer = Packer(task.observed())
        self.observed, self.space = self._packer.size, self._packer.space
        self.worlds = Worlds()

    def see(self, frame: Any, **own: NDArray[Any]) -> None:
        """Show the functions a frame, and the environment's own arrays by name."""
        shown = {name: self._arena.wrap(array) for name, array in own.items()}
        for array in shown.values():
            array.flags.writeable = False
        self.worlds = Worlds(**shown, **{name: self._arena.wrap(getattr(frame, name)) for name in self._task.fields})

    def observe(self, out: NDArray[np.float32]) -> None:
        """Write the observations, shape ``(worlds, size)``."""
        self._packer.pack(self.call("observe"), out)

    def reward(self, out: NDArray[np.float32]) -> None:
        """Write the rewards, shape ``(worlds,)``."""
        np.copyto(out, self._checked("reward", _REAL), casting="same_kind")

    def terminated(self, out: NDArray[np.bool_]) -> None:
        """Write which worlds have come to an end, shape ``(worlds,)``."""
        ended = self._checked("terminated", _BOOL, optional=True)
        np.copyto(out, False if ended is None else ended)

    def told(self) -> dict[str, NDArray[Any]]:
        """Copies of what the task tells of the worlds besides, by name: its metrics, and ``success``."""
        first = "metrics" not in self._tapes
        metrics = self.call("metrics")
        if first and not isinstance(metrics, Mapping):
            raise ArgumentError(f"{self._name('metrics')}: got {type(metrics).__name__}; return a dict by name")
        if first:
            for name, value in metrics.items():
                self._check(f"metrics, {name!r}", value, _ANY)
        success = self._checked("success", _BOOL, optional=True)
        named = dict(metrics) if success is None else {**metrics, "success": success}
        return {name: np.array(value) for name, value in named.items()}

    def call(self, name: str) -> Any:
        """What a function of the task says of the worlds; its arrays are used again once nobody holds them."""
        self._arena.play(self._tapes.setdefault(name, []))
        return getattr(self._task, name)(np, self.worlds)

    def _checked(self, name: str, kinds: str, *, optional: bool = False) -> Array:
        first = name not in self._tapes
        value = self.call(name)
        if first and not (optional and value is None):
            self._check(name, value, kinds)
        return value

    def _check(self, what: str, value: Any, kinds: str) -> None:
        got = value.shape if isinstance(value, np.ndarray) else type(value).__name__
        if got != (self._count,):
            raise ArgumentError(f"{self._name(what)}: got {got}; return an array of shape ({self._count},)")
        if value.dtype.kind not in kinds:
            expected = "bool" if kinds == _BOOL else "real numbers"
            raise ArgumentError(f"{self._name(what)}: dtype {value.dtype}; return {expected}")

    def _name(self, function: str) -> str:
        return f"{type(self._task).__name__}.{function}"
