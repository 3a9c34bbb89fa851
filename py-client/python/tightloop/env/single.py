"""A single environment, as a `gymnasium.Env`."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import ArrayLike, NDArray

from tightloop.arrays.inputs import whole_seed
from tightloop.checks.signatures import checked_calls
from tightloop.env.evaluation.results import check_options
from tightloop.env.evaluation.step_buffers import Observations
from tightloop.env.rendering import MODES
from tightloop.env.task import Task
from tightloop.env.vector import VectorEnv
from tightloop.errors import ArgumentError, SignatureError

#: Arguments of environments with many worlds, also as they are mistyped.
_MANY = {"autoreset_mode", "n_envs", "num_env", "num_envs", "num_worlds", "worlds"}


@checked_calls
class Env(gymnasium.Env[Observations, NDArray[np.float32]]):
    """A task in one world; each step returns new arrays.

    An episode of a seed equals that of the world with the same seed in a `VectorEnv`.

    Attributes:
        vector: The underlying `VectorEnv` with one world.
    """

    metadata: dict[str, Any] = {"render_modes": list(MODES)}  # noqa: RUF012

    def __init__(self, task: Task | type[Task] | str, **options: Any) -> None:
        """Make a task's environment.

        Args:
            task: As of `VectorEnv`.
            **options: As of `VectorEnv`, except ``num_envs`` and ``autoreset_mode``.
        """
        for name in _MANY & set(options):
            raise SignatureError(f"Env: {name} is not taken, since it has one world; leave it out, or make a VectorEnv")
        if options.get("daemon") is None:
            options.setdefault("threads", 1)
        self.vector = VectorEnv(task, 1, autoreset_mode=AutoresetMode.DISABLED, **options)
        self.render_mode = self.vector.render_mode
        self.metadata = {name: value for name, value in self.vector.metadata.items() if name != "autoreset_mode"}
        self.observation_space = self.vector.single_observation_space
        self.action_space = self.vector.single_action_space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Start an episode: the first one of a seed, or the next one. Returns the observation and the task's infos.

        Args:
            seed: Seed of the episode; the next episode if left out.
            options: There are none: a dict with any entry is refused.

        Raises:
            ArgumentError: The seed or an option is not valid.
        """
        check_options(options, ())
        if seed is not None and whole_seed(seed) is None:
            raise ArgumentError(f"reset: seed is {seed!r}; give a whole number from 0 to 2**64 - 1")
        super().reset(seed=None if seed is None else int(seed))
        obs, infos = self.vector.reset(seed=seed)
        return _first(obs), _info(infos)

    def step(self, action: ArrayLike) -> tuple[Observations, float, bool, bool, dict[str, Any]]:
        """Advance by one control step.

        Args:
            action: Shape ``(actions,)``, clipped to ``action_space``.

        Returns:
            ``obs, reward, terminated, truncated, info``.

        Raises:
            ArgumentError: The shape is wrong, or the values are not real numbers. Others are those of `VectorEnv.step`.
        """
        given, size = np.asarray(action), self.action_space.shape
        if given.shape != size or given.dtype.kind not in "fiu":
            raise ArgumentError(f"step: action is {action!r:.80}; give real numbers of shape {size}")
        obs, reward, terminated, truncated, infos = self.vector.step(given[None])
        return _first(obs), float(reward[0]), bool(terminated[0]), bool(truncated[0]), _info(infos)

    def set_state(self, qpos: ArrayLike, qvel: ArrayLike) -> None:
        """Set positions, shape ``(positions,)``, and velocities, as `VectorEnv.set_state` does."""
        self.vector.set_state(qpos, qvel)

    def render(self) -> NDArray[np.uint8] | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Render a picture, shape ``(height, width, 3)``, in the mode ``"rgb_array"``; None in other modes."""
        pictures = self.vector.render()
        return None if pictures is None else pictures[0]

    def close(self) -> None:
        """End the simulation."""
        self.vector.close()


def _first(obs: Observations) -> Observations:
    """Return the observation of the only world."""
    return {name: array[0] for name, array in obs.items()} if isinstance(obs, dict) else obs[0]


def _info(infos: dict[str, Any]) -> dict[str, Any]:
    """Return the infos of the only world."""
    return {name: value[0] for name, value in infos.items() if not name.startswith("_") and infos[f"_{name}"][0]}
