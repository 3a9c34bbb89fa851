"""Many environments at once: a task in the worlds of a daemon, as `gymnasium.vector` has it."""

from __future__ import annotations

import copy as copying
from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector import VectorEnv as GymVectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from tightloop import checks
from tightloop.env.commands import Actions
from tightloop.env.episodes import Episodes
from tightloop.env.evaluation import Evaluation
from tightloop.env.names import Names
from tightloop.env.registry import make_task
from tightloop.env.rendering import FIELDS, MODES, Rendering, marks
from tightloop.env.rendering import check as check_mode
from tightloop.env.slots import Slot, Slots
from tightloop.env.start import begin
from tightloop.env.task import Task, episode_steps
from tightloop.errors import ArgumentError, CommandRefused
from tightloop.sim import Sim

#: Bits of ``status`` of a world that is frozen: no longer finite, or beyond the bounds of the run.
FROZEN = 1 | 8

Step = tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]


class VectorEnv(GymVectorEnv[NDArray[np.float32], NDArray[np.float32], NDArray[Any]]):
    """A task in many worlds.

    Observations are float32, shape ``(num_envs, size)``, within the bounds of ``single_observation_space``; actions
    of shape ``(num_envs, actions)`` within those of ``single_action_space``, and what is beyond counts as the bound.
    Rewards are float32.

    ``infos["success"]`` says in which worlds the task is done now, where the task knows; its `Task.metrics` are told
    likewise, and ``infos["_success"]`` says in which rows: not of worlds that have just begun. A world that failed (no
    longer finite, or beyond the task's bounds) is terminated, and ``infos["fault"]`` holds the bits of its ``status``.

    Attributes:
        sim: The simulation.
        task: The task.
        autoreset_mode: When a world whose episode ended begins the next one.
        max_episode_steps: Control steps after which an episode is truncated; None for never.
        control_dt: Length of a step [s].
        evaluation: Calls the task's functions with what the worlds are now.
    """

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
        daemon: str | Sim | None = None,
        first_env: int = 0,
        render_mode: str | None = None,
        **options: Any,
    ) -> None:
        """Launch a daemon with that many worlds, or join one.

        Args:
            task: A `Task`, its class, the name of one of `tightloop.tasks`, such as ``"FrankaReach"``, or
                ``"own_task.py:Circle"``, a class in a file.
            num_envs: How many worlds; those of the daemon if one is joined, else 1.
            autoreset_mode: ``NEXT_STEP``, ``SAME_STEP`` or ``DISABLED``, as gymnasium defines them.
            copy: Whether each step returns new arrays. Otherwise they are views of a ring, overwritten by the step or
                reset that comes ``slots`` of these later: for loops that have read them by then.
            slots: Slots of that ring, at least 2.
            device: As `launch` has it, such as ``"gpu"``.
            precision: ``"f32"``, or ``"f64"`` for the physics in double precision; that of a daemon that is joined.
            threads: Most threads a step may use; all cores if left out.
            max_episode_steps: Steps after which an episode is truncated, ``math.inf`` for never; the task's if left
                out.
            daemon: Name of a running daemon to join, which ``python -m tightloop.env serve`` started for that task. It
                goes on when this process ends, however it ends. Or a simulation of your own, such as one of `Groups`,
                which `close` then closes. None launches one that ends with this process.
            first_env: Number of the first world among those that ``reset(seed=…)`` counts, for groups of environments.
            render_mode: ``"rgb_array"`` for `render`, ``"human"`` for a page in the browser, where each step takes its
                time; both need the extra ``view``.
            **options: What the task's class takes.

        Raises:
            ArgumentError: An argument is not valid; the message names it.
            LaunchError: The daemon did not start. Other errors are those of `launch` and `attach`.
        """
        self.render_mode = check_mode(render_mode)
        slots = checks.integer("slots", slots, least=2, error=ArgumentError)
        first_env = checks.integer("first_env", first_env, least=0, error=ArgumentError)
        if num_envs is not None:
            num_envs = checks.integer("num_envs", num_envs, error=ArgumentError)
        # a task is bound to one environment: another with the same one would write into its arrays
        self.task = copying.deepcopy(make_task(task, options))
        self.autoreset_mode = _mode(autoreset_mode)
        self.max_episode_steps = episode_steps(self.task, max_episode_steps)
        controls = list(self.task.controls())
        scene, self.sim = begin(
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
            self.evaluation = Evaluation(self.task, self.num_envs)
            self._episodes = Episodes(self.task, self.num_envs, first_env)
            self._rendering = None if render_mode is None else Rendering(self.sim, self.task, render_mode)
        except BaseException:
            self.sim.close()
            raise
        self.single_observation_space = self.evaluation.space
        self.single_action_space = self._actions.space
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._slots = None if copy else Slots(self.num_envs, self.evaluation.observed, slots)
        self._done = np.zeros(self.num_envs, np.bool_)
        self._all = np.ones(self.num_envs, np.bool_)
        self._frame: Any = None
        self._ready = self._in_flight = False

    @property
    def elapsed(self) -> NDArray[np.int32]:
        """Control steps of each world's episode so far, shape ``(num_envs,)``; assigning spreads when episodes end."""
        return self._episodes.elapsed

    @elapsed.setter
    def elapsed(self, steps: ArrayLike) -> None:
        self._check_idle("elapsed")
        self._episodes.elapsed[:] = steps

    @property
    def frame(self) -> Any:
        """The frame that the last reset or step ended with, as `Sim.step` returns it; None before the first."""
        return self._frame

    @property
    def marks(self) -> dict[str, Any] | None:
        """The goals of now, as `tightloop.view` marks them in pictures; None of a task whose goals have no place."""
        return marks(self.task, self._episodes.goal)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin episodes in all worlds, or in those of ``options["reset_mask"]``.

        An episode is a function of its seed and of how many the world has had with it: ``reset(seed=…)`` begins the
        same ones again, whatever the number of worlds and wherever a world stands among them.

        Args:
            seed: World i gets the seed ``seed + i``; or a list with one a world, None for one by chance. Left out,
                worlds go on to their next episode; the first time they get seeds by chance.
            options: ``{"reset_mask": mask}``, a bool array of shape ``(num_envs,)`` with at least one True. The
                observations of the other worlds stay what they are.

        Raises:
            ArgumentError: The mask or the seed is not valid.
        """
        super().reset(seed=seed if isinstance(seed, int) else None)
        self._check_idle("reset")
        mask = self._mask(options)
        seeds = self._episodes.seed(seed, mask, self.np_random)
        self._begin(mask, self.sim.reset(mask=mask, seed=seeds))
        self._done[mask] = False
        self._ready = True
        slot = self._next_slot()
        self._observe(slot.obs)
        return slot.obs, {}

    def step(self, actions: ArrayLike) -> Step:
        """Advance all worlds by one control step: `send`, then `recv`."""
        self.send(actions)
        return self.recv()

    def send(self, actions: ArrayLike) -> None:
        """Send the actions of a step, and return at once; `recv` waits for what becomes of them.

        Args:
            actions: Shape ``(num_envs, actions)``, within ``action_space``. NaN makes a world fail, and no other.

        Raises:
            ArgumentError: The shape is another, or these are no numbers.
            CommandRefused: There was no reset, or a step is on its way, or, without autoreset, an episode has ended.
        """
        self._check_idle("send")
        if not self._ready:
            raise CommandRefused("send: no episode has begun; call reset first")
        if self.autoreset_mode is AutoresetMode.DISABLED and self._done.any():
            world = int(np.argmax(self._done))
            problem = f"send: the episode of environment {world} has ended"
            raise CommandRefused(f'{problem}; call reset(options={{"reset_mask": …}}) for those that ended')
        self.sim.send(**self._actions.take(actions, self._frame))
        self._in_flight = True

    def recv(self) -> Step:
        """What became of the actions sent last.

        Returns:
            ``obs, reward, terminated, truncated, infos``. In the mode ``SAME_STEP`` the rows that
            ``infos["_final_obs"]`` names hold in ``infos["final_obs"]`` the last observation of the episode that
            ended, and in ``infos["final_info"]`` what was told of it; the other rows are zeros.

        Raises:
            CommandRefused: There is no step on its way.
            DaemonLost: The daemon went away; its state is lost.
        """
        if not self._in_flight:
            raise CommandRefused("recv: no step is on its way; call send first")
        try:
            frame = self.sim.recv()
        except KeyboardInterrupt:
            raise  # it may be called again
        except BaseException:
            self._in_flight = False
            raise
        self._in_flight = False
        if self._rendering is not None:
            self._rendering.pace(self.control_dt)
        slot, infos = self._next_slot(), {}
        begun = self._done if self.autoreset_mode is AutoresetMode.NEXT_STEP and self._done.any() else None
        if begun is None:
            self._see(frame)
        else:
            begun = begun.copy()
            self._episodes.next(begun)
            self._begin(begun, self.sim.reset(mask=begun))
        self._episodes.elapsed += 1 if begun is None else ~begun
        self._score(slot, infos, begun)
        np.logical_or(slot.terminated, slot.truncated, out=self._done)
        due = self._episodes.due()
        if due is not None and (due := due & ~self._done).any():
            self._episodes.renew(due, self.evaluation.worlds)
        if self.autoreset_mode is AutoresetMode.SAME_STEP and self._done.any():
            self._end(slot, infos)
        self._observe(slot.obs)
        return slot.obs, slot.reward, slot.terminated, slot.truncated, infos

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Pictures of all worlds as they are now, each of shape ``(height, width, 3)``, in the mode ``"rgb_array"``.

        None in other modes. A world takes milliseconds: `tightloop.view.Picture` shows many of them in one picture.

        Raises:
            CommandRefused: No episode has begun.
        """
        if self._rendering is None:
            gymnasium.logger.warn('render: there is no render_mode; make the environment with render_mode="rgb_array"')
            return None
        return self._rendering.render(self._frame, self._episodes.goal)

    def close_extras(self, **kwargs: Any) -> None:
        """End the simulation, or leave the daemon that was joined."""
        # gymnasium closes, too, what could not be made
        if "sim" in vars(self):
            self.sim.close()

    def _end(self, slot: Slot, infos: dict[str, Any]) -> None:
        """Keep the last observations of episodes that ended, and begin the next ones."""
        ended = self._done.copy()
        self._observe(slot.final_obs)
        slot.final_obs[~ended] = 0.0
        # of the worlds that go on, what is told is of this step; of those that ended, it was of their last one
        infos["final_info"] = {name: mine & ended if name[0] == "_" else mine for name, mine in infos.items()}
        for name in infos["final_info"]:
            if name[0] == "_":
                infos[name] = infos[name] & ~ended
        infos["final_obs"], infos["_final_obs"] = slot.final_obs, ended
        infos["_final_info"] = ended.copy()
        self._episodes.next(ended)
        self._begin(ended, self.sim.reset(mask=ended))

    def _begin(self, mask: NDArray[np.bool_], frame: Any) -> None:
        """Begin episodes of worlds that the daemon has reset."""
        self._actions.begin(mask)
        self._see(frame)
        self._episodes.begin(mask, self.evaluation.worlds)
        # the first goals of all are an array that was not there before
        self._see(frame)

    def _see(self, frame: Any) -> None:
        """Make a frame what the task's functions see."""
        self._frame = frame
        self.evaluation.see(
            frame,
            action=self._actions.now,
            previous_action=self._actions.before,
            goal=self._episodes.goal,
            elapsed=self._episodes.elapsed,
        )

    def _observe(self, out: NDArray[np.float32]) -> None:
        self.evaluation.observe(out)
        frozen = self._frame.status & FROZEN
        if frozen.any():
            # what is derived from a frozen state need not be finite
            out[frozen > 0] = np.nan_to_num(out[frozen > 0], nan=0.0)

    def _score(self, slot: Slot, infos: dict[str, Any], begun: NDArray[np.bool_] | None) -> None:
        """Reward and ends of the step; worlds that have just begun have neither."""
        self.evaluation.reward(slot.reward)
        self.evaluation.terminated(slot.terminated)
        if self.max_episode_steps is None:
            slot.truncated[:] = False
        else:
            np.greater_equal(self._episodes.elapsed, self.max_episode_steps, out=slot.truncated)
        fault = self._frame.status & FROZEN
        if fault.any():
            failed = fault > 0
            slot.terminated |= failed
            slot.reward[failed & ~np.isfinite(slot.reward)] = 0.0
            infos["fault"], infos["_fault"] = fault, failed
        if begun is not None:
            slot.reward[begun] = 0.0
            slot.terminated[begun] = slot.truncated[begun] = False
        for name, value in self.evaluation.told().items():
            infos[name], infos[f"_{name}"] = value, self._all.copy() if begun is None else ~begun

    def _next_slot(self) -> Slot:
        if self._slots is None:
            return Slot(self.num_envs, self.evaluation.observed)
        return self._slots.next()

    def _mask(self, options: dict[str, Any] | None) -> NDArray[np.bool_]:
        if options is None or "reset_mask" not in options:
            return self._all
        mask = options["reset_mask"]
        if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_ or mask.shape != (self.num_envs,):
            raise ArgumentError(f"reset_mask: give a NumPy array of bool, shape {(self.num_envs,)}; got {mask!r}")
        if not mask.any():
            raise ArgumentError("reset_mask: no environment is to be reset; set at least one to True")
        if not self._ready and not mask.all():
            raise ArgumentError("reset_mask: the first reset is of all environments; leave the mask out")
        return mask

    def _check_idle(self, call: str) -> None:
        if self._in_flight:
            raise CommandRefused(f"{call}: a step is on its way; call recv first")


def _mode(mode: AutoresetMode | str) -> AutoresetMode:
    for known in AutoresetMode:
        if mode in (known, known.name, known.value):
            return known
    raise ArgumentError(f"autoreset_mode is {mode!r}; give NEXT_STEP, SAME_STEP or DISABLED")
