"""Inverse kinematics that a daemon solves: the question and its answer pass through a file in shared memory."""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop import _core
from tightloop.sim.snapshot import transfer_file

Array = NDArray[np.float64]


class IkOfDaemon:
    """A running simulation in the place of `_core.Ik`.

    Args:
        client: The simulation's client.
        info: The daemon's description of itself.

    Attributes:
        worlds: Number of worlds.
        names: Names of dofs, coordinates and frames. Frames are none, because only the daemon knows all of them.
        start: None: problems start at the present positions of the worlds.
    """

    def __init__(self, client: _core.Client, info: dict[str, Any]) -> None:
        self.client, self.worlds, self.pid = client, info["worlds"], info["pid"]
        self.names: tuple[list[str], list[str], list[str]] = (info["dof_names"], info["coord_names"], [])
        self.start = None

    def solver(self, task: str) -> IkTaskOfDaemon:
        """Return what solves a task, given as JSON. The daemon checks it with the first problems."""
        return IkTaskOfDaemon(self, task)


class IkTaskOfDaemon:
    """A task of a running simulation in the place of `_core.IkTaskSolver`."""

    def __init__(self, daemon: IkOfDaemon, task: str) -> None:
        self._daemon, self._task = daemon, task
        self._columns = len(daemon.names[1])

    def solve(
        self,
        count: int,
        arrays: Sequence[Array],
        attempts: tuple[int, int, int],
        tolerance: tuple[float, float],
        run: tuple[bool, int],
    ) -> tuple[Array, NDArray[np.bool_], Array, Array, NDArray[np.uint32], NDArray[np.uint32]]:
        """Have the daemon solve problems; arguments as for `_core.IkTaskSolver.solve`.

        Raises:
            CommandRefused: The daemon refuses the task. Other errors are those of `Sim.step`.
        """
        question = {
            "count": count,
            "lengths": [len(array) for array in arrays],
            "iterations": attempts[0],
            "restarts": attempts[1],
            "seed": attempts[2],
            "tolerance": tolerance,
            "double": run[0],
            "threads": run[1],
        }
        # the task comes first: the daemon keeps its solver as long as the text stays the same
        text = f'{{"task":{self._task},{json.dumps(question, separators=(",", ":"))[1:]}'.encode()
        data = struct.pack("<Q", len(text)) + text + b"".join(array.astype("<f8").tobytes() for array in arrays)
        with transfer_file(self._daemon.pid, data) as path:
            self._daemon.client.ik(path)
            answer = np.fromfile(Path(path), "<f8").reshape(count, self._columns + 5)
        q, found = answer[:, : self._columns], answer[:, self._columns :].T
        counts = found[3:].astype(np.uint32)
        return q.reshape(-1), found[0] != 0.0, found[1].copy(), found[2].copy(), counts[0], counts[1]
