"""Adapter to torchrun: each rank has a daemon with its share of the worlds.

>>> from tightloop.adapters.torchrun import Rank
>>> rank = Rank.of_process()
>>> env = rank.make_env("FrankaReach", 4096)
>>> obs, _ = env.reset(seed=0)
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from tightloop import system
from tightloop.adapters.gathering import ranges
from tightloop.checks import arguments as checks
from tightloop.checks.signatures import checked_calls
from tightloop.env import Task, VectorEnv
from tightloop.errors import ArgumentError

#: Variables that torchrun sets in each process, in the order of `Rank`.
_VARIABLES = ("RANK", "WORLD_SIZE", "LOCAL_RANK", "LOCAL_WORLD_SIZE")


@checked_calls
@dataclass(frozen=True)
class Rank:
    """The place of this process among those that torchrun started.

    Attributes:
        rank: Index among all processes, from 0.
        size: Number of all processes.
        local_rank: Index among the processes on this machine, from 0.
        local_size: Number of processes on this machine.
    """

    rank: int
    size: int
    local_rank: int
    local_size: int

    def __post_init__(self) -> None:
        for name in ("rank", "local_rank"):
            checks.integer(f"Rank: {name}", getattr(self, name), least=0, error=ArgumentError)
        for index, count in (("rank", "size"), ("local_rank", "local_size")):
            if checks.integer(f"Rank: {count}", getattr(self, count), error=ArgumentError) <= getattr(self, index):
                raise ArgumentError(f"Rank: {index} is {getattr(self, index)} of {getattr(self, count)}; count from 0")

    @classmethod
    def of_process(cls, environ: Mapping[str, str] | None = None) -> Rank:
        """Return the rank of this process, from the environment variables that torchrun sets.

        Args:
            environ: Environment variables; those of this process if left out.

        Raises:
            ArgumentError: A variable is missing or is no whole number.
        """
        given = os.environ if environ is None else environ
        missing = [name for name in _VARIABLES if name not in given]
        if missing:
            raise ArgumentError(
                f"there is no environment variable {', '.join(missing)}; start the program with "
                "`torchrun --nproc-per-node 2 program.py`"
            )
        for name in _VARIABLES:
            if not given[name].isdecimal():
                raise ArgumentError(f"{name} is {given[name]!r}; torchrun sets it to a whole number, leave it unset")
        return cls(*(int(given[name]) for name in _VARIABLES))

    def worlds(self, num_envs: int) -> slice:
        """Return this rank's share of all worlds, a contiguous range.

        Args:
            num_envs: Number of worlds of all ranks.

        Raises:
            ArgumentError: There are fewer worlds than ranks.
        """
        if checks.integer("num_envs", num_envs, error=ArgumentError) < self.size:
            raise ArgumentError(f"num_envs is {num_envs} for {self.size} ranks; give at least one world per rank")
        return ranges(num_envs, self.size)[self.rank]

    def make_env(
        self, task: Task | type[Task] | str, num_envs: int, *, threads: int | None = None, **options: Any
    ) -> VectorEnv:
        """Launch a daemon with this rank's share of the worlds.

        With the same seed, each world does what it does in one `VectorEnv` of all worlds: ``reset(seed=…)`` counts from
        the first world of the share.

        Args:
            task: As of `VectorEnv`.
            num_envs: Number of worlds of all ranks.
            threads: Largest number of threads of a step; if left out, this machine's cores are shared evenly among its
                ranks.
            **options: Further arguments of `VectorEnv`.

        Raises:
            ArgumentError: An argument is not valid. Other errors are those of `VectorEnv`.
        """
        for name in ("daemon", "first_env"):
            if name in options:
                raise ArgumentError(f"make_env: {name} follows from the rank; leave it out")
        rows = self.worlds(num_envs)
        if threads is None:
            threads = max(1, system.usable_cores() // self.local_size)
        return VectorEnv(task, rows.stop - rows.start, first_env=rows.start, threads=threads, **options)
