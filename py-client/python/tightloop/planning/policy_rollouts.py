"""Rollouts with a policy in the daemon: the question of `Sim.rollout`, in pieces of about a second, and its answers."""

from __future__ import annotations

import json
import struct
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.arrays.frames import FrameCopy
from tightloop.arrays.inputs import reals
from tightloop.arrays.named_columns import named_columns
from tightloop.checks import arguments as checks
from tightloop.checks.attributes import suggestion
from tightloop.errors import ArgumentError, CommandRefused
from tightloop.planning.policies import Policy
from tightloop.planning.policy_columns import Columns
from tightloop.sim.command_arrays import columns_of
from tightloop.sim.snapshot import transfer_file

#: What is collected besides fields of frames, if it is asked for.
EXTRA = ("action", "observation")
#: Bytes that a piece collects at most, and seconds that it should take: Ctrl-C waits for it.
_BYTES, _SECONDS = 32 << 20, 1.0
#: Frames of the first piece, before anything is known of their speed.
_FIRST = 16
_ALIGNMENT = 64


@dataclass(frozen=True)
class PolicyArguments:
    """Arguments of a rollout that belong to its policy; see `Sim.rollout`."""

    policy: Any = None
    frames: Any = None
    inputs: Any = None
    memory: Any = None

    def refuse_others(self) -> None:
        """Refuse what only a policy takes.

        Raises:
            ArgumentError: There is something, and no policy.
        """
        for name in ("frames", "inputs", "memory"):
            if getattr(self, name) is not None:
                raise ArgumentError(f"rollout: {name} belongs to a policy; give policy=, or leave {name} out")


class PolicyRun:
    """The part of a rollout that runs a policy in the daemon.

    Args:
        sim: The simulation.
        frames: Number of frames.
        commands: Sequences by command, with the frames first, as `rollouts` checked them.
        asked: The policy, its inputs, and the memory that it continues with.

    Raises:
        ArgumentError: An argument is not valid.
        UnknownField: Frames of this run do not carry a field that the policy sees.
    """

    def __init__(self, sim: Any, frames: int, commands: Mapping[str, Any], asked: PolicyArguments) -> None:
        self.policy = asked.policy if isinstance(asked.policy, Policy) else Policy(asked.policy)
        self._sim, self._frames, self._commands = sim, frames, commands
        columns = Columns(self.policy, sim.info)
        policy = self.policy
        self._plain = {
            "size": policy.inputs,
            "layers": json.loads(policy._network.layers),
            "terms": columns.terms(),
            "clip": None if policy.clip is None else np.clip(policy.clip, *_bounds()).tolist(),
            "drives": columns.drives(),
        }
        self._inputs = _inputs(asked.inputs, columns.inputs, frames, sim.worlds)
        self._memory = _memory(asked.memory, sim.worlds)

    def shapes(self) -> dict[str, tuple[tuple[int, ...], np.dtype[Any]]]:
        """Return shape and dtype of what is collected besides fields."""
        sizes = (self.policy.actions, self.policy.inputs)
        worlds, single = self._sim.worlds, np.dtype(np.float32)
        return {name: ((self._frames, worlds, size), single) for name, size in zip(EXTRA, sizes, strict=True)}

    def go(self, arrays: Mapping[str, NDArray[Any]], cost: Any) -> NDArray[np.float64]:
        """Carry out the rollout; write what is collected into the arrays, and give each frame to the cost.

        Args:
            arrays: Arrays to write, by field, each ``(frames, worlds, …)``; those of ``EXTRA``, too.
            cost: Function of a frame, or None.

        Returns:
            The memory at the end, ``(worlds, values)``.
        """
        shown = self._shown(arrays, cost is not None)
        per_frame = sum(int(np.prod(shape)) * dtype.itemsize for shape, dtype in shown.values())
        at_most = max(1, _BYTES // max(per_frame, 1))
        first, piece, last = 0, _FIRST, None
        while first < self._frames:
            count = min(piece, at_most, self._frames - first)
            began = time.perf_counter()
            collected = self._ask(first, count, shown)
            last = self._check_steps(first, last, collected["step"])
            took = time.perf_counter() - began
            for name, array in arrays.items():
                array[first : first + count] = collected[name]
            if cost is not None:
                for index in range(count):
                    cost(FrameCopy({name: array[index] for name, array in collected.items()}, [*shown]))
            first += count
            piece = min(2 * count, 1 + int(count * _SECONDS / max(took, 1e-9)))
        return self._memory

    def _shown(self, arrays: Mapping[str, Any], has_cost: bool) -> dict[str, tuple[tuple[int, ...], np.dtype[Any]]]:
        """Shape and dtype of a frame of all that the daemon collects: fields first."""
        of_frame = {field["name"]: field for field in self._sim.info["fields"]}
        # steps show whether frames passed between two pieces
        chosen = [name for name in arrays if name not in EXTRA]
        names = [*of_frame] if has_cost else [*dict.fromkeys([*chosen, "step"])]
        shown = {
            name: (tuple(of_frame[name]["shape"]), np.dtype(f"{of_frame[name]['dtype'][0]}{_bytes(of_frame[name])}"))
            for name in names
        }
        return shown | {name: (shape[1:], dtype) for name, (shape, dtype) in self.shapes().items() if name in arrays}

    def _check_steps(self, first: int, last: Any, steps: NDArray[Any]) -> NDArray[np.int64]:
        """Refuse frames between this piece and the one before; return the steps at its end."""
        steps = steps.reshape(len(steps), -1).astype(np.int64)
        if last is not None and (passed := int((steps[0] - last).max()) - 1) > 0:
            raise CommandRefused(
                f"rollout: frame {first}: {passed} control frames passed before it, without the policy; launch with "
                'RealTime(late="pause"), or without real time'
            )
        return steps[-1]

    def _ask(
        self, first: int, count: int, shown: Mapping[str, tuple[tuple[int, ...], np.dtype[Any]]]
    ) -> dict[str, NDArray[Any]]:
        """Have the daemon carry out some frames; return what it collected, ``(count, worlds, …)``."""
        sim, worlds = self._sim, self._sim.worlds
        inputs = [_piece(array, first, count) for array in self._inputs]
        commands = self._sequences(first, count)
        arrays = [self.policy._network.parameters, self._memory, *inputs, *(values for _, _, values in commands)]
        question = {
            "frames": count,
            "first": first,
            **self._plain,
            "inputs": [_sequence(array) for array in inputs],
            "commands": [
                {"command": name, "first": start, "values": _sequence(values)} for name, start, values in commands
            ],
            "fields": [name for name in shown if name not in EXTRA],
            "collects": [name in shown for name in EXTRA],
            "lengths": [array.size for array in arrays],
        }
        text = json.dumps(question, separators=(",", ":"), allow_nan=False).encode()
        data = struct.pack("<Q", len(text)) + text + b"".join(np.asarray(array, "<f8").tobytes() for array in arrays)
        with transfer_file(sim.info["pid"], data) as path:
            sim._client.rollout(path)
            answer = np.fromfile(Path(path), np.uint8)
        collected, place = {}, 0
        for name, (shape, dtype) in shown.items():
            size = count * int(np.prod(shape)) * dtype.itemsize
            collected[name] = answer[place : place + size].view(dtype).reshape(count, *shape)
            place += -(-size // _ALIGNMENT) * _ALIGNMENT
        self._memory = answer[place:].view("<f8").reshape(worlds, -1).copy()
        return collected

    def _sequences(self, first: int, count: int) -> list[tuple[str, int, NDArray[np.float64]]]:
        """Commands of some frames: name, first column, and values, ``(count, worlds, columns)``."""
        made = []
        for name, value in self._commands.items():
            runs: dict[int, list[NDArray[np.float64]]] = {}
            for frame in range(first, first + count):
                try:
                    columns = self._columns_of(name, _at(value, frame))
                except CommandRefused as problem:
                    raise CommandRefused(f"rollout: frame {frame}: {problem}") from None
                for start, values in columns:
                    if not np.isfinite(values).all():
                        raise CommandRefused(f"rollout: frame {frame}: {name} is not finite; give finite numbers")
                    runs.setdefault(start, []).append(values)
            made += [(name, start, np.stack(values)) for start, values in runs.items()]
        return made

    def _columns_of(self, name: str, value: Any) -> list[tuple[int, NDArray[Any]]]:
        """As `columns_of`, but a joint that the policy drives leads no other one: its value is only added."""
        layout = self._sim._client.layout(name)
        driven = {column for drive in self._plain["drives"] if drive["command"] == name for column in drive["columns"]}
        if not driven or not isinstance(value, Mapping) or layout is None or layout[3] is None:
            return columns_of(self._sim, name, value)
        names, _, parts, robots = layout
        mimics = [
            (mimic["name"], mimic["leader"], mimic["multiplier"], mimic["offset"])
            for mimic in self._sim.info["followers"]
            if names.index(mimic["leader"]) not in driven
        ]
        return named_columns(name, value, self._sim.worlds, names, robots, followers=mimics, parts=parts)


def _at(value: Any, index: int) -> Any:
    """Return the command of one frame."""
    return {name: _at(own, index) for name, own in value.items()} if isinstance(value, Mapping) else value[index]


def _bytes(field: Mapping[str, Any]) -> int:
    return int(field["dtype"][1:]) // 8


def _bounds() -> tuple[float, float]:
    most = float(np.finfo(np.float32).max)
    return -most, most


def _piece(array: NDArray[np.float64], first: int, count: int) -> NDArray[np.float64]:
    return array if len(array) == 1 else array[first : first + count]


def _sequence(array: NDArray[np.float64]) -> dict[str, int]:
    return dict(zip(("frames", "worlds", "columns"), array.shape, strict=True))


def _inputs(given: Any, widths: Mapping[str, int], frames: int, worlds: int) -> list[NDArray[np.float64]]:
    """Return the inputs in the order of their names, each ``(frames or 1, worlds or 1, width)``."""
    if given is not None and not isinstance(given, Mapping):
        raise ArgumentError(
            f"rollout: inputs is {given!r:.80}; give a dict by name, such as {{'command': [0.5, 0, 0]}}"
        )
    given = dict(given or {})
    for name in given:
        if name not in widths:
            cure = suggestion(str(name), [*widths]) if widths else "the policy sees none; leave them out"
            raise ArgumentError(f"rollout: inputs has {name!r:.80}; {cure}")
    made = []
    for name, width in widths.items():
        if name not in given:
            raise ArgumentError(
                f"rollout: the policy sees the input {name!r}; give inputs={{{name!r}: …}}, {width} numbers"
            )
        array = reals(f"rollout: inputs of {name!r}", given[name]).astype(np.float64)
        shape = array.shape
        if array.ndim == 1:
            array = array[None, None]
        elif array.ndim == 2:
            array = array[:, None]
        fits = array.ndim == 3 and array.shape[2] == width
        if not fits or array.shape[0] not in (1, frames) or array.shape[1] not in (1, worlds):
            cure = f"give ({width},), ({frames}, {width}) by frame, or ({frames} or 1, {worlds}, {width})"
            raise ArgumentError(f"rollout: inputs of {name!r} has shape {shape}; {cure}")
        if not np.isfinite(array).all():
            raise ArgumentError(f"rollout: inputs of {name!r} has NaN or infinity; give finite numbers")
        made.append(array)
    return made


def _memory(given: Any, worlds: int) -> NDArray[np.float64]:
    if given is None:
        return np.empty(0)
    memory = reals("rollout: memory", given)
    if memory.ndim != 2 or len(memory) != worlds:
        raise ArgumentError(f"rollout: memory has shape {memory.shape}; give `memory` of a rollout of {worlds} worlds")
    bad = np.flatnonzero(~np.isfinite(memory).all(axis=1))
    if len(bad):
        raise ArgumentError(
            f"rollout: memory of world {bad[0]} has NaN or infinity; set its row to 0, and its policy begins anew"
        )
    return memory.astype(np.float64)


def count_of(frames: Any, lengths: Sequence[int]) -> int:
    """Return the number of frames of a rollout with a policy, from the argument or the commands."""
    if frames is None:
        if not lengths:
            raise ArgumentError("rollout: a policy needs a number of frames; give frames=500")
        return lengths[0]
    count = checks.integer("rollout: frames", frames, error=ArgumentError)
    if lengths and lengths[0] != count:
        raise ArgumentError(f"rollout: frames is {count}, and the commands have {lengths[0]}; give the same number")
    return count
