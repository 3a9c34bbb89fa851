"""Adapter to RLlib: each env runner has its own daemon with many worlds.

>>> from ray.rllib.algorithms.ppo import PPOConfig
>>> from tightloop.adapters.rllib import register
>>> config = PPOConfig().environment(register("FrankaReach"))
>>> config.env_runners(num_envs_per_env_runner=64, gym_env_vectorize_mode="vector_entry_point")
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

from gymnasium.vector import AutoresetMode

from tightloop.adapters.environment import library
from tightloop.checks.signatures import checked_calls
from tightloop.env import Env, Task, VectorEnv
from tightloop.errors import ArgumentError

registry = library("ray.tune.registry", install="ray[rllib]")


@checked_calls
def register(task: Task | type[Task] | str, *, name: str | None = None, **options: Any) -> str:
    """Register a task with Ray and all its workers.

    The environments start the next episode in the next step and return new arrays, as RLlib expects.

    Args:
        task: A task, its class or its name.
        name: Name in Ray; ``tightloop/`` and the task's name if left out.
        **options: Further arguments of `VectorEnv`, such as ``threads=1`` where many runners share a machine.
            ``environment(…, env_config={…})`` adds to them.

    Returns:
        The name, for ``config.environment(name)``.

    Raises:
        ArgumentError: The adapter sets one of the options itself.
    """
    _check(options)
    if name is None:
        own = task if isinstance(task, type) else type(task)
        name = f"tightloop/{task if isinstance(task, str) else own.__name__}"
    registry.register_env(name, partial(make, task, options))
    return name


def make(task: Task | type[Task] | str, options: Mapping[str, Any], context: Mapping[str, Any]) -> VectorEnv | Env:
    """Make an environment for an env runner: many worlds with ``num_envs`` in the context, else one.

    Raises:
        ArgumentError: The adapter sets one of the options itself.
    """
    asked = {name: value for name, value in context.items() if name != "num_envs"}
    _check(asked)
    given = {**options, **asked}
    if "num_envs" not in context:
        return Env(task, **given)
    return VectorEnv(task, context["num_envs"], autoreset_mode=AutoresetMode.NEXT_STEP, copy=True, **given)


def _check(options: Mapping[str, Any]) -> None:
    fixed = [name for name in ("num_envs", "autoreset_mode", "copy") if name in options]
    if fixed:
        raise ArgumentError(f"{', '.join(fixed)}: RLlib and the adapter choose these; leave them out")
