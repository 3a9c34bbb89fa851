"""What a planner gets: a scene, what it may command, what it costs, and how a run of it is judged."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

import tightloop as tl

Array = NDArray[np.float64]


class Problem:
    """A task of a planner. Subclasses set the attributes and write the functions.

    Controls are the commanded columns alone, ``(controls,)``.

    Attributes:
        command: Command of `Sim.step` that is planned.
        columns: Its columns that are controls.
        rest: The whole command without a plan, ``(dofs,)``.
        low: Lower limits of the controls.
        high: Upper limits of the controls.
        effort: Weights of the residual of each control about its rest.
        seconds: Time of a frame [s].
        duration: Time of a run [s].
        horizon: Frames of a plan.
        knot: Frames between two knots of sampled noise.
        noise: Standard deviation of the noise at the knots, in the unit of the command.
        samples: Worlds of a planner that samples.
        params: Parameters that vary between worlds.
        fields: Fields that the cost and the judgement need.
    """

    command: ClassVar[str]
    columns: ClassVar[tuple[int, ...]]
    rest: ClassVar[Array]
    low: ClassVar[Array]
    high: ClassVar[Array]
    effort: ClassVar[float]
    seconds: ClassVar[float]
    duration: ClassVar[float]
    horizon: ClassVar[int]
    knot: ClassVar[int]
    noise: ClassVar[float]
    samples: ClassVar[int]
    params: ClassVar[tuple[str, ...]] = ()
    fields: ClassVar[tuple[str, ...]] = ("joint_q", "joint_qd")

    def scene(self) -> tl.Scene:
        """Return the scene of the plant and of the planner."""
        raise NotImplementedError

    def cost(self, frame: tl.Frame) -> Array:
        """Return what the state of each world costs, ``(worlds,)``."""
        raise NotImplementedError

    def begin(self, plant: tl.Sim, seed: int) -> None:
        """Put the plant at the start of a run."""
        raise NotImplementedError

    def between(self, plant: tl.Sim, frame: int) -> None:
        """Change the surroundings before a frame, such as by a new obstacle."""

    def observe(self, frame: tl.Frame) -> None:
        """Take note of a frame of the plant."""
        raise NotImplementedError

    def judge(self) -> tuple[bool, str]:
        """Return whether the run succeeded, and what to print of it."""
        raise NotImplementedError

    def full(self, controls: Array) -> Array:
        """Return the whole command, ``(…, dofs)``, of controls, ``(…, controls)``."""
        command = np.broadcast_to(self.rest, (*controls.shape[:-1], len(self.rest))).copy()
        command[..., self.columns] = controls
        return command

    def effort_cost(self, controls: Array) -> Array:
        """Return what controls cost, ``(…,)``."""
        return np.square(self.effort * (controls - self.rest[list(self.columns)])).sum(axis=-1)
