"""What an adapter needs: its library, and an environment whose episodes go on as that library expects."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from gymnasium.vector import AutoresetMode

from tightloop.env import Task, VectorEnv
from tightloop.errors import ArgumentError, MissingLibrary

#: What an adapter is made of: an environment, or a task for one of its own.
Given = VectorEnv | Task | type[Task] | str


def library(module: str, *, install: str) -> Any:
    """A module of a library that tightloop does not depend on.

    Args:
        module: Its full name.
        install: What pip calls the library.

    Raises:
        MissingLibrary: It is not installed.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        # what the library itself misses is for the library to say
        if error.name is None or not f"{module}.".startswith(f"{error.name}."):
            raise
        raise MissingLibrary(f"there is no module `{error.name}`: pip install '{install}'") from error


def environment(given: Given, num_envs: int | None, mode: AutoresetMode, options: dict[str, Any]) -> VectorEnv:
    """An environment of that mode: the one given, or a new one of the task given.

    Args:
        given: An environment or a task.
        num_envs: How many worlds a new one has.
        mode: When a world whose episode ended begins the next one.
        options: What `VectorEnv` takes besides, for a new one.

    Raises:
        ArgumentError: The environment has another mode, or came with arguments for a new one.
    """
    if not isinstance(given, VectorEnv):
        if "autoreset_mode" in options or "copy" in options:
            raise ArgumentError("autoreset_mode and copy: the adapter chooses them, leave them out")
        # the adapter copies what it hands out, so one copy is enough
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
