"""Adapter to Stable-Baselines3: many worlds as its `VecEnv`.

>>> from stable_baselines3 import PPO
>>> from tightloop.adapters.sb3 import Sb3VecEnv
>>> env = Sb3VecEnv("FrankaReach", 512)
>>> PPO("MlpPolicy", env, n_steps=24, batch_size=3072, gamma=0.9, device="cpu").learn(1_000_000)
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from tightloop.adapters.environment import Given, adapted_environment, library, set_torch_threads
from tightloop.checks.signatures import checked_calls
from tightloop.env.evaluation.step_buffers import Observations
from tightloop.errors import ArgumentError

vec_env = library("stable_baselines3.common.vec_env", install="stable-baselines3")
torch = library("torch", install="torch")


@checked_calls
class Sb3VecEnv(vec_env.VecEnv):
    """A `VectorEnv` as a `VecEnv` of Stable-Baselines3, which starts the next episode in the same step.

    ``infos[i]["terminal_observation"]`` is the last observation of an episode. ``infos[i]["TimeLimit.truncated"]`` says
    whether the time limit ended it, and ``infos[i]["is_success"]`` whether it ended in success. All arrays are copies.
    With ``dict_observations=True`` they are of a ``"MultiInputPolicy"``, which takes uint8 images by convolutions.

    Attributes:
        env: The `VectorEnv`.
    """

    def __init__(
        self, env: Given, num_envs: int | None = None, *, torch_threads: int | None = 1, **options: Any
    ) -> None:
        """Adapt an environment of the mode ``SAME_STEP``, or make one for a task.

        Args:
            env: A `VectorEnv`, or a task.
            num_envs: Number of worlds, for a task.
            torch_threads: Threads of torch in this process. Several take the cores from the simulation, and
                training is several times as slow. None changes nothing.
            **options: Further arguments of `VectorEnv`, for a task.

        Raises:
            ArgumentError: The environment has another autoreset mode, or ``torch_threads`` is below 1.
        """
        set_torch_threads(torch, torch_threads)
        self.env = adapted_environment(env, num_envs, AutoresetMode.SAME_STEP, options, takes_dicts=True)
        super().__init__(self.env.num_envs, self.env.single_observation_space, self.env.single_action_space)

    def reset(self) -> Observations:
        """Start episodes in all worlds, with the seeds of `seed` if it was called.

        Returns:
            Observations, shape ``(num_envs, size)``, or a dict of arrays.

        Raises:
            ArgumentError: `set_options` was called with options.
        """
        if any(self._options):
            self._reset_options()
            raise ArgumentError("set_options: a reset of these environments has no options; call it with none")
        seeds = None if all(seed is None for seed in self._seeds) else list(self._seeds)
        obs, _ = self.env.reset(seed=seeds)
        self._reset_seeds()
        return _copied(obs)

    def step_async(self, actions: NDArray[Any]) -> None:
        """Send actions, shape ``(num_envs, actions)``, and return at once; `step_wait` returns the results."""
        self.env.send(actions)

    def step_wait(self) -> tuple[Observations, NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Wait for observations, rewards, ends and infos, worlds first."""
        obs, reward, terminated, truncated, infos = self.env.recv()
        done = terminated | truncated
        news: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        if done.any():
            rows = np.flatnonzero(done)
            last, late = infos["final_obs"], truncated[rows] & ~terminated[rows]
            success, known = (infos["final_info"].get(name) for name in ("success", "_success"))
            for row, world in enumerate(rows.tolist()):
                news[world] = {"terminal_observation": _of_world(last, world), "TimeLimit.truncated": bool(late[row])}
                # nothing is known of episodes that ended since their machine was lost
                if success is not None and known[world]:
                    news[world]["is_success"] = bool(success[world])
        return _copied(obs), reward.copy(), done, news

    def close(self) -> None:
        """End the simulation."""
        self.env.close()

    def get_images(self) -> list[Any]:
        """Return a picture of each world, or None without ``render_mode="rgb_array"``."""
        pictures = None if self.env.render_mode is None else self.env.render()
        return [None] * self.num_envs if pictures is None else list(pictures)

    def get_attr(self, attr_name: str, indices: int | Iterable[int] | None = None) -> list[Any]:
        """Return an attribute of the `VectorEnv`, once per requested world."""
        return [getattr(self.env, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: int | Iterable[int] | None = None) -> None:
        """Set an attribute of the `VectorEnv`, which all worlds share.

        Raises:
            ArgumentError: ``indices`` names only some of the worlds.
        """
        if len(set(self._get_indices(indices))) != self.num_envs:
            raise ArgumentError(f"set_attr: all worlds share {attr_name!r}; leave `indices` out")
        setattr(self.env, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: int | Iterable[int] | None = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call a method of the `VectorEnv` once for all worlds; return its result once per requested world."""
        result = getattr(self.env, method_name)(*method_args, **method_kwargs)
        return [result for _ in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class: type[Any], indices: int | Iterable[int] | None = None) -> list[bool]:
        """Return False for each world: `VecMonitor` and the like wrap this object, not single worlds."""
        return [False for _ in self._get_indices(indices)]


def _copied(obs: Observations) -> Observations:
    return {name: array.copy() for name, array in obs.items()} if isinstance(obs, dict) else obs.copy()


def _of_world(obs: Observations, world: int) -> Observations:
    """Return a copy of a world's observation."""
    return {name: array[world].copy() for name, array in obs.items()} if isinstance(obs, dict) else obs[world].copy()
