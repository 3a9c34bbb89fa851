"""Disturbances of bodies at random times, which a task lists."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop import _core
from tightloop.checks import arguments as checks
from tightloop.checks.signatures import checked_calls
from tightloop.env.names import Names
from tightloop.errors import ArgumentError

#: Stream of random numbers of the first disturbance; the next ones follow.
_STREAM = 16


@checked_calls
class Push:
    """A horizontal push at random times: an impulse of random direction and size, over one control step.

    A push is a force at the centre of mass of a body, and its world stays bit-identical for a seed and episode.
    """

    def __init__(self, body: str, impulse: float, interval: Sequence[float]) -> None:
        """Make a push.

        Args:
            body: Name of the body, ``robot/link``.
            impulse: Largest impulse [N·s]; sizes are uniform from 0. A body with a mass of m gains at most impulse / m.
            interval: Shortest and longest time between two pushes [s]. The first comes as late after a reset.
        """
        self.body = checks.text("Push: body", body, error=ArgumentError)
        self.impulse = checks.number("Push: impulse", impulse, above=0.0, error=ArgumentError)
        ends = list(interval) if isinstance(interval, Sequence) and not isinstance(interval, str) else []
        if len(ends) != 2:
            raise ArgumentError(f"Push: interval is {interval!r}; give the shortest and the longest time, (5.0, 10.0)")
        self.interval = tuple(checks.number("Push: interval", end, above=0.0, error=ArgumentError) for end in ends)
        if self.interval[0] > self.interval[1]:
            raise ArgumentError(f"Push: interval is {interval!r}; give the shorter time first")


class Disturbances:
    """Sends the pushes of a task as ``body_f``.

    Attributes:
        commands: Arguments of a step, by name: none without pushes.
    """

    def __init__(self, pushes: Sequence[Push], names: Names, worlds: int, control_dt: float) -> None:
        for push in pushes:
            if not isinstance(push, Push):
                raise ArgumentError(f"disturbances: got {push!r}; return a list of Push")
        self._pushes, self._dt = list(pushes), control_dt
        self._bodies = [names.body(push.body) for push in self._pushes]
        self._left = np.zeros((len(self._pushes), worlds), np.int32)  # steps until the next push
        self._count = np.zeros((len(self._pushes), worlds), np.uint32)
        self._draws = np.empty((len(self._pushes), worlds, 3), np.float32)
        self._active = np.zeros(worlds, np.bool_)
        self.commands: dict[str, NDArray[np.float32]] = {}
        if self._pushes:
            self.commands["body_f"] = np.zeros((worlds, names.body_count, 6), np.float32)

    def begin(self, rows: NDArray[np.intp], seeds: NDArray[np.uint64], episodes: NDArray[np.uint32]) -> None:
        """Draw the first push of worlds that begin an episode."""
        if not self._pushes:
            return
        self.commands["body_f"][rows] = 0.0
        self._active[rows] = False
        for at in range(len(self._pushes)):
            self._count[at, rows] = 0
            self._draw(at, rows, seeds, episodes)

    def apply(self, seeds: NDArray[np.uint64], episodes: NDArray[np.uint32]) -> None:
        """Write the forces of the next step."""
        if not self._pushes:
            return
        forces = self.commands["body_f"]
        if self._active.any():
            forces[self._active] = 0.0
            self._active[:] = False
        for at, (push, body) in enumerate(zip(self._pushes, self._bodies, strict=True)):
            self._left[at] -= 1
            due = self._left[at] < 0
            if not due.any():
                continue
            rows = np.flatnonzero(due)
            direction, size = 2.0 * np.pi * self._draws[at, rows, 1], self._draws[at, rows, 2]
            force = push.impulse / self._dt * size
            forces[rows, body, 0] += force * np.cos(direction)
            forces[rows, body, 1] += force * np.sin(direction)
            self._active |= due
            self._count[at, rows] += 1
            self._draw(at, rows, seeds, episodes)

    def _draw(self, at: int, rows: NDArray[np.intp], seeds: NDArray[np.uint64], episodes: NDArray[np.uint32]) -> None:
        """Draw time, direction and size of the next push of some worlds."""
        draws = np.empty((len(rows), 3), np.float32)
        _core.draw(seeds[rows], episodes[rows], _STREAM + at, 3, draws, self._count[at, rows] * np.uint32(3))
        self._draws[at, rows] = draws
        shortest, longest = self._pushes[at].interval
        steps = np.ceil((shortest + (longest - shortest) * draws[:, 0]) / self._dt).astype(np.int32)
        self._left[at, rows] = np.maximum(steps, 1)


def parameters(pushes: Sequence[Any]) -> tuple[str, ...]:
    """Return the parameters that `tightloop.launch` must let vary for these pushes."""
    return ("body_f",) if pushes else ()
