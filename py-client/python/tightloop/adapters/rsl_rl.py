"""Adapter to rsl_rl: many worlds as its `VecEnv`.

>>> from rsl_rl.runners import OnPolicyRunner
>>> from tightloop.adapters.rsl_rl import RslRlVecEnv
>>> OnPolicyRunner(RslRlVecEnv("FrankaReach", 1024), config, log_dir="out").learn(300)
"""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from tightloop.adapters.environment import Given, adapted_environment, library, set_torch_threads
from tightloop.checks.signatures import checked_calls
from tightloop.errors import ArgumentError

rsl_env = library("rsl_rl.env", install="rsl-rl-lib")
tensordicts = library("tensordict", install="rsl-rl-lib")
torch = library("torch", install="torch")

#: Group of the observation: the default of rsl_rl's ``obs_groups``.
GROUP = "policy"


@checked_calls
class RslRlVecEnv(rsl_env.VecEnv):
    """A `VectorEnv` as a `VecEnv` of rsl_rl, which starts the next episode in the same step.

    Observations are a TensorDict with the group ``"policy"``. ``extras["time_outs"]`` says which episodes the time
    limit ended, and ``extras["log"]["/success"]`` is the success rate of ended episodes, if the task defines success.

    Attributes:
        env: The `VectorEnv`.
        num_envs: Number of worlds.
        num_actions: Length of an action.
        max_episode_length: Steps after which an episode is truncated.
        device: Device of torch's tensors.
        cfg: Configuration of the environment, for logs.
    """

    def __init__(
        self,
        env: Given,
        num_envs: int | None = None,
        *,
        torch_device: str = "cpu",
        torch_threads: int | None = 1,
        **options: Any,
    ) -> None:
        """Adapt an environment of the mode ``SAME_STEP``, or make one for a task.

        Args:
            env: A `VectorEnv`, or a task.
            num_envs: Number of worlds, for a task.
            torch_device: Device of torch's tensors, such as ``"cuda:0"``; ``device`` is that of the physics.
            torch_threads: Threads of torch in this process, if ``torch_device`` is the CPU. Several take the
                cores from the simulation, and training is several times as slow. None changes nothing.
            **options: Further arguments of `VectorEnv`, for a task.

        Raises:
            ArgumentError: The environment has another autoreset mode, or endless episodes, or ``torch_threads`` is
                below 1.
        """
        set_torch_threads(torch, torch_threads, torch_device)
        self.env = adapted_environment(env, num_envs, AutoresetMode.SAME_STEP, options)
        if self.env.max_episode_steps is None:
            raise ArgumentError("max_episode_steps: rsl_rl needs episodes that end; give a number")
        self.num_envs = self.env.num_envs
        self.num_actions = int(np.prod(self.env.single_action_space.shape or ()))
        self.max_episode_length = self.env.max_episode_steps
        self.device = torch.device(torch_device)
        self.cfg = {
            "task": type(self.env.task).__name__,
            "num_envs": self.num_envs,
            "control_dt": self.env.control_dt,
            "max_episode_steps": self.max_episode_length,
        }
        self._obs: Any = None

    @property
    def episode_length_buf(self) -> Any:
        """Steps of each world's episode, int64, shape ``(num_envs,)``: a copy; assign to it to set them.

        rsl_rl assigns to it so that the first episodes do not all end at once.
        """
        return torch.tensor(self.env.elapsed, dtype=torch.long, device=self.device)

    @episode_length_buf.setter
    def episode_length_buf(self, steps: Any) -> None:
        if self._obs is None:
            self.reset()
        self.env.elapsed = steps.cpu().numpy()

    def reset(self, seed: int | None = None) -> tuple[Any, dict[str, Any]]:
        """Start episodes in all worlds; world i gets the seed ``seed + i``. Returns observations and empty extras."""
        obs, _ = self.env.reset(seed=seed)
        self._obs = self._observation(obs)
        return self._obs, {}

    def get_observations(self) -> Any:
        """Return the last observations; the first call resets all worlds."""
        if self._obs is None:
            self.reset()
        return self._obs

    def step(self, actions: Any) -> tuple[Any, Any, Any, dict[str, Any]]:
        """Advance all worlds by one control step.

        Args:
            actions: Shape ``(num_envs, num_actions)``, clipped to the bounds of actions.

        Returns:
            Observations, rewards and ends (0 or 1), shape ``(num_envs,)``, and extras.
        """
        obs, reward, terminated, truncated, infos = self.env.step(actions.detach().cpu().numpy())
        done = terminated | truncated
        self._obs = self._observation(obs)
        extras: dict[str, Any] = {"time_outs": self._tensor(truncated & ~terminated)}
        last = infos.get("final_info", {})
        # nothing is known of episodes that ended since their machine was lost
        if "success" in last and (known := last["_success"]).any():
            extras["log"] = {"/success": float(last["success"][known].mean())}
        return self._obs, self._tensor(reward), self._tensor(done).long(), extras

    def close(self) -> None:
        """End the simulation."""
        self.env.close()

    def _observation(self, obs: NDArray[np.float32]) -> Any:
        return tensordicts.TensorDict({GROUP: self._tensor(obs)}, batch_size=[self.num_envs], device=self.device)

    def _tensor(self, array: NDArray[Any]) -> Any:
        # `torch.tensor` copies, unlike `from_numpy`: the algorithm keeps these beyond the next step
        # policies are float32, also where observations are float64
        dtype = torch.float32 if array.dtype == np.float64 else None
        return torch.tensor(array, dtype=dtype, device=self.device)
