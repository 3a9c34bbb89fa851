"""Simulations that keep to real time: `RealTime` for `launch`, and `Timing`, which tells how well they kept to it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from tightloop.checks import arguments as checks
from tightloop.checks.signatures import checked_calls
from tightloop.errors import ArgumentError

#: What worlds may do when a command is late.
LATE = ("pause", "hold", "stop")
#: The highest priority of SCHED_FIFO on Linux (sched(7)).
PRIORITY_MAX = 99


@checked_calls
@dataclass(frozen=True, slots=True)
class RealTime:
    """How a simulation keeps to real time: each frame leaves when it is due on the monotonic clock.

    The worlds compute a frame as soon as its command comes. The frame then waits until it is due. While no command is
    late, positions are the same bits as without real time.

    Attributes:
        factor: Simulated seconds per second; 1 is real time.
        late: What the worlds do when no command came until their frame is due. ``"pause"``: they stand still until it
            comes. ``"hold"``: they continue with the last commands. ``"stop"``: they continue with ``joint_f``,
            ``joint_target_qd``, ``ctrl`` and ``body_f`` of zero; position targets stay. A controller that died is late,
            too. The next one goes on from there.
        command_timeout: With ``late="hold"``, time without a command after which the worlds stop [s]; never if left
            out.
        cores: Processors that the daemon may run on, such as ``(1,)``; all if left out.
        priority: Real-time priority of the daemon (SCHED_FIFO), 1 to 99. Where the system does not allow it,
            ``Sim.info["notes"]`` has the reason.
        lock_memory: Keep the daemon's memory from being swapped out, where the system allows it.
    """

    factor: float = 1.0
    late: str = "pause"
    command_timeout: float | None = None
    cores: Sequence[int] = ()
    priority: int | None = None
    lock_memory: bool = False

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            ArgumentError: A value is wrong, as its message says.
        """
        said = partial(checks.number, error=ArgumentError)
        said("RealTime: factor", self.factor, above=0.0)
        if self.late not in LATE:
            raise ArgumentError(f"RealTime: late is {self.late!r}; choose one of {', '.join(map(repr, LATE))}")
        if self.command_timeout is not None:
            said("RealTime: command_timeout", self.command_timeout, above=0.0)
            if self.late != "hold":
                raise ArgumentError(f'RealTime: command_timeout needs late="hold", but late is "{self.late}"')
        if isinstance(self.cores, str) or not isinstance(self.cores, Sequence):
            raise ArgumentError(f"RealTime: cores is {self.cores!r}; give a list of numbers, such as (1,)")
        for core in self.cores:
            checks.integer("RealTime: an entry of cores", core, least=0, error=ArgumentError)
        priority = 1 if self.priority is None else self.priority
        if checks.integer("RealTime: priority", priority, error=ArgumentError) > PRIORITY_MAX:
            raise ArgumentError(f"RealTime: priority is {priority}; give at most {PRIORITY_MAX}")
        checks.flag("RealTime: lock_memory", self.lock_memory, error=ArgumentError)


def arguments(realtime: float | RealTime | None) -> dict[str, Any]:
    """Return the arguments of the daemon for an argument of `launch`."""
    if realtime is None:
        return {}
    if not isinstance(realtime, RealTime):
        realtime = RealTime(checks.number("launch: realtime", realtime, above=0.0, error=ArgumentError))
    made: dict[str, Any] = {"realtime": realtime.factor, "late": realtime.late}
    if realtime.command_timeout is not None:
        made["command-timeout"] = realtime.command_timeout
    if realtime.cores:
        made["cores"] = ",".join(map(str, realtime.cores))
    if realtime.priority is not None:
        made["priority"] = realtime.priority
    if realtime.lock_memory:
        made["lock-memory"] = True
    return made


@dataclass(frozen=True, slots=True)
class Percentiles:
    """Percentiles of a duration, rounded up by at most 1 % [µs]; all 0 if nothing was measured.

    Attributes:
        mean: Mean.
        p50: Median.
        p99: Of 100 values, 99 are at most this.
        p999: Of 1000 values, 999 are at most this.
        worst: The largest.
    """

    mean: float
    p50: float
    p99: float
    p999: float
    worst: float


@dataclass(frozen=True, slots=True)
class Timing:
    """How the frames of a simulation came, measured by its daemon.

    Attributes:
        frames: Frames that steps made.
        missed: Missed deadlines: frames that left more than a tenth of the period after they were due, or whose command
            was late. Always 0 without real time, as the three below.
        late: Frames whose command had not come when they were due.
        skipped: Periods without a frame, because the one before took too long.
        lateness: Jitter: from the time at which a frame was due until it left.
        period: Time between two frames that follow each other.
        latency: From a command, or from the time at which its frame was due if that is later, until its frame left.
        busy: Time that the daemon computed for a frame.
    """

    frames: int
    missed: int
    late: int
    skipped: int
    period: Percentiles
    lateness: Percentiles
    latency: Percentiles
    busy: Percentiles

    def __str__(self) -> str:
        """Return a table."""
        lines = [f"{self.frames} frames, {self.missed} missed, {self.late} late, {self.skipped} skipped"]
        lines.append(f"{'[µs]':9}{'mean':>10}{'p50':>10}{'p99':>10}{'p99.9':>10}{'worst':>10}")
        for name in ("period", "lateness", "latency", "busy"):
            each: Percentiles = getattr(self, name)
            values = (each.mean, each.p50, each.p99, each.p999, each.worst)
            lines.append(f"{name:9}" + "".join(f"{value:10.1f}" for value in values))
        return "\n".join(lines)


def read_timing(text: str) -> Timing:
    """Return what a daemon said."""
    said: dict[str, Any] = json.loads(text)
    said |= {name: Percentiles(**said[name]) for name in ("period", "lateness", "latency", "busy")}
    return Timing(**said)
