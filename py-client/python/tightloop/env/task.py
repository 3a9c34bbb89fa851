"""Tasks: a scene, controls, and pure functions of arrays."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, ClassVar, cast

import numpy as np
from numpy.typing import NDArray

from tightloop import _core
from tightloop.checks.attributes import nearest
from tightloop.env.controls import Control
from tightloop.env.episodes.disturbances import Push
from tightloop.env.mirror import Mirror
from tightloop.env.names import Names
from tightloop.env.observed import Observed
from tightloop.env.task_members import tell_of_class
from tightloop.errors import ArgumentError, UnknownAttribute
from tightloop.scene.scene import Scene

#: An array of NumPy, torch or JAX.
Array = Any
#: A namespace of array functions: ``numpy``, ``array_api_compat.torch``, ``jax.numpy``.
Namespace = Any


class Worlds:
    """All worlds at one instant, as the functions of a task see them; arrays have the worlds first.

    Further attributes are the frame fields that `Task.fields` names, such as ``joint_q``.

    Attributes:
        action: Action of the last step, shape ``(worlds, actions)``; 0 after a reset.
        previous_action: Action of the step before.
        goal: Result of `Task.goal`, shape ``(worlds, …)``.
        elapsed: Control steps since the reset, shape ``(worlds,)``, int32.
        memory: Arrays that `Task.remember` returned, by name.
        level: Curriculum level of each world, shape ``(worlds,)``, int32; see `Task.next_level`.
    """

    action: Array
    previous_action: Array
    goal: Array
    elapsed: Array
    memory: Mapping[str, Array]
    level: Array

    def __init__(self, **arrays: Array) -> None:
        self.__dict__.update(arrays)

    def __getattr__(self, name: str) -> Array:
        if name.startswith("_"):
            raise AttributeError(name)
        known = ", ".join(self.__dict__)
        near = nearest(name, [*self.__dict__, *_core.field_names()])
        if name in _core.field_names():
            cure = "name it in the task's `fields`"
        elif near:
            cure = f"did you mean `{near[0]}`?" + (
                "" if near[0] in self.__dict__ else " Name it in the task's `fields`"
            )
        else:
            cure = "`bind` can keep what is constant in the task"
        raise UnknownAttribute(f"worlds have no {name!r}; {cure}; there are: {known}")

    def rows(self, rows: NDArray[np.intp]) -> Worlds:
        """Return copies of some of the worlds, by index; each array is copied when it is read first."""
        return _Rows(self, rows)


class _Rows(Worlds):
    """Some of the worlds."""

    def __init__(self, worlds: Worlds, rows: NDArray[np.intp]) -> None:
        self.__dict__.update(_worlds=worlds, _rows=rows)

    def __getattr__(self, name: str) -> Any:
        worlds, rows = self.__dict__["_worlds"], self.__dict__["_rows"]

        def of_rows(array: Any) -> Any:
            if isinstance(array, Mapping):
                return {name: of_rows(part) for name, part in array.items()}
            return np.asarray(array)[rows]

        copied = self.__dict__[name] = of_rows(getattr(worlds, name))
        return copied


class _Undefined(ArgumentError, NotImplementedError):
    pass


class Task:
    """The base class of tasks: a subclass defines scene, controls, observation and reward.

    ``examples/own_task.py`` is an example. `observe`, `reward`, `terminated`, `truncated`, `success`, `metrics` and
    `goal` are pure functions of arrays, for all worlds at once. They use arithmetic and those functions of the
    namespace ``xp`` that NumPy and the array API share, so that they also run on arrays of torch and JAX. They have no
    access to a simulation and draw no random numbers.

    Attributes:
        fields: Frame fields that the functions read.
        max_episode_steps: Control steps after which an episode is truncated.
        goal_draws: Number of random numbers that `goal` takes per world.
        goal_steps: Control steps after which the next goal replaces a goal; None for one goal per episode.
        launch_options: Further arguments of `tightloop.launch`, such as ``bounds``.
        warns_of_starts: Whether a warning tells of states of `initial_state` that are most likely a mistake.
        dtype: Type of observations and rewards, ``numpy.float32`` or ``numpy.float64``.
        reward_weights: Weight of each term that `reward_terms` returns.
        initial_draws: Number of random numbers that `initial_state` takes per world.
        levels: Number of curriculum levels; None for any number.
        first_levels: Worlds begin at curriculum levels drawn uniformly from 0 to ``first_levels - 1``.
        goal_radius: Radius of the ball that marks a goal in pictures [m], if the first three values of a goal are a
            position; None for no ball.
    """

    def __init_subclass__(cls, **options: Any) -> None:
        """Warn of misspelt members and of those that other libraries have, which nothing would call here."""
        super().__init_subclass__(**options)
        tell_of_class(cls, Task)

    fields: Sequence[str] = ("joint_q", "joint_qd")
    max_episode_steps: int = 500
    goal_draws: ClassVar[int] = 0
    goal_steps: ClassVar[int | None] = None
    launch_options: ClassVar[dict[str, Any]] = {}
    warns_of_starts: ClassVar[bool] = True
    dtype: ClassVar[type[np.floating[Any]]] = np.float32
    goal_radius: ClassVar[float | None] = None
    reward_weights: Mapping[str, float] = {}
    initial_draws: int = 0
    levels: int | None = None
    first_levels: int = 1

    def scene(self) -> Scene:
        """Return the scene with its randomization. ``dt * substeps`` is the length of a control step."""
        raise _undefined(self, "scene")

    def controls(self) -> Sequence[Control]:
        """Return the controls, in the order of the action's values."""
        raise _undefined(self, "controls")

    def observed(self) -> Sequence[Observed]:
        """Return the parts of the observation, in the order of `observe`."""
        raise _undefined(self, "observed")

    def bind(self, names: Names) -> None:
        """Look up indices in the arrays; called once, before the other functions."""

    def observe(self, xp: Namespace, worlds: Worlds) -> Sequence[Array]:
        """Return the parts of the observation, of shape ``(worlds,)`` or ``(worlds, size)``, like `observed`."""
        raise _undefined(self, "observe")

    def reward(self, xp: Namespace, worlds: Worlds) -> Array:
        """Return the reward of the last step, shape ``(worlds,)``.

        A task defines either this or `reward_terms`, of which this is the weighted sum.
        """
        if type(self).reward_terms is Task.reward_terms:
            raise _undefined(self, "reward")
        terms = self.reward_terms(xp, worlds)
        return sum(self.reward_weights[name] * value for name, value in terms.items())

    def reward_terms(self, xp: Namespace, worlds: Worlds) -> Mapping[str, Array]:
        """Return the terms of the reward by name, each of shape ``(worlds,)``, without their weights.

        The reward is their sum with the weights of ``reward_weights``. In the step that ends an episode,
        ``infos["return/NAME"]`` has the weighted sum of each term over the episode.
        """
        raise _undefined(self, "reward_terms")

    def terminated(self, xp: Namespace, worlds: Worlds) -> Array | None:
        """Return which worlds are terminated, bool, shape ``(worlds,)``; None if the task never terminates."""
        return None

    def truncated(self, xp: Namespace, worlds: Worlds) -> Array | None:
        """Return which worlds end their episode without a terminal state, such as at the edge of a terrain.

        Returns:
            bool, shape ``(worlds,)``; None if ``max_episode_steps`` alone truncates episodes.
        """
        return None

    def success(self, xp: Namespace, worlds: Worlds) -> Array | None:
        """Return which worlds fulfil the task, bool, shape ``(worlds,)``; None if the task defines no success."""
        return None

    def metrics(self, xp: Namespace, worlds: Worlds) -> Mapping[str, Array]:
        """Return further values of a step for ``infos``, by name, each of shape ``(worlds,)`` or ``(worlds, …)``."""
        return {}

    def start_metrics(self, xp: Namespace, worlds: Worlds) -> Mapping[str, Array]:
        """Return values for ``infos`` of worlds that begin an episode, like `metrics`."""
        return {}

    def states_of(self, qpos: NDArray[np.float64], qvel: NDArray[np.float64]) -> Mapping[str, Array]:
        """Return states for `VectorEnv.set_state`, from positions and velocities as the task defines them.

        Args:
            qpos: Shape ``(n, positions)``.
            qvel: Shape ``(n, velocities)``.

        Returns:
            Arrays by name of an argument of `Sim.write`, such as ``joint_q``, shape ``(n, coords)``.
        """
        raise _undefined(self, "states_of")

    def remember(self, xp: Namespace, worlds: Worlds, memory: Mapping[str, Array] | None) -> Mapping[str, Array]:
        """Return what the task remembers of a step, by name, each of shape ``(worlds, …)``.

        All functions of the task see the result as ``worlds.memory``. It is called once per step, before them, so it
        may also hold what several of them need. State in ``self`` would not do: the other functions are called several
        times per step, and worlds start their episodes at different times.

        Args:
            xp: The namespace.
            worlds: The worlds after the step; those that begin an episode, without memory.
            memory: What this function returned at the step before; None for worlds that begin an episode.
        """
        return {}

    def initial_state(self, xp: Namespace, worlds: Worlds, draws: Array) -> Mapping[str, Array]:
        """Return states in which worlds start an episode, after the draws of the scene; empty to keep those.

        Args:
            xp: The namespace.
            worlds: Only the worlds that start, as the scene starts them; without memory and goal.
            draws: Uniform random numbers in [0, 1), shape ``(worlds, initial_draws)``.

        Returns:
            Arrays by name of an argument of `Sim.write`, such as ``joint_q``, shape ``(worlds, coords)``.
        """
        return {}

    def next_level(self, xp: Namespace, worlds: Worlds) -> Array | None:
        """Return curriculum levels for worlds whose episode ends, int, shape ``(worlds,)``; None to keep them.

        Args:
            xp: The namespace.
            worlds: Only these worlds, at the end of their episode; ``worlds.level`` is the level of that episode.
        """
        return None

    def disturbances(self) -> Sequence[Push]:
        """Return pushes of bodies at random times."""
        return ()

    def privileged_observed(self) -> Sequence[Observed]:
        """Return the parts of the privileged observation, which only a critic sees in training; none by default."""
        return ()

    def privileged_observe(self, xp: Namespace, worlds: Worlds) -> Sequence[Array]:
        """Return those parts, like `observe`; ``infos["privileged"]`` has them, shape ``(worlds, size)``."""
        raise _undefined(self, "privileged_observe")

    def mirrored(self) -> Mirror | None:
        """Return the mirror symmetry of the task, which learners may use; None if it has none."""
        return None

    def policy_metadata(self) -> Mapping[str, Any]:
        """Return further entries of `tightloop.env.policy_metadata`, such as ``command_names``; none by default.

        Values are texts, numbers, or lists of these.
        """
        return {}

    def goal(self, xp: Namespace, worlds: Worlds, draws: Array) -> Array:
        """Return goals for worlds that start an episode, or their next goals.

        Args:
            xp: The namespace.
            worlds: Only these worlds.
            draws: Uniform random numbers in [0, 1), shape ``(worlds, goal_draws)``.

        Returns:
            Shape ``(worlds, …)``.
        """
        return draws[:, :0]

    def describe(self) -> str:
        """Return a table of the observation: index, name, range, unit."""
        lines, place = [], 0
        for part in observed_parts(self):
            places = f"{place}" if part.width == 1 else f"{place}–{place + part.width - 1}"
            low, high = part.bounds[0].min(), part.bounds[1].max()
            lines.append(f"{places:<8}{part.name:<32}[{low:.4g}, {high:.4g}]  {part.unit}")
            place += part.width
        return "\n".join(lines)


def observed_parts(task: Task) -> list[Observed]:
    """Return the parts of a task's observation.

    Raises:
        ArgumentError: They are no list of `Observed`.
    """
    own, parts = f"{type(task).__name__}.observed", cast("Any", task.observed())
    if isinstance(parts, Observed | str | Mapping) or not isinstance(parts, Iterable):
        raise ArgumentError(f"{own}: got {type(parts).__name__}; return a list of Observed")
    parts = [*parts]
    for place, part in enumerate(parts):
        if not isinstance(part, Observed):
            given = part if isinstance(part, tuple | list) else (part, "low", "high")
            cure = f"such as Observed({', '.join(map(repr, given))})" if given else "such as Observed('height', 0, 2)"
            raise ArgumentError(f"{own}: part {place} is {part!r:.80}; give a tightloop.env.Observed, {cure:.80}")
    return parts


def episode_steps(task: Task, given: float | None) -> int | None:
    """Return the control steps after which episodes are truncated; None for never.

    Raises:
        ArgumentError: The number is neither a whole number of at least 1 nor infinite.
    """
    steps = task.max_episode_steps if given is None else given
    if steps == math.inf:
        return None
    whole = isinstance(steps, int | float | np.number) and not isinstance(steps, bool) and math.isfinite(steps)
    if not whole or steps != int(steps) or steps < 1:
        raise ArgumentError(f"max_episode_steps is {steps!r}; give a whole number of at least 1, or math.inf")
    return int(steps)


def _undefined(task: Task, name: str) -> Exception:
    kind = type(task).__name__
    return _Undefined(
        f"task {kind} has no `{name}`; derive a class from Task and define it, as examples/own_task.py does"
    )
