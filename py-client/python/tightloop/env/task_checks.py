"""Checks of a task before its simulation starts: each error names the member and the cure."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tightloop.checks import arguments as checks
from tightloop.checks.attributes import suggestion
from tightloop.env.task import Task
from tightloop.env.task_members import tell_of_attributes
from tightloop.errors import ArgumentError
from tightloop.scene.scene import Scene
from tightloop.sim.launching import launch

_BY_WORLDS = ("xp", "worlds")
#: Arguments of the members that an environment calls.
_CALLS = {
    "scene": (),
    "controls": (),
    "observed": (),
    "bind": ("names",),
    "observe": _BY_WORLDS,
    "reward": _BY_WORLDS,
    "terminated": _BY_WORLDS,
    "truncated": _BY_WORLDS,
    "success": _BY_WORLDS,
    "metrics": _BY_WORLDS,
    "goal": (*_BY_WORLDS, "draws"),
    "remember": (*_BY_WORLDS, "memory"),
    "reward_terms": _BY_WORLDS,
    "initial_state": (*_BY_WORLDS, "draws"),
    "next_level": _BY_WORLDS,
    "disturbances": (),
    "privileged_observed": (),
    "privileged_observe": _BY_WORLDS,
    "mirrored": (),
    "policy_metadata": (),
    "start_metrics": _BY_WORLDS,
    "states_of": ("qpos", "qvel"),
}


def check_task(task: Task) -> None:
    """Check the members of a task.

    Raises:
        ArgumentError: One is not what `Task` says.
    """
    kind = type(task).__name__
    tell_of_attributes(task, Task)
    for name, arguments in _CALLS.items():
        _check_call(f"{kind}.{name}", getattr(task, name), arguments)
    fields: Any = task.fields
    if isinstance(fields, str) or not isinstance(fields, Sequence) or not all(isinstance(name, str) for name in fields):
        raise ArgumentError(f'{kind}.fields is {fields!r:.80}; give a tuple of names, such as ("joint_q",)')
    draws = checks.integer(f"{kind}.goal_draws", task.goal_draws, least=0, error=ArgumentError)
    if task.goal_steps is not None:
        checks.integer(f"{kind}.goal_steps", task.goal_steps, error=ArgumentError)
    if type(task).goal is Task.goal and (draws or task.goal_steps is not None):
        name, value = ("goal_draws", draws) if draws else ("goal_steps", task.goal_steps)
        raise ArgumentError(
            f"{kind}.{name} is {value}, and there is no `goal`: define goal(self, xp, worlds, draws), or leave {name} "
            "out"
        )
    if task.goal_radius is not None:
        checks.number(f"{kind}.goal_radius", task.goal_radius, above=0.0, error=ArgumentError)
    options: Any = task.launch_options
    if not isinstance(options, Mapping):
        raise ArgumentError(f'{kind}.launch_options is {options!r:.80}; give a dict, such as {{"bounds": {{…}}}}')
    known = [*inspect.signature(launch).parameters]
    for name in options:
        if name not in known:
            raise ArgumentError(
                f"{kind}.launch_options has {name!r}, which `launch` does not take; {suggestion(str(name), known)}"
            )


def scene_of(task: Task) -> Scene:
    """Return the scene of a task.

    Raises:
        ArgumentError: It is none.
    """
    scene: Any = task.scene()
    if not isinstance(scene, Scene):
        got = "nothing" if scene is None else f"{type(scene).__name__}"
        raise ArgumentError(f"{type(task).__name__}.scene: got {got}; return a tightloop.Scene")
    return scene


def _check_call(what: str, function: Any, arguments: tuple[str, ...]) -> None:
    if not callable(function):
        raise ArgumentError(f"{what} is {function!r:.80}; define a method {_header(what, arguments)}")
    try:
        inspect.signature(function).bind(*([np] * len(arguments)))
    except TypeError:
        own = ", ".join(["self", *inspect.signature(function).parameters])
        name = what.rpartition(".")[2]
        raise ArgumentError(f"{what} is {name}({own}); define it as {_header(what, arguments)}") from None
    except ValueError:  # a function without a signature, of another language
        return


def _header(what: str, arguments: tuple[str, ...]) -> str:
    return f"{what.rpartition('.')[2]}({', '.join(['self', *arguments])})"
