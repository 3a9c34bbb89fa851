"""The simulation of an environment: one of its own, or one that runs already."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import tightloop as tl
from tightloop.env.controls import Control
from tightloop.env.task import Task
from tightloop.errors import ArgumentError

#: A world whose action is NaN fails alone; one with the seed s draws the same wherever it stands.
DAEMON_OPTIONS: dict[str, Any] = {"on_nan": "freeze", "draws": "seed"}


def fields_of(task: Task, controls: Sequence[Control]) -> tuple[str, ...]:
    """Fields of the frame that functions and controls read, each once."""
    return tuple(dict.fromkeys([*task.fields, *(field for control in controls for field in control.fields)]))


def begin(
    task: Task,
    controls: Sequence[Control],
    worlds: int | None,
    *,
    daemon: str | None,
    **options: Any,
) -> tuple[tl.Scene, tl.Sim]:
    """The task's scene, and a simulation of it.

    Raises:
        ArgumentError: The daemon runs something else, or another number of worlds.
    """
    scene, fields = task.scene(), fields_of(task, controls)
    if daemon is None:
        own = DAEMON_OPTIONS | task.launch_options
        return scene, tl.launch(scene, worlds=1 if worlds is None else worlds, fields=fields, **own, **options)
    sim = tl.attach(daemon)
    try:
        _check(scene, sim, fields, worlds)
    except ArgumentError:
        sim.close()
        raise
    return scene, sim


def _check(scene: tl.Scene, sim: tl.Sim, fields: tuple[str, ...], worlds: int | None) -> None:
    cure = "start it with `python -m tightloop.env serve`"
    if tl.Dynamics(scene).model_hash != sim.info["model_hash"]:
        raise ArgumentError(f"daemon `{sim.name}` runs another scene than the task's; {cure}")
    missing = [field for field in fields if field not in sim.fields]
    if missing:
        raise ArgumentError(f"daemon `{sim.name}` does not show {', '.join(missing)}; {cure}")
    for option, value in DAEMON_OPTIONS.items():
        if sim.info[option] != value:
            raise ArgumentError(f"daemon `{sim.name}` has {option}={sim.info[option]}, not {value}; {cure}")
    if worlds is not None and worlds != sim.worlds:
        raise ArgumentError(f"num_envs is {worlds}, and daemon `{sim.name}` has {sim.worlds} worlds; leave it out")
