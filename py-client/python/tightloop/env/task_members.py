"""Members of tasks that nothing calls: misspelt ones, and those that tasks of other libraries have."""

from __future__ import annotations

import difflib
import dis
import inspect
from collections.abc import Iterator
from types import CodeType
from typing import Any

from tightloop.checks import advice

#: Members that a Task does not have, and those of it that are most likely meant.
_MEANT = {
    "compute_reward": "reward",
    "done": "terminated",
    "dones": "terminated",
    "episode_length": "max_episode_steps",
    "get_obs": "observe",
    "get_observation": "observe",
    "get_observations": "observe",
    "get_reward": "reward",
    "horizon": "max_episode_steps",
    "info": "metrics",
    "infos": "metrics",
    "is_done": "terminated",
    "is_success": "success",
    "is_terminated": "terminated",
    "is_truncated": "truncated",
    "make_scene": "scene",
    "max_episode_length": "max_episode_steps",
    "max_steps": "max_episode_steps",
    "obs": "observe",
    "observation": "observe",
    "observation_space": "observed",
    "observations": "observe",
    "rewards": "reward",
    "termination": "terminated",
    "terminations": "terminated",
    "truncation": "truncated",
    "truncations": "truncated",
    "action_space": "controls",
}
#: Members that no Task has under any name, and where their value belongs.
_ELSEWHERE = {
    "control_dt": "dt * substeps of its scene is the length of a control step",
    "decimation": "give scene() a Scene(substeps=…)",
    "dt": "give scene() a Scene(dt=…)",
    "frame_skip": "give scene() a Scene(substeps=…)",
    "num_envs": "give it to VectorEnv",
    "step_dt": "dt * substeps of its scene is the length of a control step",
    "substeps": "give scene() a Scene(substeps=…)",
    "timestep": "give scene() a Scene(dt=…)",
}
# difflib's measure of likeness, from 0 to 1: `metric` of `metrics` has 0.92, `success_rate` of `success` 0.74
_LIKENESS = 0.82
_LOADS = ("LOAD_ATTR", "LOAD_METHOD", "LOAD_SUPER_ATTR")


def tell_of_class(task: type, base: type) -> None:
    """Warn of members of a class that look like those of a `Task` and that nothing uses."""

    def is_abstract(own: Any) -> bool:
        return getattr(own, "scene", None) is vars(base)["scene"]

    # the members of a class without a scene are for its subclasses, and looked at with them
    if is_abstract(task):
        return
    own = [one for one in task.__mro__ if one not in base.__mro__ and (one is task or is_abstract(one))]
    _tell(task, base, {name: _plain(value) for one in reversed(own) for name, value in vars(one).items()})


def tell_of_attributes(task: Any, base: type) -> None:
    """Warn of such attributes that a task itself has, as its `__init__` sets them."""
    own = {name: value for name, value in vars(task).items() if not hasattr(type(task), name)}
    _tell(type(task), base, own)


def _tell(task: type, base: type, members: dict[str, Any]) -> None:
    # of a Task, and of the task of this package that it is made of
    bases = [own for own in task.__mro__ if own is base or own.__module__.startswith("tightloop.")]
    known: dict[str, bool] = {
        name: callable(value) for own in bases for name, value in vars(own).items() if name[0] != "_"
    }
    used: set[str] | None = None
    for name, value in members.items():
        if name[0] == "_" or name in known or isinstance(value, type):
            continue
        meant, cure = _meant(task, name, callable(value), known), _ELSEWHERE.get(name)
        if meant is None and cure is None:
            continue
        used = _used(task, base) if used is None else used
        if name in used:
            continue
        cure = f"a Task has `{meant}`" if meant else cure
        advice.warn(f"task {task.__name__}: nothing uses its `{name}`; {cure}")


def _meant(task: type, name: str, is_call: bool, known: dict[str, bool]) -> str | None:
    """Return the member of a Task that a name most likely means."""
    if name in _MEANT:
        return _MEANT[name]
    alike = [other for other, calls in known.items() if calls == is_call]
    near = difflib.get_close_matches(name.lower(), alike, n=1, cutoff=_LIKENESS)
    # a class that defines the right one, too, has a reason for the other
    return near[0] if near and near[0] not in vars(task) else None


def _plain(member: Any) -> Any:
    """Return what a member of a class is to its objects: a property is a value."""
    return member.__func__ if isinstance(member, staticmethod | classmethod) else member


def _used(task: type, base: type) -> set[str]:
    """Return the names of attributes that a class and its own bases read, or that a task of this package sets."""
    classes = [own for own in task.__mro__ if own not in base.__mro__]
    used = {name for own in classes for code in _codes(own) for name in _named(code, _LOADS)}
    ours = [own for own in classes if own.__module__.startswith("tightloop.")]
    return used | {name for own in ours for code in _codes(own) for name in _named(code, ("STORE_ATTR",))}


def _codes(own: type) -> Iterator[CodeType]:
    for member in vars(own).values():
        functions = (member.fget, member.fset) if isinstance(member, property) else (_plain(member),)
        for function in functions:
            plain = inspect.unwrap(function) if callable(function) else function
            if inspect.isfunction(plain):
                yield plain.__code__


def _named(code: CodeType, operations: tuple[str, ...]) -> Iterator[str]:
    for step in dis.get_instructions(code):
        if step.opname in operations:
            yield step.argval
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _named(constant, operations)
