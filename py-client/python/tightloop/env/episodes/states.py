"""States that a user sets amid an episode."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tightloop.arrays.inputs import reals
from tightloop.checks.signatures import checked_calls
from tightloop.errors import ArgumentError, CommandRefused, TightloopError
from tightloop.sim.command_arrays import called

if TYPE_CHECKING:
    from tightloop.env.episodes.starts import Starts
    from tightloop.env.evaluation.evaluation import Evaluation
    from tightloop.env.evaluation.memory import Memory
    from tightloop.env.task import Task, Worlds
    from tightloop.sim.sim import Sim


@checked_calls
class SettableState:
    """Mixin of `VectorEnv`."""

    task: Task
    sim: Sim
    num_envs: int
    evaluation: Evaluation
    _memory: Memory
    _starts: Starts
    _ready: bool
    _failed: bool
    _in_flight: bool
    _interrupted: bool

    @property
    def level(self) -> NDArray[np.int32]:
        """Curriculum level of each world's episode, shape ``(num_envs,)``; a copy."""
        return self._starts.level.copy()

    def set_state(self, qpos: ArrayLike, qvel: ArrayLike, *, mask: NDArray[np.bool_] | None = None) -> None:
        """Set positions and velocities of worlds, as `Task.states_of` defines them: for MuJoCo models as MuJoCo does.

        The episodes go on from there; what a task remembers begins again, and so do histories and delays of
        observations.

        Args:
            qpos: Positions, shape ``(num_envs, positions)``, or ``(positions,)`` for all worlds.
            qvel: Velocities, likewise.
            mask: Worlds to set, bool, shape ``(num_envs,)``; all if left out.

        Raises:
            ArgumentError: The task defines no `Task.states_of`, or an argument is not valid.
            CommandRefused: There was no reset, or a step is in flight.
        """
        self._check_ready("set_state")
        every = np.ones(self.num_envs, np.bool_) if mask is None else np.asarray(mask)
        if every.shape != (self.num_envs,) or every.dtype != np.bool_ or not every.any():
            raise ArgumentError(f"set_state: mask is {mask!r:.80}; give bools of shape ({self.num_envs},), one True")
        given = [_rows(name, array, self.num_envs) for name, array in (("qpos", qpos), ("qvel", qvel))]
        arrays = {name: np.ascontiguousarray(array) for name, array in self.task.states_of(*given).items()}
        # not `write`, which warns of quaternions in MuJoCo's order: any may be meant here
        frame = called(self.sim, self.sim._client.write, arrays, np.ascontiguousarray(every), True)
        self._see(frame)
        self.evaluation.restart(np.flatnonzero(every))
        self._memory.begin(np.flatnonzero(every), self.evaluation)
        self._see(frame)

    def _see(self, frame: Any) -> Worlds:
        raise NotImplementedError

    def _check_ready(self, call: str) -> None:
        self._check_idle(call)
        if not self._ready:
            why = "the last step or reset failed" if self._failed else "no episode has begun"
            raise CommandRefused(f"{call}: {why}; call reset first")

    def _drop_interrupted(self) -> None:
        """Receive the step that Ctrl-C left in flight, if there is one: a reset makes its results worthless."""
        if self._interrupted:
            # the step may not have been sent; a lost daemon is an error of the reset that follows
            with suppress(TightloopError):
                self.sim.recv()
            self._in_flight = self._interrupted = self._ready = False
            self._failed = True

    def _check_idle(self, call: str) -> None:
        if self._in_flight:
            cure = "recv or reset" if self._interrupted else "recv"
            raise CommandRefused(f"{call}: a step is on its way; call {cure} first")


def _rows(name: str, values: ArrayLike, worlds: int) -> NDArray[np.float64]:
    given = np.asarray(reals(f"set_state: {name}", values), np.float64)
    if given.ndim == 1:
        return np.tile(given, (worlds, 1))
    if given.ndim != 2 or len(given) != worlds:
        raise ArgumentError(
            f"set_state: {name} has shape {given.shape}; give a row for each of {worlds} worlds, or one"
        )
    return given
