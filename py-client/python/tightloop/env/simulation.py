"""The simulation of an environment: launched for it, or a running one that it joins."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import tightloop as tl
from tightloop.env.controls import Control
from tightloop.env.episodes.disturbances import parameters
from tightloop.env.task import Task
from tightloop.env.task_checks import scene_of
from tightloop.errors import ArgumentError

#: Only the world with a NaN action fails; draws depend on a world's seed, not on its index.
DAEMON_OPTIONS: dict[str, Any] = {"on_nan": "freeze", "draws": "seed"}


def fields_of(task: Task, controls: Sequence[Control]) -> tuple[str, ...]:
    """Return the frame fields that the task's functions and its controls read, each once."""
    return tuple(dict.fromkeys([*task.fields, *(field for control in controls for field in control.fields)]))


def open_simulation(
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
    """Return the task's scene and a simulation of it.

    Args:
        task: The task.
        controls: Its controls.
        worlds: Number of worlds; None for those of the daemon, or 1.
        daemon: A running daemon or simulation to join; None launches one.
        device: As of `launch`.
        precision: As of `launch`.
        threads: As of `launch`.
        fields: Further frame fields besides those that the task reads.

    Raises:
        ArgumentError: The daemon runs another scene, or another number of worlds.
    """
    scene = scene_of(task)
    if daemon is None:
        options = options_of(task, controls, device=device, precision=precision, threads=threads, fields=fields)
        return scene, tl.launch(scene, worlds=1 if worlds is None else worlds, **options)
    if not isinstance(daemon, str | tl.Sim | tl.Groups):
        raise ArgumentError(f"daemon is {daemon!r}; give the name of a running one, or a Sim")
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
    """Return the arguments of `launch` for a task, without the number of worlds."""
    read = tuple(dict.fromkeys([*fields_of(task, controls), *fields]))
    varying = dict.fromkeys([*task.launch_options.get("params", ()), *parameters(task.disturbances())])
    own = {"fields": read, "device": device, "precision": "f32" if precision is None else precision, "threads": threads}
    more = {"params": tuple(varying)} if varying else {}
    return own | DAEMON_OPTIONS | task.launch_options | more


def _check(task: Task, scene: tl.Scene, sim: tl.Sim, fields: tuple[str, ...]) -> None:
    cure = "start it with `python -m tightloop.env serve`"
    if tl.Dynamics(scene).model_hash != sim.info["model_hash"]:
        raise ArgumentError(f"daemon `{sim.name}` runs another scene than the task's; {cure}")
    missing = [field for field in fields if field not in sim.fields]
    if missing:
        raise ArgumentError(f"daemon `{sim.name}` does not show {', '.join(missing)}; {cure}")
    # compare with what the daemon's description reports, which has no infinity
    bounds = {
        f"{name}_max": None if math.isinf(value) else value
        for name, value in task.launch_options.get("bounds", {}).items()
    }
    reported = {name: value for name, value in (DAEMON_OPTIONS | task.launch_options).items() if name in sim.info}
    for option, value in (reported | bounds).items():
        if sim.info[option] != value:
            raise ArgumentError(f"daemon `{sim.name}` has {option}={sim.info[option]}, not {value}; {cure}")
