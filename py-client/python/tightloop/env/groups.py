"""Worlds in groups, each in a daemon of its own: a policy works on one group while the others step."""

from __future__ import annotations

import os
from typing import Any

from tightloop.env.task import Task
from tightloop.env.vector import VectorEnv
from tightloop.errors import ArgumentError


def make_groups(
    task: Task | type[Task] | str,
    num_envs: int,
    groups: int = 2,
    *,
    threads: int | None = None,
    **options: Any,
) -> list[VectorEnv]:
    """Environments whose worlds are, together, those of one `VectorEnv` of ``num_envs``.

    With the same seed each world does what it does there, whichever group it is in.

    >>> groups = make_groups("FrankaReach", 4096)
    >>> for group in groups:
    ...     obs, _ = group.reset(seed=0)
    ...     group.send(policy(obs))
    >>> while training:
    ...     for group in groups:
    ...         obs, reward, terminated, truncated, infos = group.recv()
    ...         group.send(policy(obs))                 # the other group steps meanwhile

    Args:
        task: As of `VectorEnv`.
        num_envs: How many worlds all groups have.
        groups: How many groups, which divides ``num_envs``.
        threads: Most threads a group's step may use; the cores are shared out if left out.
        **options: As of `VectorEnv`.

    Raises:
        ArgumentError: The worlds cannot be shared out evenly.
    """
    if groups < 1 or num_envs % groups:
        raise ArgumentError(f"make_groups: {num_envs} environments cannot be shared out evenly among {groups} groups")
    each = num_envs // groups
    cores = len(os.sched_getaffinity(0))
    own = max(1, cores // groups) if threads is None else threads
    made: list[VectorEnv] = []
    try:
        for group in range(groups):
            made.append(VectorEnv(task, each, first_env=group * each, threads=own, **options))
    except BaseException:
        for env in made:
            env.close()
        raise
    return made
