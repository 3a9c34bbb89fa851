"""Evaluates the functions of a task at the current worlds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from tightloop import _core
from tightloop.env.evaluation.array_pool import ArrayPool
from tightloop.env.evaluation.bounds_watch import BoundsWatch
from tightloop.env.evaluation.dict_observations import DictPacker
from tightloop.env.evaluation.observations import ObservationPacker
from tightloop.env.evaluation.past import Past
from tightloop.env.evaluation.results import check_metric_names
from tightloop.env.evaluation.reward_terms import RewardTerms
from tightloop.env.evaluation.step_buffers import Observations, aligned
from tightloop.env.mirror import Mirror, MirrorColumns
from tightloop.env.task import Array, Task, Worlds, observed_parts
from tightloop.errors import ArgumentError

_REAL, _BOOL, _ANY = "fiu", "b", "fiub"
#: Stream of random numbers of delays.
_DELAYS = 3


class Evaluation:
    """Calls a task's functions, whose temporary arrays come from a pool and are reused by the next call.

    The result of each function's first call is checked; errors name the function.

    Attributes:
        worlds: The worlds that the functions see.
        space: Observation space of one world.
    """

    def __init__(self, task: Task, worlds: int, *, as_dict: bool = False) -> None:
        self._task, self._count = task, worlds
        self._pool, self._tapes = ArrayPool(), {}
        parts = observed_parts(task)
        self._packer = DictPacker(parts, task.dtype) if as_dict else ObservationPacker(parts, task.dtype)
        self._watch, self.space = BoundsWatch(type(task).__name__, parts), self._packer.space
        privileged = task.privileged_observed()
        self._privileged = ObservationPacker(privileged) if privileged else None
        self.terms = RewardTerms(task, worlds)
        self.worlds = Worlds()
        # arrays that stay, and how the functions see them
        self._shown: dict[str, tuple[NDArray[Any], NDArray[Any]]] = {}
        self._memory: dict[str, NDArray[Any]] = {}
        self._has_start_infos = type(task).start_metrics is not Task.start_metrics

    @property
    def privileged_space(self) -> Box | None:
        """Space of a privileged observation; None if the task has none."""
        return None if self._privileged is None else self._privileged.space

    def mirror(self, actions: int) -> tuple[MirrorColumns, MirrorColumns, MirrorColumns | None] | None:
        """Return the mirror symmetry of observations, actions and privileged observations; None without symmetry, and
        of observations that are dicts.

        Raises:
            ArgumentError: It does not fit their parts.
        """
        mirror = self._task.mirrored()
        if mirror is None or isinstance(self._packer, DictPacker):
            return None
        what = self.function_name("mirrored")
        if not isinstance(mirror, Mirror):
            raise ArgumentError(f"{what}: got {type(mirror).__name__}; return a Mirror, or None")
        privileged = None
        if self._privileged is not None:
            privileged = MirrorColumns.of_parts(f"{what}: privileged", mirror.privileged, self._privileged.parts)
        observed = MirrorColumns.of_parts(f"{what}: observed", mirror.observed, self._packer.parts)
        return observed, MirrorColumns.of(f"{what}: action", mirror.action, actions), privileged

    def see(self, frame: Any, memory: Mapping[str, NDArray[Any]], **own: NDArray[Any]) -> None:
        """Show a frame, the task's memory and the environment's own arrays to the functions."""

        def shown(name: str, array: NDArray[Any]) -> NDArray[Any]:
            known = self._shown.get(name)
            if known is None or known[0] is not array:
                known = self._shown[name] = (array, self._pool.wrap(array))
                known[1].flags.writeable = False
            return known[1]

        if len(self._memory) != len(memory):  # whose arrays stay the same
            self._memory = {name: shown(f"memory: {name}", array) for name, array in memory.items()}
        self.worlds = Worlds(
            **{name: shown(name, array) for name, array in own.items()},
            memory=self._memory,
            **{name: self._pool.wrap(getattr(frame, name)) for name in self._task.fields},
        )

    def advance(self) -> None:
        """Begin a step: the last observations become history."""
        self._packer.advance()
        if self._privileged is not None:
            self._privileged.advance()

    def begin(self, rows: NDArray[np.intp], seeds: NDArray[np.uint64], episodes: NDArray[np.uint32]) -> None:
        """Draw by how much parts are late in worlds that begin an episode."""
        pasts = [past for past in self._pasts() if past.varies]
        if not pasts:
            return
        draws = np.empty((len(rows), len(pasts)), np.float32)
        _core.draw(seeds[rows], episodes[rows], _DELAYS, len(pasts), draws, np.zeros(len(rows), np.uint32))
        for past, column in zip(pasts, draws.T, strict=True):
            past.draw(rows, column)

    def restart(self, rows: NDArray[np.intp]) -> None:
        """Forget what parts were before in some worlds, whose state was set."""
        for past in self._pasts():
            past.restart(rows)

    def _pasts(self) -> list[Past]:
        packers = [self._packer, *([] if self._privileged is None else [self._privileged])]
        return [past for packer in packers for past in packer.pasts(self._count).values()]

    def empty_observations(self, worlds: int) -> Observations:
        """Return what `observe` writes to, for so many worlds."""
        return self._packer.empty(worlds)

    def observe(self, out: Observations, begun: NDArray[np.bool_] | None = None) -> bool:
        """Write the observations; returns whether any is NaN.

        Args:
            out: The observations.
            begun: Worlds that begin an episode.
        """
        arrays = self.call("observe")
        spoiled = self._packer.pack(arrays, out, begun)
        self._watch.look(arrays)
        return spoiled

    def privileged(self, begun: NDArray[np.bool_] | None = None) -> NDArray[np.float32] | None:
        """Return privileged observations, shape ``(worlds, size)``, NaN as 0; None if the task has none."""
        if self._privileged is None:
            return None
        out = aligned((self._count, self._privileged.size), np.float32)
        if self._privileged.pack(self.call("privileged_observe"), out, begun):
            np.nan_to_num(out, copy=False)
        return out

    def reward(self, out: NDArray[Any]) -> None:
        """Write the rewards, shape ``(worlds,)``."""
        if self.terms.is_used:
            self.terms.add(self.call("reward_terms"), out)
            return
        np.copyto(out, self._checked("reward", _REAL), casting="same_kind")

    def terminated(self, out: NDArray[np.bool_]) -> None:
        """Write which worlds are terminated, shape ``(worlds,)``."""
        ended = self._checked("terminated", _BOOL, optional=True)
        np.copyto(out, False if ended is None else ended)

    def truncated(self, out: NDArray[np.bool_]) -> None:
        """Add the worlds that the task truncates to those that are truncated, shape ``(worlds,)``."""
        ended = self._checked("truncated", _BOOL, optional=True)
        if ended is not None:
            np.logical_or(out, ended, out=out)

    def infos(self) -> dict[str, NDArray[Any]]:
        """Return copies of the task's metrics and of ``success``, by name."""
        first = "metrics" not in self._tapes
        metrics = self.call("metrics")
        if first and not isinstance(metrics, Mapping):
            raise ArgumentError(f"{self.function_name('metrics')}: got {type(metrics).__name__}; return a dict by name")
        if first:
            check_metric_names(self.function_name("metrics"), [*metrics])
            for name, value in metrics.items():
                self._check(f"metrics, {name!r}", value, _ANY, also_more=True)
        success = self._checked("success", _BOOL, optional=True)
        named = dict(metrics) if success is None else {**metrics, "success": success}
        return {name: np.array(value) for name, value in named.items()}

    def add_start_infos(self, infos: dict[str, Any], begun: NDArray[np.bool_] | None) -> None:
        """Write the task's values of worlds that begin an episode into ``infos``."""
        if begun is None or not self._has_start_infos:
            return
        first = "start_metrics" not in self._tapes
        metrics = self.call("start_metrics")
        if first and not isinstance(metrics, Mapping):
            what = self.function_name("start_metrics")
            raise ArgumentError(f"{what}: got {type(metrics).__name__}; return a dict by name")
        for name, value in metrics.items():
            if first:
                check_metric_names(self.function_name("start_metrics"), [name])
                self._check(f"start_metrics, {name!r}", value, _ANY, also_more=True)
            mask, known = f"_{name}", np.asarray(value)
            if name in infos:  # of worlds that go on
                known = np.where(begun.reshape(-1, *[1] * (known.ndim - 1)), known, infos[name])
                infos[mask] = infos[mask] | begun
            else:
                known, infos[mask] = np.array(known), begun.copy()
            infos[name] = known

    def call(self, name: str, *more: Any) -> Any:
        """Call a function of the task; its arrays are reused once nobody holds them."""
        self._pool.play(self._tapes.setdefault(name, []))
        return getattr(self._task, name)(np, self.worlds, *more)

    def _checked(self, name: str, kinds: str, *, optional: bool = False) -> Array:
        first = name not in self._tapes
        value = self.call(name)
        if first and not (optional and value is None):
            self._check(name, value, kinds)
        return value

    def _check(self, what: str, value: Any, kinds: str, *, also_more: bool = False) -> None:
        got = f"an array of shape {value.shape}" if isinstance(value, np.ndarray) else type(value).__name__
        shape = value.shape if isinstance(value, np.ndarray) else ()
        if (shape[:1] if also_more else shape) != (self._count,):
            raise ArgumentError(f"{self.function_name(what)}: got {got}; return an array of shape ({self._count},)")
        if value.dtype.kind not in kinds:
            expected = "bool" if kinds == _BOOL else "real numbers"
            raise ArgumentError(f"{self.function_name(what)}: dtype {value.dtype}; return {expected}")

    def part_name(self, obs: Observations, worlds: NDArray[np.bool_]) -> str:
        """Return the name of the first part that is NaN in some of the worlds, for messages."""

        def column(array: NDArray[Any]) -> int:
            wrong = np.isnan(array[worlds]).any(axis=0).reshape(-1)
            return int(np.argmax(wrong)) if wrong.any() else -1

        if isinstance(self._packer, DictPacker):
            name, place = next((name, found) for name, array in obs.items() if (found := column(array)) >= 0)
            part = self._packer.part(name, place)
        else:
            part = self._packer.part(column(obs))
        return f"{self.function_name('observe')}: `{part}`"

    def function_name(self, function: str) -> str:
        return f"{type(self._task).__name__}.{function}"
