"""A shard: the worlds of one range, in a process of their own, as a driver elsewhere calls it."""

from __future__ import annotations

import functools
import os
import socket
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from tightloop import _core
from tightloop.env.mirror import MirrorColumns
from tightloop.env.task import Task
from tightloop.env.vector import VectorEnv
from tightloop.errors import TightloopError

Method = TypeVar("Method", bound=Callable[..., Any])


class ShardInfo(NamedTuple):
    """What a shard reports about its environment, once it is open."""

    observation_space: Box
    action_space: Box
    privileged_space: Box | None
    control_dt: float
    mirror: tuple[MirrorColumns, MirrorColumns, MirrorColumns | None] | None
    version: str
    model_hash: str
    place: str


class ShardStart(NamedTuple):
    """Results of a reset of a shard: ``obs`` ``(worlds, size)``, infos, curriculum levels ``(worlds,)``."""

    obs: NDArray[Any]
    infos: dict[str, Any]
    level: NDArray[np.int32]


class ShardStep(NamedTuple):
    """Results of a step of a shard, as `VectorEnv.step` returns them; ``level`` is None if the task keeps levels."""

    obs: NDArray[Any]
    reward: NDArray[Any]
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    infos: dict[str, Any]
    level: NDArray[np.int32] | None


def _answers(method: Method) -> Method:
    """Return errors of this package as results: they cross processes without a second traceback."""

    @functools.wraps(method)
    def call(*given: Any) -> Any:
        try:
            return method(*given)
        except TightloopError as problem:
            return problem

    return call  # type: ignore[return-value]


class Shard:
    """A `VectorEnv` with the worlds of one range. Every method returns its result or a `TightloopError`."""

    def __init__(self) -> None:
        # an error of the constructor would end the process, so `open` makes the environment
        self._env: Any = None
        self._moves = False

    @_answers
    def open(self, task: Any, worlds: int, options: Mapping[str, Any]) -> ShardInfo:
        """Launch a daemon for the worlds.

        Args:
            task: As of `VectorEnv`.
            worlds: Number of worlds.
            options: Further arguments of `VectorEnv`.
        """
        # what is returned is copied before the next call
        self._env = env = VectorEnv(task, worlds, copy=False, **options)
        self._moves = type(env.task).next_level is not Task.next_level
        return ShardInfo(
            cast("Box", env.single_observation_space),
            cast("Box", env.single_action_space),
            env.evaluation.privileged_space,
            env.control_dt,
            env.mirror,
            _core.__version__,
            env.sim.info["model_hash"],
            self.place(),
        )

    def place(self) -> str:
        """Return where this process runs, for messages."""
        return f"process {os.getpid()} of {socket.gethostname()}"

    @_answers
    def reset(
        self, seeds: Sequence[int] | None, mask: NDArray[np.bool_] | None, level: NDArray[np.int32] | None
    ) -> ShardStart:
        """Start episodes, as `VectorEnv.reset` does.

        Args:
            seeds: A seed per world; None for the next episodes.
            mask: Worlds to reset, bool, shape ``(worlds,)``; None for all.
            level: Their curriculum levels, shape ``(worlds,)``; None for those of the task.
        """
        options = {name: value for name, value in (("reset_mask", mask), ("level", level)) if value is not None}
        obs, infos = self._env.reset(seed=seeds, options=options)
        return ShardStart(obs, infos, self._env.level)

    @_answers
    def begin(self, seeds: Sequence[int], level: NDArray[np.int32] | None, ended: NDArray[np.bool_]) -> ShardStart:
        """Start the first episodes in place of a shard that was lost.

        Args:
            seeds: A seed per world.
            level: Curriculum levels, shape ``(worlds,)``; None for those of the task.
            ended: Worlds whose caller sees the end of an episode now, and its next episode after that, as the
                autoreset mode says.
        """
        start = self._env.reset(seed=seeds, options={} if level is None else {"level": level})
        self._env._done[:] = ended
        return ShardStart(start[0], start[1], self._env.level)

    @_answers
    def step(self, actions: NDArray[Any]) -> ShardStep:
        """Advance the worlds by one control step."""
        obs, reward, terminated, truncated, infos = self._env.step(actions)
        return ShardStep(obs, reward, terminated, truncated, infos, self._env.level if self._moves else None)

    @_answers
    def elapsed(self) -> NDArray[np.int32]:
        """Return the control steps of each world's episode, shape ``(worlds,)``."""
        return self._env.elapsed

    @_answers
    def set_elapsed(self, steps: NDArray[np.int32]) -> None:
        """Set the control steps of each world's episode, shape ``(worlds,)``."""
        self._env.elapsed = steps

    def close(self) -> None:
        """End the daemon."""
        if self._env is not None:
            self._env.close()
