"""Adapter to torchrl: many worlds as one batched `EnvBase`.

>>> from torchrl.collectors import Collector
>>> from tightloop.adapters.torchrl import TorchRlEnv
>>> TorchRlEnv("FrankaReach", 256).rollout(100, break_when_any_done=False)

torchrl's own `GymWrapper` returns the environment's arrays without a copy, and fails for a reset of a TensorDict
without ``_reset``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from tightloop.adapters.environment import Given, adapted_environment, library, set_torch_threads
from tightloop.checks.signatures import checked_calls

envs = library("torchrl.envs", install="torchrl")
specs = library("torchrl.data", install="torchrl")
tensordicts = library("tensordict", install="torchrl")
torch = library("torch", install="torch")


@checked_calls
class TorchRlEnv(envs.EnvBase):
    """A `VectorEnv` of batch size ``(num_envs,)``; torchrl resets the worlds whose episodes ended.

    Keys: ``observation``, ``action``, ``reward``, ``done``, ``terminated`` and ``truncated``. Further values,
    such as ``success``, are in the attribute ``infos``: torchrl would pass a key of its own to every policy.

    Attributes:
        env: The `VectorEnv`.
        infos: Infos of the last step.
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
        """Adapt an environment of the mode ``DISABLED``, or make one for a task.

        Args:
            env: A `VectorEnv`, or a task.
            num_envs: Number of worlds, for a task.
            torch_device: Device of torch's tensors, such as ``"cuda:0"``; ``device`` is that of the physics.
            torch_threads: Threads of torch in this process, if ``torch_device`` is the CPU. Several take the
                cores from the simulation, and training is several times as slow. None changes nothing.
            **options: Further arguments of `VectorEnv`, for a task.

        Raises:
            ArgumentError: The environment has another autoreset mode, or ``torch_threads`` is below 1.
        """
        set_torch_threads(torch, torch_threads, torch_device)
        inner = adapted_environment(env, num_envs, AutoresetMode.DISABLED, options)
        super().__init__(device=torch.device(torch_device), batch_size=torch.Size([inner.num_envs]))
        self.env = inner
        self.infos: dict[str, Any] = {}
        self._seed: int | None = None
        size = self.batch_size
        spaces: dict[str, Any] = {"observation": inner.observation_space, "action": inner.action_space}
        bounds = {
            name: specs.Bounded(
                low=self._tensor(space.low), high=self._tensor(space.high), dtype=torch.float32, device=self.device
            )
            for name, space in spaces.items()
        }
        flag = specs.Categorical(2, dtype=torch.bool, shape=(*size, 1), device=self.device)
        self.observation_spec = specs.Composite({"observation": bounds["observation"]}, shape=size, device=self.device)
        self.action_spec = bounds["action"]
        self.reward_spec = specs.Unbounded(shape=(*size, 1), dtype=torch.float32, device=self.device)
        names = ("done", "terminated", "truncated")
        self.done_spec = specs.Composite({name: flag.clone() for name in names}, shape=size, device=self.device)

    def _reset(self, tensordict: Any = None, **kwargs: Any) -> Any:
        """Start episodes in the worlds of ``_reset``, or in all worlds."""
        asked = None if tensordict is None else tensordict.get("_reset", None)
        mask = None if asked is None else asked.reshape(-1).cpu().numpy()
        seed, self._seed = self._seed, None
        obs, _ = self.env.reset(seed=seed, options=None if mask is None else {"reset_mask": mask})
        never = np.zeros(self.env.num_envs, np.bool_)
        return self._dict(observation=obs, done=never, terminated=never, truncated=never)

    def _step(self, tensordict: Any) -> Any:
        """Advance all worlds by one control step; actions are clipped to their bounds."""
        action = tensordict.get("action").detach().cpu().numpy()
        obs, reward, terminated, truncated, self.infos = self.env.step(action)
        return self._dict(
            observation=obs,
            reward=reward,
            done=terminated | truncated,
            terminated=terminated,
            truncated=truncated,
        )

    def _set_seed(self, seed: int | None) -> None:
        """Set the seed ``seed + i`` of world i for the next reset."""
        self._seed = seed

    def close(self, *, raise_if_closed: bool = True) -> None:
        """End the simulation."""
        super().close(raise_if_closed=raise_if_closed)
        self.env.close()

    def _dict(self, **arrays: NDArray[Any]) -> Any:
        tensors = {name: self._tensor(array) for name, array in arrays.items()}
        # values with one number per world get a last axis of 1
        columns = {name: tensor if tensor.ndim > 1 else tensor[:, None] for name, tensor in tensors.items()}
        return tensordicts.TensorDict(columns, batch_size=self.batch_size, device=self.device)

    def _tensor(self, array: NDArray[Any]) -> Any:
        # `torch.tensor` copies, unlike `from_numpy`: rollouts keep these beyond the next step
        # policies are float32, also where observations are float64
        dtype = torch.float32 if array.dtype == np.float64 else None
        return torch.tensor(array, dtype=dtype, device=self.device)
