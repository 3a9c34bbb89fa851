"""Groups of environments that step independently: a policy works on one group while the others step."""

from __future__ import annotations

from inspect import Parameter, signature
from typing import Any

import tightloop as tl
from tightloop.checks import arguments as checks
from tightloop.checks.signatures import checked_calls
from tightloop.env.registry import make_task
from tightloop.env.simulation import options_of
from tightloop.env.task import Task
from tightloop.env.task_checks import scene_of
from tightloop.env.vector import VectorEnv
from tightloop.errors import ArgumentError

#: Keyword arguments of `VectorEnv`; all others are the task's.
_OF_ENVIRONMENTS = {
    name for name, parameter in signature(VectorEnv).parameters.items() if parameter.kind is Parameter.KEYWORD_ONLY
}


@checked_calls
def make_groups(
    task: Task | type[Task] | str,
    num_envs: int,
    groups: int = 2,
    *,
    device: str = "auto",
    precision: str | None = None,
    threads: int | None = None,
    **options: Any,
) -> list[VectorEnv]:
    """Make groups of environments in one daemon, which together have the worlds of one `VectorEnv`.

    With the same seed, each world does what it does in that `VectorEnv`. The daemon ends with the last group.

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
        num_envs: Number of worlds of all groups.
        groups: Number of groups; it divides ``num_envs``.
        device: As of `VectorEnv`.
        precision: As of `VectorEnv`.
        threads: Largest number of threads of a step, shared by all groups; all cores if left out.
        **options: As of `VectorEnv`.

    Returns:
        A `VectorEnv` per group.

    Raises:
        ArgumentError: The groups cannot share the worlds evenly. Other errors are those of `VectorEnv`.
    """
    num_envs = checks.integer("make_groups: num_envs", num_envs, error=ArgumentError)
    groups = checks.integer("make_groups: groups", groups, error=ArgumentError)
    if num_envs % groups:
        raise ArgumentError(
            f"make_groups: {num_envs} environments cannot be shared out evenly among {groups} groups; give a divisor"
        )
    for name in {"daemon", "first_env"} & set(options):
        raise ArgumentError(f"make_groups: {name} is not taken, since the groups have one of their own; leave it out")
    of_task = {name: options.pop(name) for name in set(options) - _OF_ENVIRONMENTS}
    made = make_task(task, of_task, make_groups)
    own = options_of(made, list(made.controls()), device=device, precision=precision, threads=threads)
    sims = tl.launch(scene_of(made), worlds=num_envs, groups=groups, **own)
    try:
        return [VectorEnv(made, daemon=sim, first_env=group * sim.worlds, **options) for group, sim in enumerate(sims)]
    except BaseException:
        sims.close()
        raise
