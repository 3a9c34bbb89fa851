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
    daemon: str | tl.Sim | None,
    device: str,
    precision: str | None,
    threads: int | None,
    fields: Sequence[str] = (),
) -> tuple[tl.Scene, tl.Sim]:
    """The task's scene, and a simulation of it, whose own frames carry these fields besides what the task reads.

    Raises:
        ArgumentError: The daemon runs something else, or another number of worlds.
    """
    scene = task.scene()
    if daemon is None:
        options = options_of(task, controls, device=device, precision=precision, threads=threads, fields=fields)
        return scene, tl.launch(scene, worlds=1 if worlds is None else worlds, **options)
    sim = tl.attach(daemon) if isinstance(daemon, str) else daemon
    try:
        if isinstance(sim, tl.Groups):
            raise ArgumentError(f"daemon `{sim.name}` has its worlds in {len(sim)} groups; join `{sim[0].name}`, …")
        if device != "auto" or threads is not None:
            raise ArgumentError(f"device and threads are those of the daemon `{sim.name}`; leave them out")
        _check(task, scene, sim, fields_of(task, controls))
        for name, given, own in (("precision", precision, sim.precision), ("num_envs", worlds, sim.worlds)):
            if given is not None and given != own:
                raise ArgumentError(f"{name} is {given}, and daemon `{sim.name}` has {own}; leave it out")
    except ArgumentError:
        sim.close()
        raise
    return scene, sim


def options_of(
    task: Task,
    controls: Sequence[Control],
    *,
    device: str,
    precision: str | None,
    threads: int | None,
    fields: Sequence[str] = (),
) -> dict[str, Any]:
    """What `launch` is told for a task, but for the worlds."""
    read = tuple(dict.fromkeys([*fields_of(task, controls), *fields]))
    own = {"fields": read, "device": device, "precision": precision or "f32", "threads": threads}
    return own | DAEMON_OPTIONS | task.launch_options


def _check(task: Task, scene: tl.Scene, sim: tl.Sim, fields: tuple[str, ...]) -> None:
    cure = "start it with `python -m tightloop.env serve`"
    if tl.Dynamics(scene).model_hash != sim.info["model_hash"]:
        raise ArgumentError(f"daemon `{sim.name}` runs another scene than the task's; {cure}")
    missing = [field for field in fields if field not in sim.fields]
    if missing:
        raise ArgumentError(f"daemon `{sim.name}` does not show {', '.join(missing)}; {cure}")
    # what a description tells of them; a bound that is not given is infinite
    bounds = {f"{name}_max": value for name, value in task.launch_options.get("bounds", {}).items()}
    told = {name: value for name, value in (DAEMON_OPTIONS | task.launch_options).items() if name in sim.info}
    for option, value in (told | bounds).items():
        if sim.info[option] != value:
            raise ArgumentError(f"daemon `{sim.name}` has {option}={sim.info[option]}, not {value}; {cure}")
