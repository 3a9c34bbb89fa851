"""A vector environment whose worlds are spread over processes on several machines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector import VectorEnv as GymVectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from tightloop.adapters.gathering import cut_off, gather_infos, ranges, seeds_after_restart
from tightloop.adapters.shard import ShardStart, ShardStep
from tightloop.adapters.shards import Fleet, Shards
from tightloop.checks import arguments as checks
from tightloop.checks.signatures import checked_calls
from tightloop.env.episodes.episodes import Episodes, check_seeds
from tightloop.env.episodes.reset_arguments import autoreset_mode_of, reset_mask
from tightloop.env.episodes.starts import Starts
from tightloop.env.evaluation.step_buffers import BufferRing, StepBuffers, aligned
from tightloop.env.registry import make_task
from tightloop.env.task import Task, episode_steps
from tightloop.env.vector import Step
from tightloop.errors import ArgumentError, CommandRefused, SimClosed


@checked_calls
class SpreadVectorEnv(GymVectorEnv[NDArray[Any], NDArray[np.float32], NDArray[Any]]):
    """Base class of vector environments over several processes, such as `tightloop.adapters.ray.RayVectorEnv`.

    It behaves as one `VectorEnv` with all worlds: the same observations for the same seeds, bit for bit. Each process
    has a shard, a range of the worlds. A shard that goes away starts again, and the others go on.

    Attributes:
        task: The task; the shards have copies.
        autoreset_mode: When a world starts its next episode.
        max_episode_steps: Control steps after which an episode is truncated; None for never.
        control_dt: Length of a control step [s].
        mirror: As of `VectorEnv`.
        privileged_space: Space of one world's privileged observation; None if the task has none.
        rows: The worlds of each shard, as slices.
        restarts: How many times a shard was started again.
    """

    def __init__(
        self,
        task: Task | type[Task] | str,
        num_envs: int,
        shards: int,
        fleet: Fleet,
        *,
        autoreset_mode: AutoresetMode | str,
        copy: bool,
        slots: int,
        max_episode_steps: float | None,
        first_env: int,
        launch_timeout: float,
        step_timeout: float,
        env_options: Mapping[str, Any],
        task_options: Mapping[str, Any],
    ) -> None:
        """Start the shards, and wait for them.

        Args:
            task: As of `VectorEnv`.
            num_envs: Number of all worlds, at least ``shards``.
            shards: Number of shards.
            fleet: Their processes, which `close` ends.
            autoreset_mode: As of `VectorEnv`.
            copy: As of `VectorEnv`.
            slots: As of `VectorEnv`.
            max_episode_steps: As of `VectorEnv`.
            first_env: As of `VectorEnv`.
            launch_timeout: Longest time until a shard has started [s].
            step_timeout: Time after which a shard without an answer is lost [s].
            env_options: Further arguments of `VectorEnv` in each process.
            task_options: Arguments of the task's class.

        Raises:
            ArgumentError: An argument is not valid.
            LaunchError: A shard could not start in time.
        """
        slots = checks.integer("slots", slots, least=2, error=ArgumentError)
        first_env = checks.integer("first_env", first_env, least=0, error=ArgumentError)
        copy = checks.flag("copy", copy, error=ArgumentError)
        if env_options.get("dict_observations"):
            raise ArgumentError("dict_observations: observations of several processes are one array; leave it out")
        self.task = make_task(task, task_options, type(self))
        self.autoreset_mode = autoreset_mode_of(autoreset_mode)
        self.max_episode_steps = episode_steps(self.task, max_episode_steps)
        self.num_envs, self.rows = num_envs, ranges(num_envs, shards)
        self.render_mode, self.restarts = None, 0
        options = {
            "autoreset_mode": self.autoreset_mode.name,
            "max_episode_steps": max_episode_steps,
            **env_options,
            **task_options,
        }
        self._episodes, self._starts = Episodes(self.task, num_envs, first_env), Starts(self.task, num_envs)
        self._level = np.zeros(num_envs, np.int32)
        self._done = np.zeros(num_envs, np.bool_)
        self._last_privileged: NDArray[Any] | None = None
        self._calls: dict[int, Any] | None = None  # of the step in flight
        self._ready = self._failed = self._interrupted = False
        self._shards = Shards(fleet, self.rows, task, options, launch_timeout=launch_timeout, step_timeout=step_timeout)
        try:
            self._shards.launch(dict.fromkeys(range(shards), "it has not started"))
        except BaseException:
            self.close()
            raise
        info = self._shards.infos[0]
        self.control_dt, self.mirror, self.privileged_space = info.control_dt, info.mirror, info.privileged_space
        self.metadata = {
            "render_modes": [],
            "render_fps": max(round(1 / self.control_dt), 1),
            "autoreset_mode": self.autoreset_mode,
        }
        self.single_observation_space, self.single_action_space = info.observation_space, info.action_space
        self.observation_space = batch_space(info.observation_space, num_envs)
        self.action_space = batch_space(info.action_space, num_envs)
        shape, dtype = info.observation_space.shape, self.task.dtype
        self._empty = lambda worlds: aligned((worlds, *shape), dtype)
        self._ring = None if copy else BufferRing(num_envs, self._empty, slots, dtype)
        self._last_obs = np.zeros((num_envs, *shape), dtype)

    @property
    def seeds(self) -> NDArray[np.uint64]:
        """Seed of each world's episodes, shape ``(num_envs,)``; a copy. Restarted worlds have new ones."""
        return self._episodes.seeds.copy()

    @property
    def level(self) -> NDArray[np.int32]:
        """Curriculum level of each world's episode, shape ``(num_envs,)``; a copy."""
        return self._level.copy()

    @property
    def places(self) -> list[str]:
        """Where each shard runs, such as a node's name."""
        return [self._shards.infos[shard].place for shard in range(len(self.rows))]

    @property
    def elapsed(self) -> NDArray[np.int32]:
        """Control steps of each world's episode, shape ``(num_envs,)``; assign to it to spread the ends of episodes.

        Raises:
            DaemonLost: A shard went away; the next step starts it again.
        """
        self._check_idle("elapsed")
        return np.concatenate(self._shards.ask_all("elapsed", [() for _ in self.rows]))

    @elapsed.setter
    def elapsed(self, steps: ArrayLike) -> None:
        self._check_idle("elapsed")
        self._episodes.set_elapsed(steps)
        own = self._episodes.elapsed
        self._shards.ask_all("set_elapsed", [(own[rows],) for rows in self.rows])

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[Any], dict[str, Any]]:
        """Start episodes in all worlds, or in those of ``options["reset_mask"]``, as `VectorEnv.reset` does.

        A shard that went away is started again. All its worlds then begin an episode, and ``infos["restarted"]`` marks
        them.

        Args:
            seed: World i gets the seed ``seed + i``, or one seed per world, as of `VectorEnv.reset`.
            options: As of `VectorEnv.reset`.

        Returns:
            Observations, shape ``(num_envs, size)``, and a dict.

        Raises:
            ArgumentError: The mask, the seed or an option is not valid, or an observation is NaN.
            LaunchError: A shard could not start again in time.
        """
        self._check_open("reset")
        if self._interrupted:
            self._drop()
        self._check_idle("reset")
        mask = reset_mask(options, self.num_envs, ready=self._ready)
        begun = np.ones(self.num_envs, np.bool_) if mask is None else mask
        check_seeds(seed, self.num_envs)
        level = self._starts.chosen(options, begun)
        super().reset(seed=seed if isinstance(seed, int) else None)
        seeds = self._episodes.seed(seed, begun, self.np_random)
        self._ready, self._failed = False, True  # until all shards have answered
        calls = {}
        for shard, rows in enumerate(self.rows):
            if begun[rows].any():
                own = None if seeds is None else seeds[rows].tolist()
                partial = None if begun[rows].all() else begun[rows]
                calls[shard] = ("reset", own, partial, None if level is None else level[rows])
        starts, lost = self._shards.ask(calls)
        parts: list[tuple[slice, Mapping[str, Any]]] = []
        if lost:
            fresh = np.ones(self.num_envs, np.bool_) if seeds is None else ~begun
            if level is not None:
                self._level[begun] = level[begun]
            starts |= self._restart(lost, fresh, np.zeros(self.num_envs, np.bool_))
            for rows in (self.rows[shard] for shard in lost):
                everywhere = np.ones(rows.stop - rows.start, np.bool_)
                parts.append((rows, {"restarted": everywhere, "_restarted": everywhere}))
                self._done[rows] = False
        buffers = self._next_buffers()
        for shard, rows in enumerate(self.rows):
            buffers.obs[rows] = starts[shard].obs if shard in starts else self._last_obs[rows]
            if shard in starts:
                self._level[rows] = starts[shard].level
                parts.append((rows, starts[shard].infos))
            elif self._last_privileged is not None:
                everywhere = np.ones(rows.stop - rows.start, np.bool_)
                parts.append((rows, {"privileged": self._last_privileged[rows], "_privileged": everywhere}))
        infos = gather_infos(parts, self.num_envs)
        self._done[begun] = False
        self._keep(buffers.obs, infos)
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
            SimClosed: The environment was closed.
        """
        self._check_idle("send")
        if not self._ready:
            why = "the last step or reset failed" if self._failed else "no episode has begun"
            raise CommandRefused(f"send: {why}; call reset first")
        if self.autoreset_mode is AutoresetMode.DISABLED and self._done.any():
            problem = f"send: the episode of environment {int(np.argmax(self._done))} has ended"
            raise CommandRefused(f'{problem}; call reset(options={{"reset_mask": …}}) for those that ended')
        given, shape = np.asarray(actions), (self.num_envs, *(self.single_action_space.shape or ()))
        if given.shape != shape or given.dtype.kind not in "fiu":
            raise ArgumentError(
                f"actions: expected real numbers of shape {shape}; got {given.dtype} of shape {given.shape}"
            )
        if given.dtype == np.float64:  # half the bytes; clipping after rounding gives the same bits as before it
            with np.errstate(over="ignore"):
                given = given.astype(np.float32)
        # an interrupt may leave the step with some shards only
        self._ready, self._failed = False, True
        self._calls = self._shards.send({shard: ("step", given[rows]) for shard, rows in enumerate(self.rows)})

    def recv(self) -> Step:
        """Wait for the results of the actions that `send` sent.

        If a shard went away, this waits until it has started again. ``infos["restarted"]`` then marks its worlds.
        Their episodes are truncated, with reward 0 and the last observation that arrived. They go on with new
        seeds, which are a function of the old ones.

        Returns:
            ``obs, reward, terminated, truncated, infos``, as of `VectorEnv.recv`.

        Raises:
            CommandRefused: No step is in flight.
            ArgumentError: A function of the task returned something that does not fit, or NaN.
            LaunchError: A shard could not start again in time.
        """
        self._check_open("recv")
        if self._calls is None:
            raise CommandRefused("recv: no step is on its way; call send first")
        try:
            answers = self._shards.receive(self._calls)
        except KeyboardInterrupt:
            self._interrupted = True  # `recv` may be called again, or `reset`
            raise
        except BaseException:
            self._calls = None
            raise
        self._calls, self._interrupted = None, False
        steps, lost = self._shards.sorted(answers)
        if lost:
            steps |= self._cut_off(lost)
        buffers, infos = self._next_buffers(), []
        for shard, rows in enumerate(self.rows):
            step = steps[shard]
            buffers.obs[rows], buffers.reward[rows] = step.obs, step.reward
            buffers.terminated[rows], buffers.truncated[rows] = step.terminated, step.truncated
            if step.level is not None:
                self._level[rows] = step.level
            infos.append((rows, step.infos))
        gathered = gather_infos(infos, self.num_envs)
        np.logical_or(buffers.terminated, buffers.truncated, out=self._done)
        self._keep(buffers.obs, gathered)
        self._ready, self._failed = True, False
        return buffers.obs, buffers.reward, buffers.terminated, buffers.truncated, gathered

    def close_extras(self, **kwargs: Any) -> None:
        """End the shards and their daemons."""
        # gymnasium also closes environments whose constructor failed
        if "_shards" in vars(self):
            self._shards.close()

    def _cut_off(self, lost: Mapping[int, str]) -> dict[int, ShardStep]:
        """Start shards again whose step was lost; returns the step as the caller sees it."""
        same_step = self.autoreset_mode is AutoresetMode.SAME_STEP
        # in the mode NEXT_STEP, worlds whose episode had ended begin another one in this step
        cut = np.ones(self.num_envs, np.bool_) if same_step else ~self._done
        every = np.ones(self.num_envs, np.bool_)
        starts = self._restart(lost, every, np.zeros(self.num_envs, np.bool_) if same_step else cut)
        last = self._last_privileged
        return {
            shard: cut_off(
                self.autoreset_mode,
                starts[shard],
                cut[rows],
                self._last_obs[rows],
                None if last is None else last[rows],
            )
            for shard, rows in ((shard, self.rows[shard]) for shard in lost)
        }

    def _restart(
        self, lost: Mapping[int, str], fresh: NDArray[np.bool_], ended: NDArray[np.bool_]
    ) -> dict[int, ShardStart]:
        """Start shards again.

        Args:
            lost: Shards, and how each was lost.
            fresh: Worlds that take new seeds, shape ``(num_envs,)``.
            ended: As of `Shard.begin`, shape ``(num_envs,)``.
        """
        own = self._episodes
        for rows in (self.rows[shard] for shard in lost):
            worlds = np.arange(rows.start, rows.stop)[fresh[rows]]
            own.seeds[worlds] = seeds_after_restart(own.seeds[worlds])
            own.numbers[rows] = 0

        def begin(shard: int) -> tuple[Any, ...]:
            rows = self.rows[shard]
            return "begin", own.seeds[rows].tolist(), self._level[rows], ended[rows]

        starts = self._shards.launch(lost, begin)
        for shard, reason in lost.items():
            self.restarts += 1
            gymnasium.logger.warn(
                f"{self._shards.worlds(shard)} were lost and begin again on {self._shards.infos[shard].place}: {reason}"
            )
        return starts

    def _keep(self, obs: NDArray[Any], infos: Mapping[str, Any]) -> None:
        """Keep what was observed last: worlds that are lost end their episodes with it."""
        np.copyto(self._last_obs, obs)
        if "privileged" in infos:
            self._last_privileged = infos["privileged"].copy()

    def _next_buffers(self) -> StepBuffers:
        if self._ring is None:
            return StepBuffers(self.num_envs, self._empty, self.task.dtype)
        return self._ring.next()

    def _drop(self) -> None:
        """Wait for the results of a step that was interrupted, and drop them."""
        calls, self._calls = self._calls, None
        if calls is not None:
            self._shards.receive(calls)
        self._interrupted = False

    def _check_open(self, call: str) -> None:
        if self.closed:
            raise SimClosed(f"{call}: the environment was closed; make another one")

    def _check_idle(self, call: str) -> None:
        self._check_open(call)
        if self._calls is not None:
            raise CommandRefused(f"{call}: a step is on its way; call recv first")
