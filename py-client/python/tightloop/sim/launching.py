"""Start a daemon with `launch`, or join a running one with `attach`."""

from __future__ import annotations

import os
import secrets
import time
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, overload

from tightloop import _core
from tightloop.checks import advice
from tightloop.checks import arguments as checks
from tightloop.checks.attributes import suggestion
from tightloop.checks.signatures import checked_calls
from tightloop.errors import ArgumentError, UnknownDaemon
from tightloop.scene.scene import Scene
from tightloop.sim.daemon import Daemon
from tightloop.sim.groups import Groups
from tightloop.sim.realtime import RealTime
from tightloop.sim.realtime import arguments as realtime_arguments
from tightloop.sim.sim import Sim

#: How often `attach` looks for a daemon that is still starting [s].
_ATTACH_SECONDS = 0.02
# The longest of its waits: ``inf`` is no time of the system's [s].
_SLICE_SECONDS = 3600.0


@overload
def launch(
    scene: Scene,
    *,
    worlds: int,
    groups: None = None,
    device: str = "auto",
    precision: str = "f32",
    cpu_bits: bool = False,
    threads: int | None = None,
    fields: Sequence[str] = ("joint_q", "joint_qd", "body_q"),
    params: Sequence[str] = (),
    bounds: Mapping[str, float] | None = None,
    on_fault: str = "freeze",
    on_nan: str = "refuse",
    draws: str = "world",
    outputs_at: str = "frame",
    realtime: float | RealTime | None = None,
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
    cpu_bits: bool = False,
    threads: int | None = None,
    fields: Sequence[str] = ("joint_q", "joint_qd", "body_q"),
    params: Sequence[str] = (),
    bounds: Mapping[str, float] | None = None,
    on_fault: str = "freeze",
    on_nan: str = "refuse",
    draws: str = "world",
    outputs_at: str = "frame",
    realtime: float | RealTime | None = None,
    name: str | None = None,
    log: str | os.PathLike[str] | None = None,
    frames_held: int = 4,
    watch_worlds: int = 256,
) -> Groups: ...


@checked_calls
def launch(
    scene: Scene,
    *,
    worlds: int,
    groups: int | None = None,
    device: str = "auto",
    precision: str = "f32",
    cpu_bits: bool = False,
    threads: int | None = None,
    fields: Sequence[str] = ("joint_q", "joint_qd", "body_q"),
    params: Sequence[str] = (),
    bounds: Mapping[str, float] | None = None,
    on_fault: str = "freeze",
    on_nan: str = "refuse",
    draws: str = "world",
    outputs_at: str = "frame",
    realtime: float | RealTime | None = None,
    name: str | None = None,
    log: str | os.PathLike[str] | None = None,
    frames_held: int = 4,
    watch_worlds: int = 256,
) -> Sim | Groups:
    """Start a daemon that simulates a scene, and join it. The daemon ends with this process, even after a crash.

    Args:
        scene: The scene; later changes to it have no effect.
        worlds: Number of worlds, at least 1.
        groups: Number of groups that share the worlds evenly. Groups step independently, so that you can work on the
            frame of one while another steps. Each world has the same bits as without groups. Error messages count the
            worlds of their group. If left out, one simulation has all worlds.
        device: ``"cpu"``, ``"gpu"`` for the first GPU, or ``"gpu:1"`` or ``"gpu:nvidia"`` for another, by its number or
            a part of its name; ``tightloop devices`` lists them. ``"auto"`` measures a hardware GPU and the CPU at
            the first launch of 128 or more worlds in single precision, and uses the faster one. It uses the CPU for
            others. `Sim.device` names the choice, and ``Sim.info["notes"]`` the rates.
        precision: ``"f32"``, or ``"f64"`` for the same physics in double precision.
        cpu_bits: Let a GPU compute the bits of the CPU, so that a run repeats on the other one, and its recordings
            replay on any machine. A world then has one thread of the GPU, which takes longer where there are contacts.
            A driver whose rounding cannot be corrected is refused. In frames of both, zeros have no sign, and numbers
            below 1.2e-38 are 0.
        threads: Largest number of threads of a step, shared by all groups; all cores if left out.
        fields: Frame fields besides ``time``, ``step``, ``status`` and ``contacts_left_out``: names of `Frame`
            attributes, and of images of cameras, such as ``"wrist_depth"`` (`Scene.add_camera`).
        params: Model parameters that vary between worlds and can be written at run time, such as ``"shape_mu"``,
            ``"joint_friction"``, ``"command_delay"``, ``"gyro_noise"``; `Sim.params` lists them all. Parameters that
            the scene names and those that `Scene.randomize` draws vary too.
        bounds: Largest absolute ``"joint_q"`` [rad or m] and ``"joint_qd"`` [rad/s or m/s]. A world beyond a bound
            faults: it keeps its state before that frame, with bit 8 of ``status``. What is left out is 1e10, as in
            MuJoCo, and 1e5; ``inf`` is no bound.
        on_fault: What happens to a faulted world: ``"freeze"`` keeps its state until it is reset, ``"reset"`` resets it
            before its next step, so that one frame shows its ``status``.
        on_nan: What happens to a command that is NaN or infinite in some world: ``"refuse"`` refuses it for all worlds,
            ``"freeze"`` faults that world, and the others continue.
        draws: What the draws of start states, parameters and noise depend on, besides a world's episode and ``step``:
            ``"world"`` is its index and its seed, ``"seed"`` its seed alone, so that an environment draws the same
            values at any index. Worlds with the same seed then have the same draws, and all worlds start with seed 0:
            give ``reset(seed=...)`` a sequence with one seed per world.
        outputs_at: Which state the evaluated fields of a step belong to. ``"frame"`` is the state in the frame.
            ``"last_substep"`` is where forces were evaluated last, as MuJoCo's ``mj_step`` leaves its data: the state
            before the last substep, or the last of the four points of a Runge-Kutta substep. Positions, velocities,
            activations, commands and counters are those of the frame. Frames of other calls than steps evaluate all
            fields at their state. It saves an evaluation per step, and needs the CPU. With a Runge-Kutta integrator,
            ``sensordata`` does not have it.
        realtime: Keep to real time: simulated seconds per second, so that ``1.0`` is real time, or a `RealTime` with
            more choices. A step then returns when its frame is due, and `Sim.timing` tells how well that went. If left
            out, a step returns as soon as it can.
        name: Name of the daemon for `attach`; a unique one if left out. With several groups, each has the name and its
            index, such as ``"franka.0"``. With one group, `attach` returns its `Sim`.
        log: File for the daemon's log, such as the number of faulted worlds, with at most one line per second. If left
            out, warnings and errors go to stderr.
        frames_held: Largest number of frames alive at once, at least 1, for each group.
        watch_worlds: Largest number of worlds that observers such as the viewer see, for each group: the first ones.

    Returns:
        A `Sim`, or with ``groups`` the `Groups`, a sequence of them.

    Warns:
        TightloopWarning: A value of the scene is valid and most likely a mistake; the message names it and the cure.

    Raises:
        ArgumentError: An argument is not valid; the message lists what is valid.
        SceneError: The scene is not valid.
        ResourceError: There is not enough memory or shared memory for the worlds.
        LaunchError: The daemon did not start; the message has the reason.
    """
    if not isinstance(scene, Scene):
        cure = "; Scene.load, add_urdf and from_mujoco read files" if isinstance(scene, str | os.PathLike) else ""
        raise ArgumentError(f"launch: scene is {type(scene).__name__}; give a tightloop.Scene{cure}")
    _check_names("fields", fields)
    _check_names("params", params)
    # this checks types; the daemon checks values before it allocates anything
    arguments: dict[str, Any] = {
        "worlds": checks.integer("launch: worlds", worlds, error=ArgumentError),
        "device": checks.text("launch: device", device, error=ArgumentError),
        "precision": checks.text("launch: precision", precision, error=ArgumentError),
        "fields": _joined("fields", fields, "field", [*_core.field_names(), *_image_fields(scene)]),
        "params": _joined("params", params, "parameter", _core.param_names()),
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
    arguments["outputs-at"] = checks.text("launch: outputs_at", outputs_at, error=ArgumentError)
    arguments |= _bounds(bounds) | realtime_arguments(realtime)
    if checks.flag("launch: cpu_bits", cpu_bits, error=ArgumentError):
        arguments["cpu-bits"] = True
    if threads is not None:
        arguments["threads"] = checks.integer("launch: threads", threads, error=ArgumentError)
    if log is not None:
        file = arguments["log"] = checks.path("launch: log", log, error=ArgumentError)
        if not file.parent.is_dir():
            raise ArgumentError(f"launch: log is {file}, and there is no folder {file.parent}; make it first")
    daemon = Daemon.start(scene.to_toml(), arguments, users=count)
    try:
        sims = [Sim(_core.Client(own, lease=True), daemon) for own in _names(arguments["name"], count)]
        for sim in sims:
            scene._running.add(sim)
        for warning in sims[0].info["warnings"]:
            advice.warn(warning)
        if device == "gpu":
            _warn_of_software(sims[0].info["adapter"])
    except BaseException:
        daemon.stop()
        raise
    return sims[0] if groups is None else Groups(arguments["name"], sims)


def _image_fields(scene: Scene) -> list[str]:
    """Return the names of the fields of a scene's cameras."""
    return [name for camera in scene.cameras.values() for name in camera.fields]


def _check_names(argument: str, names: Any) -> None:
    """Refuse what is no list of names."""
    if isinstance(names, str):
        raise ArgumentError(f"launch: {argument} is {names!r}; give a list of names, such as ({names!r},)")
    if not isinstance(names, Iterable):
        raise ArgumentError(f"launch: {argument} is {names!r}; give a list of names, or () for none")
    if isinstance(names, Mapping):
        cure = "sim.params.write sets values" if argument == "params" else "a frame has their values"
        raise ArgumentError(f"launch: {argument} is a dict; give a list of names, and {cure} after the launch")


def _warn_of_software(adapter: str) -> None:
    """Warn where a GPU was asked for and the only one is a driver that computes on the CPU."""
    if any(driver in adapter.lower() for driver in ("llvmpipe", "lavapipe", "swiftshader")):
        advice.warn(
            f"device is 'gpu', and the only one is the software driver {adapter}, which computes on the CPU: use "
            "device='cpu', which is faster, or device='gpu:0' if it is what you want"
        )


def _bounds(bounds: Mapping[str, float] | None) -> dict[str, float]:
    """Return the arguments of the daemon for bounds."""
    if bounds is not None and not isinstance(bounds, Mapping):
        raise ArgumentError(f'launch: bounds is {bounds!r}; give a dict, such as {{"joint_qd": 50.0}}')
    arguments = {}
    for bound, value in (bounds or {}).items():
        if bound not in ("joint_q", "joint_qd"):
            raise ArgumentError(f"launch: bounds has {bound!r}; give joint_q and joint_qd, or one of them")
        name_of = f"launch: bounds of {bound}"
        checked = checks.number(name_of, value, above=0.0, infinite=True, error=ArgumentError)
        arguments[f"{bound.replace('_', '-')}-max"] = checked
    return arguments


def _joined(argument: str, names: Iterable[str], kind: str, known: Sequence[str]) -> str:
    checked = [checks.text(f"launch: an entry of {argument}", name, error=ArgumentError) for name in names]
    for name in checked:
        if "," in name:
            raise ArgumentError(f"launch: an entry of {argument} is {name!r}; give each name as an entry of its own")
        if name not in known:
            raise ArgumentError(
                f"launch: {argument} has {name!r}, and there is no such {kind}; {suggestion(name, known)}"
            )
    return ",".join(checked)


def _names(daemon: str, groups: int) -> list[str]:
    """Return the names of the daemon's simulations."""
    return [daemon] if groups == 1 else [f"{daemon}.{group}" for group in range(groups)]


@checked_calls
def attach(name: str, *, timeout: float | None = None) -> Sim | Any:
    """Join a running daemon, which continues when this client ends.

    The first command makes this client the controller. Until it releases control, the commands of other clients raise
    `LeaseHeld`.

    Args:
        name: Name of the daemon, or ``"franka.0"`` for one of its groups.
        timeout: How long to wait for a daemon that is still starting [s]; ``inf`` is no limit. If left out, the daemon
            has to be ready, or gets 10 s where it has begun to start.

    Returns:
        A `Sim`, or the `Groups` of a daemon with several groups.

    Raises:
        ArgumentError: The name is not valid for a daemon, or the timeout is not.
        UnknownDaemon: No daemon of that name is running, or was ready in time; the message lists those that are.
        WaitTimeout: Another program holds the daemon's name, and does not answer.
        ProtocolMismatch: The daemon has another version.
    """
    name = checks.text("attach: name", name, error=ArgumentError)
    if timeout is None:
        return _attach(name)
    seconds = checks.number("attach: timeout", timeout, least=0.0, infinite=True, error=ArgumentError)
    end = time.monotonic() + seconds
    while True:
        try:
            return _attach(name, min(max(end - time.monotonic(), _ATTACH_SECONDS), _SLICE_SECONDS))
        except UnknownDaemon as problem:
            left = end - time.monotonic()
            if left <= 0.0:
                waited = "" if "still starting" in str(problem) else f" (waited {seconds:g} s for it)"
                raise UnknownDaemon(f"{problem}{waited}") from None
        time.sleep(min(_ATTACH_SECONDS, left))


def _attach(name: str, wait: float | None = None) -> Sim | Any:
    count = _core.groups(name, wait)
    sims = [Sim(_core.Client(own, lease=False), None) for own in _names(name, count)]
    return sims[0] if count == 1 else Groups(name, sims)
