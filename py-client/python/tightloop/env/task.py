"""What an environment is about: a scene, controls, and pure functions of arrays."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tightloop.env.controls import Control
from tightloop.env.names import Names
from tightloop.errors import ArgumentError
from tightloop.scene import Scene

#: An array of NumPy, torch or JAX.
Array = Any
#: A namespace of array functions: ``numpy``, ``array_api_compat.torch``, ``jax.numpy``.
Namespace = Any


class Worlds:
    """All worlds at one instant, as the functions of a task see them; arrays have the worlds first.

    Attributes:
        action: What was asked for in the step that led here, shape ``(worlds, actions)``; 0 after a reset.
        previous_action: What was asked for in the step before.
        goal: What `Task.goal` gave, shape ``(worlds, …)``.
        elapsed: Control steps since the reset, shape ``(worlds,)``, int32.

    The others are the fields of a frame that `Task.fields` names, such as ``joint_q``.
    """

    action: Array
    previous_action: Array
    goal: Array
    elapsed: Array

    def __init__(self, **arrays: Array) -> None:
        self.__dict__.update(arrays)

    def __getattr__(self, name: str) -> Array:
        known = ", ".join(self.__dict__)
        raise AttributeError(f"worlds have no {name!r}; name it in the task's `fields`; there are: {known}")

    def rows(self, rows: NDArray[np.intp]) -> Worlds:
        """Some of the worlds only, as copies."""
        return Worlds(**{name: np.asarray(array)[rows] for name, array in self.__dict__.items()})


@dataclass(frozen=True)
class Observed:
    """A part of the observation: what it is, how many numbers, and between which bounds they are.

    Attributes:
        name: What it is.
        low: Least value, for all or each of its numbers; what is below counts as this.
        high: Largest value, likewise.
        size: How many numbers it has.
        unit: Their unit.
    """

    name: str
    low: ArrayLike
    high: ArrayLike
    size: int = 1
    unit: str = "–"
    bounds: NDArray[np.float32] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        try:
            low, high = (np.broadcast_to(np.asarray(end, np.float32), (self.size,)) for end in (self.low, self.high))
        except ValueError:
            raise ArgumentError(
                f"observation `{self.name}`: low and high must be numbers, or {self.size} each"
            ) from None
        if not (low < high).all():
            raise ArgumentError(f"observation `{self.name}`: low {self.low} must be below high {self.high}")
        object.__setattr__(self, "bounds", np.stack([low, high]))


class Task:
    """What an environment is about; a subclass says it, see ``examples/own_task.py``.

    `observe`, `reward`, `terminated`, `success`, `metrics` and `goal` are pure: arrays in, arrays out, for all worlds
    at once. They use arithmetic and the functions of the namespace ``xp`` that NumPy and the array API share, so that
    they run on arrays of torch and JAX too. They see no simulation and draw no random numbers.

    Attributes:
        fields: Fields of the frame that the functions read.
        max_episode_steps: Control steps after which an episode is truncated.
        goal_draws: How many random numbers `goal` takes a world.
        goal_steps: Control steps after which a goal gives way to the next one; None for one an episode.
        launch_options: Further arguments of `tightloop.launch`, such as ``bounds``.
        goal_radius: Where the first three numbers of a goal are a place, the radius of the ball that marks it in
            pictures [m]; None for no ball.
    """

    fields: ClassVar[Sequence[str]] = ("joint_q", "joint_qd")
    max_episode_steps: int = 500
    goal_draws: ClassVar[int] = 0
    goal_steps: ClassVar[int | None] = None
    launch_options: ClassVar[dict[str, Any]] = {}
    goal_radius: ClassVar[float | None] = None

    def scene(self) -> Scene:
        """The scene, with what `Scene.randomize` draws at each reset. ``dt * substeps`` is a control step."""
        raise NotImplementedError(f"{type(self).__name__} has no `scene`")

    def controls(self) -> Sequence[Control]:
        """What the action's numbers do, in their order."""
        raise NotImplementedError(f"{type(self).__name__} has no `controls`")

    def observed(self) -> Sequence[Observed]:
        """The parts of the observation, as `observe` returns them."""
        raise NotImplementedError(f"{type(self).__name__} has no `observed`")

    def bind(self, names: Names) -> None:
        """Called once, before the functions: look up where things are in the arrays."""

    def observe(self, xp: Namespace, worlds: Worlds) -> Sequence[Array]:
        """The observation in parts, each of shape ``(worlds,)`` or ``(worlds, size)``, as `observed` lists them."""
        raise NotImplementedError(f"{type(self).__name__} has no `observe`")

    def reward(self, xp: Namespace, worlds: Worlds) -> Array:
        """Reward of the step that led here, shape ``(worlds,)``."""
        raise NotImplementedError(f"{type(self).__name__} has no `reward`")

    def terminated(self, xp: Namespace, worlds: Worlds) -> Array | None:
        """Which worlds have come to an end, bool, shape ``(worlds,)``; None if none ever does."""
        return None

    def success(self, xp: Namespace, worlds: Worlds) -> Array | None:
        """Which worlds do what is asked for, bool, shape ``(worlds,)``; None if the task knows no success."""
        return None

    def metrics(self, xp: Namespace, worlds: Worlds) -> Mapping[str, Array]:
        """What else is worth knowing of a step, by name, each of shape ``(worlds,)``; it goes into ``infos``."""
        return {}

    def goal(self, xp: Namespace, worlds: Worlds, draws: Array) -> Array:
        """Goals of worlds that begin an episode, or the next goal of one.

        Args:
            xp: The namespace.
            worlds: These worlds.
            draws: Uniform random numbers in [0, 1), shape ``(worlds, goal_draws)``.

        Returns:
            Shape ``(worlds, …)``.
        """
        return draws[:, :0]

    def describe(self) -> str:
        """The observation as a table: place, what it is, range, unit."""
        lines, place = [], 0
        for part in self.observed():
            places = f"{place}" if part.size == 1 else f"{place}–{place + part.size - 1}"
            low, high = part.bounds[0].min(), part.bounds[1].max()
            lines.append(f"{places:<8}{part.name:<32}[{low:.4g}, {high:.4g}]  {part.unit}")
            place += part.size
        return "\n".join(lines)


def episode_steps(task: Task, given: float | None) -> int | None:
    """Control steps after which episodes are truncated; None for never.

    Raises:
        ArgumentError: It is no whole number of at least 1, and not infinite.
    """
    steps = task.max_episode_steps if given is None else given
    if steps == math.inf:
        return None
    whole = isinstance(steps, int | float | np.number) and not isinstance(steps, bool) and math.isfinite(steps)
    if not whole or steps != int(steps) or steps < 1:
        raise ArgumentError(f"max_episode_steps is {steps!r}; give a whole number of at least 1, or math.inf")
    return int(steps)
