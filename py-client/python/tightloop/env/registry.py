"""Tasks by name."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any

from tightloop.env.task import Task
from tightloop.errors import ArgumentError
from tightloop.registration import TASKS


def make_task(task: Task | type[Task] | str, options: Mapping[str, Any]) -> Task:
    """A task as it is, of its class, or by the name of one of `tightloop.tasks`.

    Raises:
        ArgumentError: There is no such task, or it does not take these options.
    """
    if isinstance(task, Task):
        if options:
            raise ArgumentError(f"{', '.join(options)}: unknown argument; options of a task go to its constructor")
        return task
    if isinstance(task, str):
        if task not in TASKS:
            raise ArgumentError(f"there is no task {task!r}; there are: {', '.join(TASKS)}, and those of your own")
        module, _, name = TASKS[task].partition(":")
        task = getattr(import_module(module), name)
    if not (isinstance(task, type) and issubclass(task, Task)):
        raise ArgumentError(f"task is {task!r}; give a Task, its class or a name")
    try:
        return task(**options)
    except TypeError as problem:
        raise ArgumentError(f"task {task.__name__}: {problem}") from None
