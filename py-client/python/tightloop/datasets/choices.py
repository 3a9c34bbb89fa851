"""What to take from a recording: its fields, worlds and rate, and the columns that are the action."""

from __future__ import annotations

import fnmatch
import json
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop import _core
from tightloop.checks import arguments as checks
from tightloop.checks.attributes import suggestion
from tightloop.errors import ArgumentError, UnknownField
from tightloop.scene.cameras.camera import Camera
from tightloop.scene.scene import Scene

#: Fields of the observations if none are named.
FIELDS = ("joint_q", "joint_qd")
#: Fields of which a state consists.
STATE_FIELDS = ("joint_q", "joint_qd", "act")
#: Names of an axis in the daemon's description of itself.
_NAMES_OF_AXES = {
    "coords": "coord_names",
    "dofs": "dof_names",
    "bodies": "body_names",
    "sites": "site_names",
    "actuators": "actuator_names",
    "activations": "activation_names",
    "contact_sensors": "contact_sensor_names",
    "mocaps": "mocap_names",
    "equalities": "equality_names",
}
# How a free body's dofs end.
_PARTS_OF_FREE = ("vx", "vy", "vz", "wx", "wy", "wz")
# Rounding errors of a rate that is given in decimals.
_RATE_SLACK = 1e-6


@dataclass(frozen=True)
class Layout:
    """What all episodes of a dataset have in common.

    Attributes:
        info: The daemon's description of itself, as `Sim.info`.
        fields: Fields of the observations.
        columns: Names along the second axis of a field, by field; empty if they have none.
        action_fields: Commands that make up the action.
        action_places: Columns of each command that are part of the action, by command.
        action_names: Name of each column of the action.
        state_fields: Fields that make up a state.
        worlds: Worlds of the recording that are exported.
        every: Control frames per frame of the dataset.
        fps: Frames per second of the dataset [1/s].
        cameras: Cameras of the replay, besides those of the recorded scene.
    """

    info: Mapping[str, Any]
    fields: tuple[str, ...]
    columns: Mapping[str, tuple[str, ...]]
    action_fields: tuple[str, ...]
    action_places: Mapping[str, NDArray[np.intp]]
    action_names: tuple[str, ...]
    state_fields: tuple[str, ...]
    worlds: tuple[int, ...]
    every: int
    fps: float
    cameras: tuple[Camera, ...] = ()

    @property
    def period(self) -> float:
        """Time between two control frames of the recording [s]."""
        return control_period(self.info)

    @property
    def replayed(self) -> tuple[str, ...]:
        """Fields that a replay evaluates."""
        return tuple(dict.fromkeys((*self.fields, *self.action_fields, *self.state_fields)))


def control_period(info: Mapping[str, Any]) -> float:
    """Return the time between two control frames [s]."""
    return info["dt"] * info["substeps"]


def layout(
    recording: str | os.PathLike[str],
    *,
    fields: Sequence[str],
    action: str | Sequence[str] | None,
    joints: Sequence[str] | None,
    worlds: int | Sequence[int] | None,
    fps: float | None,
    cameras: Scene | None = None,
) -> Layout:
    """Check choices against a recording.

    Args:
        recording: Path of the recording.
        fields: As of `episodes`.
        action: As of `episodes`.
        joints: As of `episodes`.
        worlds: As of `episodes`.
        fps: As of `episodes`.
        cameras: As of `episodes`.

    Raises:
        ArgumentError: A choice is not valid; the message names it.
        RecordingError: The recording cannot be read.
        UnknownField: There is no such field.
    """
    path = checks.path("export: recording", recording, error=ArgumentError)
    info: dict[str, Any] = json.loads(_core.Playback(path, 1, []).describe())
    chosen = _names("fields", fields)
    further = tuple(_cameras(cameras))
    images: dict[str, dict[str, Any]] = {name: {} for camera in further for name in camera.fields}
    known = images | {field["name"]: field for field in info["known_fields"]}
    for name in chosen:
        if name not in known:
            raise UnknownField(f"export: fields has {name!r}; {suggestion(name, list(known))}")
    columns = {name: _columns(info, known.get(name, {})) for name in {*known, *chosen}}
    commands = _action(path, info, action)
    places, names = _action_columns(_sizes(info), commands, columns, joints)
    every, rate = _rate(info, fps)
    return Layout(
        info=info,
        fields=chosen,
        columns=columns,
        action_fields=commands,
        action_places=places,
        action_names=names,
        state_fields=tuple(name for name in STATE_FIELDS if columns[name]),
        worlds=_worlds(info["worlds"], worlds),
        every=every,
        fps=rate,
        cameras=further,
    )


def _cameras(scene: Scene | None) -> Iterable[Camera]:
    if scene is None:
        return ()
    if not isinstance(scene, Scene):
        raise ArgumentError(f"export: cameras is {scene!r:.80}; give a tightloop.Scene with cameras")
    return scene.cameras.values()


def _names(what: str, given: str | Sequence[str]) -> tuple[str, ...]:
    if isinstance(given, str) or not isinstance(given, Sequence) or not all(isinstance(name, str) for name in given):
        raise ArgumentError(f"export: {what} is {given!r:.80}; give a list of names")
    if not given:
        raise ArgumentError(f"export: {what} is empty; give at least one name")
    return tuple(dict.fromkeys(given))


def _columns(info: Mapping[str, Any], field: Mapping[str, Any]) -> tuple[str, ...]:
    axes = re.findall(r"\w+", field.get("axes", ""))
    key = _NAMES_OF_AXES.get(axes[1]) if len(axes) > 1 else None
    names: list[str] = info[key] if key else []
    if field.get("name") != "qpos":
        return tuple(names)
    turned = list(names)
    for place, name in enumerate(names):
        # MuJoCo's quaternions begin with w
        if name.endswith(".qx"):
            turned[place : place + 4] = [names[place + 3], *names[place : place + 3]]
    return tuple(turned)


def _sizes(info: Mapping[str, Any]) -> dict[str, int]:
    """Return the commands that frames show, with their number of columns in a world."""
    shown = {field["name"] for field in info["known_fields"]}
    return {command["name"]: command["columns"] for command in info["commands"] if command["name"] in shown}


def _action(path: os.PathLike[str], info: Mapping[str, Any], given: str | Sequence[str] | None) -> tuple[str, ...]:
    sizes = _sizes(info)
    if given is not None:
        chosen = _names("action", [given] if isinstance(given, str) else given)
        for name in chosen:
            if name not in sizes:
                raise ArgumentError(f"export: action has {name!r}, which is no command; {suggestion(name, [*sizes])}")
        return chosen
    sent = _first_sent(path, set(sizes))
    if not sent:
        raise ArgumentError(
            f"export: no client sent a command that frames show; name the action, one of {', '.join(sizes)}"
        )
    return tuple(name for name in sizes if name in sent)


def _first_sent(path: os.PathLike[str], commands: set[str]) -> set[str]:
    """Return the commands of the first step that sent any."""
    playback = _core.Playback(path, 1, [])
    while playback.next() is not None:
        if sent := commands.intersection(playback.sent):
            return sent
    return set()


def _action_columns(
    sizes: Mapping[str, int],
    commands: Sequence[str],
    columns: Mapping[str, tuple[str, ...]],
    joints: Sequence[str] | None,
) -> tuple[dict[str, NDArray[np.intp]], tuple[str, ...]]:
    patterns = None if joints is None else _names("joints", joints)
    places: dict[str, NDArray[np.intp]] = {}
    names: list[str] = []
    for command in commands:
        there = columns[command]
        # of the components of a vector, such as mocap_pos
        parts = sizes[command] // max(len(there), 1)
        chosen = [place for place, name in enumerate(there) if _is_chosen(name, there, patterns)]
        places[command] = np.asarray([place * parts + part for place in chosen for part in range(parts)], np.intp)
        ending = "" if len(commands) == 1 else f".{command}"
        endings = [f"{ending}.{part}" for part in range(parts)] if parts > 1 else [ending]
        names += [there[place] + each for place in chosen for each in endings]
    named = [name for command in commands for name in columns[command]]
    for pattern in patterns or ():
        if not any(_matches(name, [pattern]) for name in named):
            raise ArgumentError(
                f"export: joints has {pattern!r}, which the action has not; {suggestion(pattern, named)}"
            )
    if not names:
        raise ArgumentError(
            f"export: action is {', '.join(commands)}, which this scene has no columns of; name another"
        )
    return places, tuple(names)


def _is_chosen(name: str, there: Sequence[str], patterns: Sequence[str] | None) -> bool:
    if patterns is not None:
        return _matches(name, patterns)
    # no motor moves a free body
    body, _, part = name.rpartition(".")
    return part not in _PARTS_OF_FREE or f"{body}.vx" not in there


def _matches(name: str, patterns: Sequence[str]) -> bool:
    return any(fnmatch.fnmatchcase(name, pattern) for pattern in patterns)


def _worlds(there: int, given: int | Sequence[int] | None) -> tuple[int, ...]:
    if given is None:
        return tuple(range(there))
    if isinstance(given, int | np.integer):
        given = range(checks.integer("export: worlds", given, least=1, error=ArgumentError))
    if not isinstance(given, Sequence | np.ndarray):
        raise ArgumentError(f"export: worlds is {given!r:.80}; give how many, or a list of them")
    chosen = [checks.integer("export: an entry of worlds", world, least=0, error=ArgumentError) for world in given]
    if not chosen:
        raise ArgumentError("export: worlds is empty; give how many, or which ones")
    for world in chosen:
        if world >= there:
            raise ArgumentError(f"export: worlds has {world}, and there are {there} in the recording, from 0 on")
    return tuple(dict.fromkeys(chosen))


def _rate(info: Mapping[str, Any], fps: float | None) -> tuple[int, float]:
    """Return the control frames per frame of the dataset, and its frames per second."""
    rate = 1.0 / control_period(info)
    every = 1
    if fps is not None:
        fps = checks.number("export: fps", fps, above=0.0, error=ArgumentError)
        every = max(round(rate / fps), 1)
        if abs(rate / fps - every) > _RATE_SLACK * every:
            near = sorted({rate / every, rate / (every + 1), rate / max(every - 1, 1)})
            raise ArgumentError(
                f"export: fps is {fps:g}, of which the control rate, {rate:.6g}, is no multiple; give one such as "
                f"{' or '.join(f'{value:.6g}' for value in near)}"
            )
    value = rate / every
    return every, round(value) if abs(value - round(value)) < _RATE_SLACK * value else value
