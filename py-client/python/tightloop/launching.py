"""`launch` starts a daemon of its own, `attach` joins one that runs."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, overload

from tightloop import _core, checks
from tightloop.daemon import Daemon
from tightloop.errors import ArgumentError
from tightloop.groups import Groups
from tightloop.scene import Scene
from tightloop.sim import Sim


@overload
def launch(
    scene: Scene,
    *,
    worlds: int,
    groups: None = None,
    device: str = "auto",
    precision: str = "f32",
    threads: int | None = None,
    fields: Sequence[str] = ("joint_q", "joint_qd", "body_q"),
    params: Sequence[str] = (),
    bounds: Mapping[str, float] | None = None,
    on_fault: str = "freeze",
    on_nan: str = "refuse",
    draws: str = "world",
    name: str | None = None,
    log: str | os.PathLike[str] | None = None,
    frames_held: int = 4,
    watch_worlds: int = 256,
) -> Sim: ...


@overload
def launch(
    scene: Scene,
    *,
    worlds: int,
    groups: int,
    device: str = "auto",
    precision: str = "f32",
    threads: int | None = None,
    fields: Sequence[str] = ("joint_q", "joint_qd", "body_q"),
    params: Sequence[str] = (),
    bounds: Mapping[str, float] | None = None,
    on_fault: str = "freeze",
    on_nan: str = "refuse",
    draws: str = "world",
    name: str | None = None,
    log: str | os.PathLike[str] | None = None,
    frames_held: int = 4,
    watch_worlds: int = 256,
) -> Groups: ...


def launch(
    scene: Scene,
    *,
    worlds: int,
    groups: int | None = None,
    device: str = "auto",
    precision: str = "f32",
    threads: int | None = None,
    fields: Sequence[str] = ("joint_q", "joint_qd", "body_q"),
    params: Sequence[str] = (),
    bounds: Mapping[str, float] | None = None,
    on_fault: str = "freeze",
    on_nan: str = "refuse",
    draws: str = "world",
    name: str | None = None,
    log: str | os.PathLike[str] | None = None,
    frames_held: int = 4,
    watch_worlds: int = 256,
) -> Sim | Groups:
    """Start a daemon that simulates a scene, and join it. The daemon ends with this process, however that ends.

    Args:
        scene: What to simulate; later changes to it have no effect.
        worlds: How many copies of it, at least 1.
        groups: Into how many groups to split the worlds, evenly. They step independently, so that you work on the frame
            of one while another steps; each world does what it does without groups, bit for bit. Errors count the
            worlds of their group. Left out, there is one simulation of all.
        device: ``"cpu"``, ``"gpu"`` for the first GPU, ``"gpu:1"`` or ``"gpu:nvidia"`` for another, by its number or
            part of its name, as ``tightloop devices`` lists them, or ``"auto"`` for a GPU if there is one that is no
            software and there are at least 1024 worlds in single precision, else the CPU: `Sim.device` tells.
        precision: ``"f32"``, or ``"f64"`` for the same physics in double precision.
        threads: Most threads that steps may use, those of all groups together; all cores if left out.
        fields: What frames carry besides ``time``, ``step``, ``status`` and ``contacts_left_out``: names of `Frame`
            attributes.
        params: Numbers of the model that vary from world to world and may be written while it runs, besides those that
            the scene names, such as ``"shape_mu"``, ``"joint_friction"``, ``"command_delay"``, ``"gyro_noise"``;
            `Sim.params` lists them all. Those that `Scene.randomize` draws vary too.
        bounds: Largest ``"joint_q"`` [rad or m] and ``"joint_qd"`` [rad/s or m/s], in size; a world beyond one is
            frozen at its state before that frame, with bit 8 of ``status``. None if left out.
        on_fault: What becomes of a frozen world: ``"freeze"`` keeps it until it is reset, ``"reset"`` resets it
            before its next step, so that its ``status`` is seen once.
        on_nan: What becomes of a command that is NaN or infinite in some world: ``"refuse"`` refuses it for all worlds,
            ``"freeze"`` freezes that world as one that is no longer finite, and the others go on.
        draws: What start states, parameters and noise that are drawn depend on, besides a world's episode and ``step``:
            ``"world"`` its number and its seed, ``"seed"`` its seed alone, so that an environment has the same numbers
            wherever it stands. Worlds of one seed are then alike, and so they begin, with seed 0: give
            ``reset(seed=...)`` a sequence with one seed a world.
        name: Name of the daemon, for `attach`; a unique one if left out. Several groups have it with their number,
            ``"franka.0"``; a single one has the name itself, and `attach` gives its `Sim`.
        log: File for the daemon's news, such as how many worlds were frozen, at most one line a second; warnings and
            errors go to stderr if left out.
        frames_held: How many frames may be alive at once, at least 1; of each group.
        watch_worlds: How many worlds observers see, such as the viewer: the first ones, or all if there are fewer; of
            each group.

    Returns:
        A `Sim`, or with ``groups`` the `Groups`, which hold one for each.

    Raises:
        ArgumentError: An argument is not valid; the message lists what is.
        SceneError: The scene is not valid.
        ResourceError: Memory or shared memory does not hold that many worlds.
        LaunchError: The daemon did not start; the message holds its reason.
    """
    if not isinstance(scene, Scene):
        raise ArgumentError(f"launch: scene is {type(scene).__name__}; give a tightloop.Scene")
    for argument, names in (("fields", fields), ("params", params)):
        if isinstance(names, str):
            raise ArgumentError(f"launch: {argument} is {names!r}; give a list of names, such as ({names!r},)")
        if not isinstance(names, Iterable):
            raise ArgumentError(f"launch: {argument} is {names!r}; give a list of names, or () for none")
    # Types are checked here, values by the daemon, before it takes anything
    arguments: dict[str, Any] = {
        "worlds": checks.integer("launch: worlds", worlds, error=ArgumentError),
        "device": checks.text("launch: device", device, error=ArgumentError),
        "precision": checks.text("launch: precision", precision, error=ArgumentError),
        "fields": _joined("fields", fields),
        "params": _joined("params", params),
        "name": f"sim-{os.getpid()}-{secrets.token_hex(4)}"
        if name is None
        else checks.text("launch: name", name, error=ArgumentError),
        "frames-held": checks.integer("launch: frames_held", frames_held, error=ArgumentError),
        "watch-worlds": checks.integer("launch: watch_worlds", watch_worlds, error=ArgumentError),
    }
    count = 1 if groups is None else checks.integer("launch: groups", groups, error=ArgumentError)
    if count > 1:
        arguments["groups"] = count
    if arguments["device"].startswith("gpu:"):
        arguments["device"], arguments["adapter"] = arguments["device"].split(":", 1)
    arguments["on-fault"] = checks.text("launch: on_fault", on_fault, error=ArgumentError)
    arguments["on-nan"] = checks.text("launch: on_nan", on_nan, error=ArgumentError)
    arguments["draws"] = checks.text("launch: draws", draws, error=ArgumentError)
    if bounds is not None and not isinstance(bounds, Mapping):
        raise ArgumentError(f'launch: bounds is {bounds!r}; give a dict, such as {{"joint_qd": 50.0}}')
    for bound, value in (bounds or {}).items():
        if bound not in ("joint_q", "joint_qd"):
            raise ArgumentError(f"launch: bounds has {bound!r}; give joint_q and joint_qd, or one of them")
        name_of = f"launch: bounds of {bound}"
        arguments[f"{bound.replace('_', '-')}-max"] = checks.number(name_of, value, above=0.0, error=ArgumentError)
    if threads is not None:
        arguments["threads"] = checks.integer("launch: threads", threads, error=ArgumentError)
    if log is not None:
        arguments["log"] = checks.path("launch: log", log, error=ArgumentError)
    daemon = Daemon.start(scene.to_toml(), arguments, users=count)
    try:
        sims = [Sim(_core.Client(own, lease=True), daemon) for own in _names(arguments["name"], count)]
    except BaseException:
        daemon.stop()
        raise
    return sims[0] if groups is None else Groups(arguments["name"], sims)


def _joined(argument: str, names: Iterable[str]) -> str:
    checked = [checks.text(f"launch: an entry of {argument}", name, error=ArgumentError) for name in names]
    for name in checked:
        if "," in name:
            raise ArgumentError(f"launch: an entry of {argument} is {name!r}; give each name as an entry of its own")
    return ",".join(checked)


def _names(daemon: str, groups: int) -> list[str]:
    """Names of its simulations."""
    return [daemon] if groups == 1 else [f"{daemon}.{group}" for group in range(groups)]


def attach(name: str) -> Sim | Any:
    """Join a daemon that is already running. It goes on when this client ends.

    The first command makes this client its controller; until it ends, others that try get `LeaseHeld`.

    Args:
        name: The daemon's, or ``"franka.0"`` for one of its groups.

    Returns:
        A `Sim`; the `Groups` of a daemon that has several.

    Raises:
        ArgumentError: No daemon can have that name.
        UnknownDaemon: No daemon of that name is running; the message lists those that are.
        ProtocolMismatch: The daemon is of another release.
    """
    count = _core.groups(checks.text("attach: name", name, error=ArgumentError))
    sims = [Sim(_core.Client(own, lease=False), None) for own in _names(name, count)]
    return sims[0] if count == 1 else Groups(name, sims)
