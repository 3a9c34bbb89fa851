"""Vectorized environments: a task in the worlds of a daemon, as a `gymnasium.vector.VectorEnv`."""

from __future__ import annotations

import contextlib
import copy as copying
from collections.abc import Iterator, Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector import VectorEnv as GymVectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from tightloop.arrays.frames import FAULTED
from tightloop.checks import advice
from tightloop.checks import arguments as checks
from tightloop.checks.attributes import suggestion
from tightloop.checks.signatures import checked_calls
from tightloop.env.actions import Actions
from tightloop.env.episodes.disturbances import Disturbances
from tightloop.env.episodes.episodes import Episodes, check_seeds
from tightloop.env.episodes.reset_arguments import autoreset_mode_of, reset_mask
from tightloop.env.episodes.starts import Starts
from tightloop.env.episodes.states import SettableState
from tightloop.env.evaluation.evaluation import Evaluation
from tightloop.env.evaluation.memory import Memory
from tightloop.env.evaluation.results import TASK_FAULT, OnNan, check_on_nan, refuse
from tightloop.env.evaluation.step_buffers import BufferRing, Observations, StepBuffers, with_nan, zero, zero_nan
from tightloop.env.mirror import MirrorColumns
from tightloop.env.names import Names
from tightloop.env.registry import controls_of, make_task
from tightloop.env.rendering import FIELDS, MODES, Rendering, marks
from tightloop.env.rendering import check as check_mode
from tightloop.env.simulation import open_simulation
from tightloop.env.task import Task, Worlds, episode_steps
from tightloop.env.task_checks import check_task
from tightloop.errors import ArgumentError, CommandRefused, DaemonLost, UnknownAttribute
from tightloop.sim.sim import Sim
from tightloop.sim.viewer_process import Viewer

Step = tuple[Observations, NDArray[Any], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]


@checked_calls
class VectorEnv(SettableState, GymVectorEnv[Observations, NDArray[np.float32], NDArray[Any]]):
    """A task in many worlds.

    Observations are float32, shape ``(num_envs, size)``, clipped to ``single_observation_space``. Actions have shape
    ``(num_envs, actions)`` and are clipped to ``single_action_space``. Rewards are float32.
    Tasks may have float64 for observations and rewards. With ``dict_observations``, observations are a dict: images by
    name, shape ``(num_envs, *shape)``, and ``"state"`` with all other parts, shape ``(num_envs, size)``.

    ``infos["privileged"]`` has the privileged observations of a task that has them, from `reset` too. In the step that
    ends an episode, ``infos["return/TERM"]`` has the sum of a term of its rewards.

    ``infos["success"]`` says which worlds fulfil the task now, if the task defines success. The values of
    `Task.metrics` are in ``infos`` too. ``infos["_success"]`` and its like say which rows are valid; rows of worlds
    that have just begun an episode are not. A faulted world (not finite, or beyond the task's bounds) is terminated,
    and ``infos["fault"]`` has the bits of its ``status``. With ``on_nan="fault"`` bit 16 stands for NaN in the task's
    own results.

    Attributes:
        sim: The simulation.
        task: The task.
        autoreset_mode: When a world starts its next episode.
        max_episode_steps: Control steps after which an episode is truncated; None for never.
        control_dt: Length of a control step [s].
        evaluation: Evaluates the task's functions at the current worlds.
        mirror: Columns and signs of observations, actions and privileged observations (None without any) in the mirror,
            if the task has a mirror symmetry; else None.
    """

    mirror: tuple[MirrorColumns, MirrorColumns, MirrorColumns | None] | None
    metadata: dict[str, Any] = {"render_modes": list(MODES)}  # noqa: RUF012

    def __init__(
        self,
        task: Task | type[Task] | str,
        num_envs: int | None = None,
        *,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        copy: bool = True,
        slots: int = 2,
        device: str = "auto",
        precision: str | None = None,
        threads: int | None = None,
        max_episode_steps: float | None = None,
        on_nan: OnNan = "raise",
        dict_observations: bool = False,
        daemon: str | Sim | None = None,
        first_env: int = 0,
        render_mode: str | None = None,
        **options: Any,
    ) -> None:
        """Launch a daemon for a task, or join one.

        Args:
            task: A `Task`, its class, the name of one of `tightloop.tasks`, such as ``"FrankaReach"``, or
                ``"own_task.py:Circle"``, a class in a file.
            num_envs: Number of worlds; if left out, that of the joined daemon, else 1.
            autoreset_mode: ``NEXT_STEP``, ``SAME_STEP`` or ``DISABLED``, as gymnasium defines them.
            copy: Whether each step returns new arrays. Otherwise it returns views of a ring buffer, which the step or
                reset ``slots`` calls later overwrites.
            slots: Slots of that ring, at least 2.
            device: As of `launch`, such as ``"gpu"``.
            precision: ``"f32"``, or ``"f64"`` for the physics in double precision; that of a joined daemon if left out.
            threads: Largest number of threads of a step; all cores if left out.
            max_episode_steps: Steps after which an episode is truncated, ``math.inf`` for never; the task's if left
                out.
            on_nan: What happens where `Task.reward` or `Task.observe` is NaN, or the reward infinite, in a world that
                is not faulted: ``"raise"`` raises an error that names the function and the world, after which the
                environment needs a `reset`; ``"fault"`` terminates the world, with reward 0, observation 0 and bit 16
                of ``infos["fault"]``. NaN in the first observation of an episode terminates it at its first step.
            dict_observations: Whether observations are a dict, in which each part with a ``shape`` is an array of its
                own: uint8 if its bounds are 0 and 255, float32 otherwise. Then `mirror` is None.
            daemon: Name of a running daemon to join, which ``python -m tightloop.env serve`` started for the task. It
                continues when this process ends. Or a simulation of your own, such as one of `Groups`, which `close`
                then closes. None launches a daemon that ends with this process.
            first_env: Index of the first world in the count of ``reset(seed=…)``, for groups of environments.
            render_mode: ``"rgb_array"`` for `render`, or ``"human"`` for a browser page in real time; both need the
                extra ``view``.
            **options: Arguments of the task's class.

        Raises:
            ArgumentError: An argument is not valid; the message names it.
            LaunchError: The daemon did not start. Other errors are those of `launch` and `attach`.
        """
        self.render_mode = check_mode(render_mode)
        self._faults_nan = check_on_nan(on_nan)
        slots = checks.integer("slots", slots, least=2, error=ArgumentError)
        first_env = checks.integer("first_env", first_env, least=0, error=ArgumentError)
        copy = checks.flag("copy", copy, error=ArgumentError)
        dict_observations = checks.flag("dict_observations", dict_observations, error=ArgumentError)
        if num_envs is not None:
            num_envs = checks.integer("num_envs", num_envs, error=ArgumentError)
        # a task is bound to one environment: two environments would share its arrays
        self.task = copying.deepcopy(make_task(task, options, VectorEnv))
        check_task(self.task)
        self.autoreset_mode = autoreset_mode_of(autoreset_mode)
        self.max_episode_steps = episode_steps(self.task, max_episode_steps)
        controls = controls_of(self.task)
        scene, self.sim = open_simulation(
            self.task,
            controls,
            num_envs,
            device=device,
            precision=precision,
            threads=threads,
            daemon=daemon,
            fields=FIELDS if render_mode == "rgb_array" else (),
        )
        self.num_envs = self.sim.worlds
        self.control_dt = self.sim.dt * self.sim.substeps
        self.metadata = {
            "render_modes": list(MODES),
            "render_fps": max(round(1 / self.control_dt), 1),
            "autoreset_mode": self.autoreset_mode,
        }
        try:
            names = Names(self.sim.info)
            self.task.bind(names)
            self._actions = Actions(controls, scene, names, self.num_envs)
            self.evaluation = Evaluation(self.task, self.num_envs, as_dict=dict_observations)
            self._episodes = Episodes(self.task, self.num_envs, first_env)
            self._starts, self._memory = Starts(self.task, self.num_envs), Memory(self.task, self.num_envs)
            self._disturbances = Disturbances(self.task.disturbances(), names, self.num_envs, self.control_dt)
            self.mirror = self.evaluation.mirror(self._actions.space.shape[0])
            self._rendering = None if render_mode is None else Rendering(self.sim, self.task, render_mode)
        except BaseException:
            self.sim.close()
            raise
        self.single_observation_space = self.evaluation.space
        self.single_action_space = self._actions.space
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        rooms = self.num_envs, self.evaluation.empty_observations
        self._ring = None if copy else BufferRing(*rooms, slots, self.task.dtype)
        self._done = np.zeros(self.num_envs, np.bool_)
        self._all = np.ones(self.num_envs, np.bool_)
        # worlds whose results were NaN in this step, and those whose episode began with such an observation
        self._spoiled, self._spoiled_start = np.zeros((2, self.num_envs), np.bool_)
        self._frame: Any = None
        self._ready = self._failed = self._in_flight = self._interrupted = False

    @property
    def elapsed(self) -> NDArray[np.int32]:
        """Control steps of each world's episode, shape ``(num_envs,)``; assign to it to spread the ends of episodes."""
        return self._episodes.elapsed

    @elapsed.setter
    def elapsed(self, steps: ArrayLike) -> None:
        self._check_idle("elapsed")
        self._episodes.set_elapsed(steps)

    @property
    def frame(self) -> Any:
        """Frame of the last reset or step, as `Sim.step` returns it; None before the first."""
        return self._frame

    @property
    def marks(self) -> dict[str, Any] | None:
        """Current goals, as pictures of `tightloop.view` mark them; None if the task's goals have no position."""
        return marks(self.task, self._episodes.goal)

    @property
    def viewer(self) -> Viewer | None:
        """The page of ``render_mode="human"``, which plots the reward and its terms; None in other modes."""
        return None if self._rendering is None else self._rendering.viewer

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(f"VectorEnv has no attribute {name!r}")
        known = {known for known in (*vars(self), *dir(type(self))) if known[0] != "_"}
        raise UnknownAttribute(f"VectorEnv has no attribute {name!r}; {suggestion(name, known)}")

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Start episodes in all worlds, or in those of ``options["reset_mask"]``.

        An episode depends only on its seed and on the number of episodes since that seed. ``reset(seed=…)`` repeats the
        same episodes, for any number of worlds and at any index.

        Args:
            seed: World i gets the seed ``seed + i``. Or a list with one seed per world, None for a random one. If left
                out, worlds start their next episode; the first reset draws random seeds.
            options: ``{"reset_mask": mask}``, a bool array of shape ``(num_envs,)`` with at least one True. Other
                worlds and their observations do not change. ``{"level": level}`` begins at these curriculum levels,
                int, shape ``(num_envs,)``.

        Returns:
            Observations, shape ``(num_envs, size)``, and a dict, which is empty without privileged observations.

        Raises:
            ArgumentError: The mask, the seed or an option is not valid, or an observation is NaN.
        """
        self._drop_interrupted()
        self._check_idle("reset")
        given = reset_mask(options, self.num_envs, ready=self._ready)
        mask = self._all if given is None else given
        check_seeds(seed, self.num_envs)
        level = self._starts.chosen(options, mask)
        super().reset(seed=seed if isinstance(seed, int) else None)
        seeds = self._episodes.seed(seed, mask, self.np_random)
        if seeds is not None:
            self._starts.seed(mask, seeds)
        self._starts.choose(mask, level)
        with self._all_or_none():
            self._begin(mask, seeds)
            self.evaluation.terms.begin(mask)
            self._done[mask] = self._spoiled[mask] = self._spoiled_start[mask] = False
            buffers, infos = self._next_buffers(), {}
            self._observe(buffers.obs, begun=mask)
            self._add_privileged(infos, mask)
        self._ready, self._failed = True, False
        return buffers.obs, infos

    def step(self, actions: ArrayLike) -> Step:
        """Advance all worlds by one control step: `send`, then `recv`. Arguments, results and errors are theirs."""
        try:
            self.send(actions)
            return self.recv()
        except KeyboardInterrupt:
            self._interrupted = True
            raise

    def send(self, actions: ArrayLike) -> None:
        """Send the actions of a step, and return at once; `recv` waits for the results.

        Args:
            actions: Shape ``(num_envs, actions)``, clipped to ``action_space``. NaN faults only its own world.

        Raises:
            ArgumentError: The shape is wrong, or the values are not real numbers.
            CommandRefused: There was no reset, also after a step that failed, or a step is in flight, or, without
                autoreset, an episode has ended.
        """
        self._check_ready("send")
        if self.autoreset_mode is AutoresetMode.DISABLED and self._done.any():
            world = int(np.argmax(self._done))
            problem = f"send: the episode of environment {world} has ended"
            raise CommandRefused(f'{problem}; call reset(options={{"reset_mask": …}}) for those that ended')
        commands = self._actions.take(actions, self._frame)
        self._disturbances.apply(self._episodes.seeds, self._episodes.numbers)
        # before the call: Ctrl-C can come between its end and the next line
        self._in_flight = True
        try:
            self.sim.send(**commands, **self._disturbances.commands)
        except KeyboardInterrupt:
            self._interrupted = True
            raise
        except BaseException:
            self._in_flight = False
            raise

    def recv(self) -> Step:
        """Wait for the results of the actions that `send` sent.

        Returns:
            ``obs, reward, terminated, truncated, infos``. In the mode ``SAME_STEP``, ``infos["final_obs"]`` has the
            last observations of episodes that ended, and ``infos["final_info"]`` their infos, in the rows that
            ``infos["_final_obs"]`` marks; other rows are zero.

        Raises:
            CommandRefused: No step is in flight.
            ArgumentError: A function of the task returned something that does not fit, or NaN.
            DaemonLost: The daemon went away; its state is lost.
        """
        if not self._in_flight:
            raise CommandRefused("recv: no step is on its way; call send first")
        try:
            with advice.explained_by(self._actions.not_finite):
                frame = self.sim.recv()
        except KeyboardInterrupt:
            self._interrupted = True  # `recv` may be called again, or `reset`
            raise
        except DaemonLost:  # no reset helps, and the next call raises it again
            self._in_flight = False
            raise
        except BaseException:
            self._in_flight = self._ready = False
            self._failed = True
            raise
        self._in_flight = self._interrupted = False
        with self._all_or_none():
            return self._results(frame)

    def _results(self, frame: Any) -> Step:
        """Return what a step returns, and start the next episodes."""
        if self._rendering is not None:
            self._rendering.pace(self.control_dt)
        buffers, infos = self._next_buffers(), {}
        begun = self._done if self.autoreset_mode is AutoresetMode.NEXT_STEP and self._done.any() else None
        self._episodes.elapsed += 1 if begun is None else ~begun
        if begun is None or self._memory.is_used:
            self._see(frame)
            self._memory.advance(self.evaluation)
        if begun is not None:
            begun = begun.copy()
            self._episodes.next(begun)
            self._begin(begun)
        self.evaluation.advance()
        self._score(buffers, infos, begun)
        np.logical_or(buffers.terminated, buffers.truncated, out=self._done)
        if self._rendering is not None and self._rendering.viewer is not None:
            terms = self.evaluation.terms.now
            self._rendering.plot(self._episodes.elapsed * self.control_dt, {"reward": buffers.reward, **terms})
        self.evaluation.terms.end(self._done, infos)
        self._starts.end(self._done, self.evaluation)
        due = self._episodes.due()
        if due is not None and (due := due & ~self._done).any():
            self._episodes.renew(due, self.evaluation.worlds)
        if self.autoreset_mode is AutoresetMode.SAME_STEP and self._done.any():
            begun = self._end(buffers, infos)
        self._observe(buffers.obs, begun=begun)
        self._add_privileged(infos, begun)
        return buffers.obs, buffers.reward, buffers.terminated, buffers.truncated, infos

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Render a picture per world, shape ``(height, width, 3)``, in the mode ``"rgb_array"``; None in other modes.

        A world takes milliseconds. `tightloop.view.Picture` shows many worlds in one picture.

        Raises:
            CommandRefused: No episode has begun.
        """
        if self._rendering is None:
            gymnasium.logger.warn('render: there is no render_mode; make the environment with render_mode="rgb_array"')
            return None
        return self._rendering.render(self._frame, self._episodes.goal)

    def close_extras(self, **kwargs: Any) -> None:
        """End the simulation, or leave a joined daemon."""
        # gymnasium also closes environments whose constructor failed
        if "sim" in vars(self):
            self.sim.close()

    def _end(self, buffers: StepBuffers, infos: dict[str, Any]) -> NDArray[np.bool_]:
        """Keep the last observations of episodes that ended, and start the next episodes, in the worlds returned."""
        ended = self._done.copy()
        self._observe(buffers.final_obs)
        self._add_privileged(infos, None)
        zero(buffers.final_obs, ~ended)
        # infos of running episodes belong to this step, those of ended episodes to their last step
        infos["final_info"] = {name: mine & ended if name[0] == "_" else mine for name, mine in infos.items()}
        for name in infos["final_info"]:
            if name[0] == "_":
                infos[name] = infos[name] & ~ended
        infos["final_obs"], infos["_final_obs"] = buffers.final_obs, ended
        infos["_final_info"] = ended.copy()
        self._episodes.next(ended)
        self._begin(ended)
        return ended

    @contextlib.contextmanager
    def _all_or_none(self) -> Iterator[None]:
        """Ask for a reset after an error: some worlds have changed, and the caller has not seen their results."""
        try:
            yield
        except BaseException:
            self._ready, self._failed = False, True
            raise

    def _begin(self, mask: NDArray[np.bool_], seeds: NDArray[np.uint64] | None = None) -> None:
        """Reset worlds, and start their episodes."""
        self._actions.begin(mask)
        self._starts.begin(mask)
        own = self._episodes
        frame = self._starts.reset(self.sim, mask, seeds, own, self._see)
        self._see(frame)
        rows = np.flatnonzero(mask)
        self._disturbances.begin(rows, own.seeds, own.numbers)
        self.evaluation.begin(rows, own.seeds, own.numbers)
        own.begin(mask, self.evaluation.worlds)
        # the first goals and memories make new arrays, which the task's functions must see
        self._see(frame)
        self._memory.begin(rows, self.evaluation)
        if self._memory.is_used:
            self._see(frame)

    def _see(self, frame: Any) -> Worlds:
        """Show a frame to the task's functions; returns what they see."""
        self._frame = frame
        self.evaluation.see(
            frame,
            self._memory.arrays,
            level=self._starts.level,
            action=self._actions.now,
            previous_action=self._actions.before,
            goal=self._episodes.goal,
            elapsed=self._episodes.elapsed,
        )
        return self.evaluation.worlds

    def _observe(self, out: Observations, begun: NDArray[np.bool_] | None = None) -> None:
        """Write observations; those of worlds in ``begun`` are the first ones of an episode."""
        if self.evaluation.observe(out, begun):
            # observations of a faulted world may be NaN
            healthy = (self._frame.status & FAULTED) == 0
            spoiled = with_nan(out) & healthy
            if not self._faults_nan and spoiled.any():
                raise refuse(self.evaluation.part_name(out, healthy), spoiled)
            zero_nan(out)
            zero(out, spoiled)
            if begun is not None:
                self._spoiled_start |= spoiled & begun
        if self._spoiled.any():
            zero(out, self._spoiled if begun is None else self._spoiled & ~begun)

    def _add_privileged(self, infos: dict[str, Any], begun: NDArray[np.bool_] | None) -> None:
        """Write privileged observations into the infos, and what the task says of new episodes."""
        self.evaluation.add_start_infos(infos, begun)
        privileged = self.evaluation.privileged(begun)
        if privileged is not None:
            infos["privileged"], infos["_privileged"] = privileged, self._all.copy()

    def _score(self, buffers: StepBuffers, infos: dict[str, Any], begun: NDArray[np.bool_] | None) -> None:
        """Write rewards and ends of the step; worlds that have just begun an episode have neither."""
        self.evaluation.reward(buffers.reward)
        self.evaluation.terminated(buffers.terminated)
        if self.max_episode_steps is None:
            buffers.truncated[:] = False
        else:
            np.greater_equal(self._episodes.elapsed, self.max_episode_steps, out=buffers.truncated)
        self.evaluation.truncated(buffers.truncated)
        fault = self._faults(buffers, begun)
        if fault.any():
            failed = fault > 0
            buffers.terminated |= failed
            buffers.reward[failed & ~np.isfinite(buffers.reward)] = 0.0
            buffers.reward[self._spoiled] = 0.0
            infos["fault"], infos["_fault"] = fault, failed
        self.evaluation.terms.count(self._all if begun is None else ~begun)
        if begun is not None:
            buffers.reward[begun] = 0.0
            buffers.terminated[begun] = buffers.truncated[begun] = False
        for name, value in self.evaluation.infos().items():
            infos[name], infos[f"_{name}"] = value, self._all.copy() if begun is None else ~begun

    def _faults(self, buffers: StepBuffers, begun: NDArray[np.bool_] | None) -> NDArray[Any]:
        """Return the bits of ``infos["fault"]`` of each world; the results of a task are checked here."""
        fault = self._frame.status & FAULTED
        wrong = ~np.isfinite(buffers.reward)
        self._spoiled[:] = False
        if not wrong.any() and not self._faults_nan:
            return fault
        healthy = fault == 0 if begun is None else (fault == 0) & ~begun
        wrong &= healthy
        if not self._faults_nan and wrong.any():
            value = str(buffers.reward[wrong][0])
            raise refuse(self.evaluation.function_name("reward"), wrong, value)
        if self._faults_nan and self.evaluation.observe(buffers.final_obs):
            wrong |= with_nan(buffers.final_obs) & healthy
        if self._faults_nan:
            wrong |= self._spoiled_start & healthy
            self._spoiled_start[:] = False
            self._spoiled[:] = wrong
        return fault | wrong * fault.dtype.type(TASK_FAULT)

    def _next_buffers(self) -> StepBuffers:
        if self._ring is None:
            return StepBuffers(self.num_envs, self.evaluation.empty_observations, self.task.dtype)
        return self._ring.next()
