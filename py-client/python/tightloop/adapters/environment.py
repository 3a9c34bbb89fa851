"""What every adapter needs: its library, and an environment with the autoreset mode that the library expects."""

from __future__ import annotations

from typing import Any

from gymnasium.vector import AutoresetMode

from tightloop.env import Task, VectorEnv
from tightloop.errors import ArgumentError
from tightloop.optional_imports import optional_import

#: What an adapter takes: an environment, or a task to make one for.
Given = VectorEnv | Task | type[Task] | str


def library(module: str, *, install: str) -> Any:
    """Import a module of a learning library.

    Args:
        module: Full name of the module.
        install: Name of the library for pip.

    Raises:
        MissingLibrary: The library is not installed.
    """
    return optional_import(module, f"there is no module `{{}}`: pip install '{install}'")


def adapted_environment(given: Given, num_envs: int | None, mode: AutoresetMode, options: dict[str, Any]) -> VectorEnv:
    """Return an environment with an autoreset mode: the given one, or a new one of the given task.

    Args:
        given: An environment or a task.
        num_envs: Number of worlds of a new environment.
        mode: Autoreset mode that the library expects.
        options: Further arguments of `VectorEnv` for a new environment.

    Raises:
        ArgumentError: The environment has another mode, or arguments for a new one were given too.
    """
    if not isinstance(given, VectorEnv):
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
