"""The tasks that come with tightloop, from the docstrings of their modules."""

from __future__ import annotations

import sys

from generate.tables import table
from tightloop.env.registry import make_task
from tightloop.registration import TASKS

INTRODUCTION = """# Tasks

Each is a scene and pure functions of arrays, in `tightloop.tasks`; [environments](environments.md) says how to use
them and how to write your own. `control=` chooses what an action of an arm does: `joint_target`, `joint_delta`,
`end_effector_delta` or `torque`.
"""


def page() -> str:
    """The page."""
    rows, pages = [], dict[str, list[str]]()
    for name in TASKS:
        task = make_task(name, {})
        cls = type(task)
        summary = (cls.__doc__ or "").partition("\n")[0]
        rows.append([f"`{name}`", f"`tightloop/{name}-v0`", str(task.max_episode_steps), summary])
        pages.setdefault(cls.__module__, []).append(name)
    head = ["task", "gymnasium's id", "steps an episode", "what it is"]
    parts = [INTRODUCTION, table(head, rows)]
    for module, names in pages.items():
        doc = (sys.modules[module].__doc__ or "").strip().replace("``", "`")
        parts.append(f"## {', '.join(names)}\n\n{doc}\n")
    return "\n".join(parts)
