"""What every adapter needs: its library, and an environment with the autoreset mode that the library expects."""

from __future__ import annotations

from typing import Any

from gymnasium.spaces import Dict
from gymnasium.vector import AutoresetMode

from tightloop.adapters.spread import SpreadVectorEnv
from tightloop.checks import arguments as checks
from tightloop.env import Task, VectorEnv
from tightloop.errors import ArgumentError
from tightloop.optional_imports import optional_import

#: What an adapter takes: an environment, or a task to make one for.
Given = VectorEnv | SpreadVectorEnv | Task | type[Task] | str


def library(module: str, *, install: str) -> Any:
    """Import a module of a learning library.

    Args:
        module: Full name of the module.
        install: Name of the library for pip.

    Raises:
        MissingLibrary: The library is not installed.
    """
    return optional_import(module, f"there is no module `{{}}`: pip install '{install}'")


def set_torch_threads(torch: Any, threads: int | None, device: str = "cpu") -> None:
    """Set the number of threads that torch computes with, in the whole process.

    Torch starts with a thread per core. These threads wait for each other by spinning, and take the cores from the
    simulation: on two busy cores Stable-Baselines3's PPO was 4 to 17 times as slow as with one thread.

    Args:
        torch: The module.
        threads: Number of threads, at least 1; None changes nothing.
        device: Device of torch's tensors. Nothing changes if it is not the CPU.

    Raises:
        ArgumentError: ``threads`` is not a whole number of at least 1.
    """
    if threads is None:
        return
    count = checks.integer("torch_threads", threads, least=1, error=ArgumentError)
    if torch.device(device).type == "cpu":
        torch.set_num_threads(count)


def adapted_environment(
    given: Given,
    num_envs: int | None,
    mode: AutoresetMode,
    options: dict[str, Any],
    *,
    takes_dicts: bool = False,
) -> Any:
    """Return an environment with an autoreset mode: the given one, or a new one of the given task.

    Args:
        given: An environment or a task.
        num_envs: Number of worlds of a new environment.
        mode: Autoreset mode that the library expects.
        options: Further arguments of `VectorEnv` for a new environment.
        takes_dicts: Whether the adapter takes observations that are dicts.

    Raises:
        ArgumentError: The environment has another mode or observations that the adapter does not take, or arguments for
            a new one were given too.
    """
    has_dicts = isinstance(getattr(given, "single_observation_space", None), Dict) or options.get("dict_observations")
    if has_dicts and not takes_dicts:
        raise ArgumentError("dict_observations: this adapter takes observations that are one array; leave it out")
    if not isinstance(given, VectorEnv | SpreadVectorEnv):
        if "autoreset_mode" in options or "copy" in options:
            raise ArgumentError("autoreset_mode and copy: the adapter chooses them, leave them out")
        # the adapter copies what it returns, so VectorEnv need not
        return VectorEnv(given, num_envs, autoreset_mode=mode, copy=False, **options)
    if num_envs is not None or options:
        names = ", ".join([*(["num_envs"] if num_envs is not None else []), *options])
        raise ArgumentError(f"{names}: the environment given has its own; leave them out, or give a task instead")
    if given.autoreset_mode is not mode:
        raise ArgumentError(
            f"the environment has autoreset_mode={given.autoreset_mode.name}, and this library expects {mode.name}; "
            f"make it with VectorEnv(…, autoreset_mode={mode.name!r})"
        )
    return given
