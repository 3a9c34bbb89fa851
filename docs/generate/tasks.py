"""The tasks that come with tightloop, from the docstrings of their modules."""

from __future__ import annotations

import sys

from generate.tables import table
from tightloop.env.registry import GYMNASIUM_TASKS, TASKS, make_task


def parts() -> dict[str, str]:
    """Parts of the page `reference/tasks.md`."""
    rows, modules = [], dict[str, list[str]]()
    for name in TASKS | GYMNASIUM_TASKS:
        task = make_task(name, {})
        cls = type(task)
        summary = (cls.__doc__ or "").partition("\n")[0]
        rows.append(
            [
                f"`{name}`",
                f"`tightloop/{name}`" if name in GYMNASIUM_TASKS else f"`tightloop/{name}-v0`",
                str(task.max_episode_steps),
                summary,
            ]
        )
        modules.setdefault(cls.__module__, []).append(name)
    texts = []
    for module, names in modules.items():
        doc = (sys.modules[module].__doc__ or "").strip().replace("``", "`")
        texts.append(f"## {', '.join(names)}\n\n{doc}\n")
    return {
        "table": table(["task", "gymnasium id", "steps per episode", "goal"], rows),
        "tasks": "\n".join(texts),
    }
