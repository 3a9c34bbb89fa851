"""Rollouts: a sequence of commands per world, and what comes out of it; `Sim.rollout` makes them."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop._core import Frame
from tightloop.arrays.frames import FAULTED, FrameCopy, unknown_field
from tightloop.arrays.inputs import real_numbers, switches
from tightloop.checks.attributes import suggestion
from tightloop.errors import ArgumentError, CommandRefused, TightloopError
from tightloop.planning.policy_rollouts import PolicyArguments, PolicyRun, count_of
from tightloop.sim.command_rows import COMMANDS

#: Fields of every frame, which are not collected unless they are asked for.
_ALWAYS = ("time", "step", "status", "contacts_left_out")


class Rollout:
    """What `Sim.rollout` collected: each field as an attribute, shape ``(frames, worlds, …)``, in memory of its own.

    Attributes:
        fields: Names of the collected fields.
        frames: Number of frames.
        status: Status bits of each frame, as `Frame.status`, uint32, ``(frames, worlds)``.
        cost: Sum of the costs over the frames, float64, ``(worlds,)``; ``inf`` for worlds that faulted. None without a
            cost function.
        memory: What the policy keeps from frame to frame, ``(worlds, values)``, for a rollout that continues this one.
            None without a policy.

    Raises:
        UnknownField: The field was not collected.
    """

    def __init__(self, arrays: dict[str, NDArray[Any]], status: NDArray[np.uint32], has_cost: bool) -> None:
        self._arrays = arrays
        self.status = status
        self.fields = tuple(arrays)
        self.frames: int = len(status)
        self.cost: NDArray[np.float64] | None = np.zeros(status.shape[1]) if has_cost else None
        self.memory: NDArray[np.float64] | None = None

    @property
    def faulted(self) -> NDArray[np.bool_]:
        """Whether each world was faulted in some frame, ``(worlds,)``; its arrays are not a valid future from there."""
        return ((self.status & FAULTED) != 0).any(axis=0)

    def __getattr__(self, name: str) -> NDArray[Any]:
        if name.startswith("_"):
            raise AttributeError(name)
        if name in self._arrays:
            return self._arrays[name]
        raise unknown_field(name, self.fields, ())

    def __repr__(self) -> str:
        faults = int(self.faulted.sum())
        of_fields = ", ".join(self.fields) or "no field"
        return f"Rollout(frames={self.frames}, worlds={self.status.shape[1]}, {of_fields}, faulted={faults})"


class Run:
    """One call of `Sim.rollout`: checks its arguments, then steps.

    Args:
        sim: The simulation.
        commands: As in `Sim.rollout`, and so are the others.
        fields: Fields to collect, or None.
        cost: Cost function, or None.
        out: Rollout to write again, or None.
        asked: Policy, number of frames, inputs and memory, each of which may be None.

    Raises:
        ArgumentError: An argument is not valid, or ``out`` does not fit.
        UnknownField: Frames of this run do not carry the field.
    """

    def __init__(
        self,
        sim: Any,
        commands: Mapping[str, Any] | None,
        fields: Sequence[str] | None,
        cost: Callable[..., NDArray[Any]] | None,
        out: Rollout | None,
        *,
        asked: PolicyArguments,
    ) -> None:
        if cost is not None and not callable(cost):
            raise ArgumentError(f"rollout: cost is {cost!r:.80}; give a function of a frame, which returns (worlds,)")
        self._sim, self._cost = sim, cost
        self._policy: PolicyRun | None = None
        extra: dict[str, tuple[tuple[int, ...], np.dtype[Any]]] = {}
        if asked.policy is None:
            if isinstance(commands, str | os.PathLike):
                raise ArgumentError(f"rollout: commands is {os.fspath(commands)!r:.80}; give it as policy=")
            asked.refuse_others()
            self._commands, frames = _sequences(commands)
        else:
            self._commands, lengths = ({}, []) if commands is None else _checked(commands)
            frames = count_of(asked.frames, lengths)
            self._policy = PolicyRun(sim, frames, self._commands, asked)
            extra = self._policy.shapes()
        fields, extra = _without_extra(fields, extra)
        made = _shapes(sim, _chosen(sim, fields, cost is not None), frames) | extra
        if out is None:
            arrays = {name: np.empty(shape, dtype) for name, (shape, dtype) in made.items()}
            status = np.empty((frames, sim.worlds), np.uint32)
            self._out = Rollout(arrays, status, cost is not None)
        else:
            self._out = _fitting(out, made, (frames, sim.worlds), cost is not None)

    def go(self) -> Rollout:
        """Step through the commands; return what was collected.

        Raises:
            CommandRefused: A command is not valid; the message names the frame.
        """
        sim, out = self._sim, self._out
        if out.cost is not None:
            out.cost[:] = 0.0
        if self._policy is not None:
            return self._with_policy(self._policy)
        in_flight, index, last = False, 0, None
        try:
            for index in range(out.frames):
                sim.send(**{name: _at(value, index) for name, value in self._commands.items()})
                in_flight = True
                if last is not None:
                    self._take(last, index - 1)
                    last = None
                last = sim.recv()
                in_flight = False
        except BaseException as problem:
            # Ctrl-C can come between the end of `send` and the next line
            if in_flight or not isinstance(problem, TightloopError):
                _finish(sim)
            if isinstance(problem, CommandRefused):
                raise type(problem)(f"rollout: frame {index}: {problem}") from None
            raise
        if last is not None:
            self._take(last, out.frames - 1)
        if out.cost is not None:
            out.cost[out.faulted] = np.inf
        return out

    def _with_policy(self, policy: PolicyRun) -> Rollout:
        out = self._out
        out.memory = policy.go({**out._arrays, "status": out.status}, None if out.cost is None else self._add_cost)
        if out.cost is not None:
            out.cost[out.faulted] = np.inf
        return out

    def _take(self, frame: Frame, index: int) -> None:
        out = self._out
        out.status[index] = frame.status
        for name, array in out._arrays.items():
            array[index] = getattr(frame, name)
        self._add_cost(frame)

    def _add_cost(self, frame: Frame | FrameCopy) -> None:
        out = self._out
        if self._cost is not None and out.cost is not None:
            given = np.asarray(self._cost(frame))
            if given.shape != out.cost.shape or given.dtype.kind not in "fiu":
                found = f"{given.dtype} of shape {given.shape}"
                raise ArgumentError(f"rollout: cost returned {found}; return real numbers of shape {out.cost.shape}")
            out.cost += given


def _finish(sim: Any) -> None:
    """End the step in flight, if there is one still, so that the simulation takes commands again."""
    with suppress(TightloopError):
        sim.recv()


def _without_extra(fields: Any, extra: dict[str, Any]) -> tuple[Any, dict[str, Any]]:
    """Return the fields without what only a policy has, and of that what is asked for."""
    if not isinstance(fields, Sequence) or isinstance(fields, str):
        return fields, {}
    asked = {name: shape for name, shape in extra.items() if name in fields}
    return [name for name in fields if not (isinstance(name, str) and name in asked)], asked


def _sequences(commands: Any) -> tuple[dict[str, Any], int]:
    """Return the commands as arrays, with the frames first, and the number of frames."""
    ready, lengths = _checked(commands)
    return ready, lengths[0]


def _checked(commands: Any) -> tuple[dict[str, Any], list[int]]:
    """Return the commands as arrays, with the frames first, and their number of frames, once."""
    if not isinstance(commands, Mapping) or not commands:
        cure = 'give a dict by command, such as {"joint_f": array of shape (frames, worlds, dofs)}'
        found = "empty" if isinstance(commands, Mapping) else type(commands).__name__
        raise ArgumentError(f"rollout: commands is {found}; {cure}")
    ready, lengths = {}, {}
    for name, value in commands.items():
        if name not in COMMANDS:
            raise ArgumentError(f"rollout: commands has {name!r:.80}; {suggestion(str(name), tuple(COMMANDS))}")
        ready[name] = _ready(name, name, value, lengths)
    if len({*lengths.values()}) != 1:
        found = ", ".join(f"{what} {length}" for what, length in lengths.items()) or "none"
        raise ArgumentError(f"rollout: commands have different numbers of frames: {found}; give all the same number")
    frames = next(iter(lengths.values()))
    if frames == 0:
        raise ArgumentError("rollout: commands have 0 frames; give at least one")
    return ready, [frames]


def _ready(command: str, what: str, value: Any, lengths: dict[str, int]) -> Any:
    if isinstance(value, Mapping):
        return {name: _ready(command, f"{what} of {name!r:.80}", own, lengths) for name, own in value.items()}
    try:
        array = (switches if COMMANDS[command].is_switch else real_numbers)(what, value)
    except CommandRefused as problem:
        raise ArgumentError(f"rollout: commands: {problem}") from None
    if array.ndim == 0 or (array.ndim == 1 and what == command):
        raise ArgumentError(
            f"rollout: commands: {what} has shape {array.shape}; give (frames, worlds, columns) or (frames, columns)"
        )
    lengths[what] = len(array)
    return array


def _at(value: Any, index: int) -> Any:
    """Return the command of one frame."""
    return {name: _at(own, index) for name, own in value.items()} if isinstance(value, dict) else value[index]


def _chosen(sim: Any, fields: Any, has_cost: bool) -> list[str]:
    if fields is None:
        return [] if has_cost else [name for name in sim.fields if name not in _ALWAYS]
    if isinstance(fields, str) or not isinstance(fields, Sequence):
        raise ArgumentError(f"rollout: fields is {fields!r:.80}; give a list of names, such as ('joint_q',)")
    known = [field["name"] for field in sim.info["known_fields"]]
    for name in fields:
        if not isinstance(name, str):
            raise ArgumentError(f"rollout: fields has {name!r:.80}; give names, such as 'joint_q'")
        if name not in sim.fields:
            raise unknown_field(name, sim.fields, known)
    return [name for name in dict.fromkeys(fields) if name != "status"]  # which is collected anyway


def _shapes(sim: Any, names: Sequence[str], frames: int) -> dict[str, tuple[tuple[int, ...], np.dtype[Any]]]:
    of_frame = {field["name"]: field for field in sim.info["fields"]}
    return {name: ((frames, *of_frame[name]["shape"]), np.dtype(_dtype(of_frame[name]["dtype"]))) for name in names}


def _dtype(name: str) -> str:
    """Return NumPy's name of a type of a field, such as ``f32``."""
    return f"{name[0]}{int(name[1:]) // 8}"


def _fitting(
    out: Any, made: Mapping[str, tuple[tuple[int, ...], np.dtype[Any]]], shape: tuple[int, int], has_cost: bool
) -> Rollout:
    cure = "give a rollout of the same simulation, frames, fields and cost, or leave it out"
    if not isinstance(out, Rollout):
        raise ArgumentError(f"rollout: out is {type(out).__name__}; {cure}")
    if out.status.shape != shape:
        raise ArgumentError(f"rollout: out has (frames, worlds) {out.status.shape}, the commands {shape}; {cure}")
    there = {name: (array.shape, array.dtype) for name, array in out._arrays.items()}
    if there != dict(made):
        raise ArgumentError(f"rollout: out has {_listed(there)}, this rollout {_listed(made)}; {cure}")
    if (out.cost is not None) != has_cost:
        raise ArgumentError(f"rollout: out has {'a' if out.cost is not None else 'no'} cost; {cure}")
    return out


def _listed(arrays: Mapping[str, tuple[tuple[int, ...], np.dtype[Any]]]) -> str:
    return ", ".join(f"{name} {dtype}{list(shape)}" for name, (shape, dtype) in arrays.items()) or "no field"
