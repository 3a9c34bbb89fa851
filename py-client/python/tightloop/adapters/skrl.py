"""Adapter to skrl: many worlds as its wrapped environment.

>>> from skrl.trainers.torch import SequentialTrainer, SequentialTrainerCfg
>>> from tightloop.adapters.skrl import SkrlEnv
>>> env = SkrlEnv("FrankaReach", 256)
>>> SequentialTrainer(env=env, agents=agent, cfg=SequentialTrainerCfg(timesteps=10_000)).train()
"""

from __future__ import annotations

from typing import Any

from gymnasium.vector import AutoresetMode

from tightloop.adapters.environment import Given, adapted_environment, library, set_torch_threads
from tightloop.checks.signatures import checked_calls

skrl = library("skrl", install="skrl")
gymnasium_envs = library("skrl.envs.wrappers.torch.gymnasium_envs", install="skrl")
torch = library("torch", install="torch")


@checked_calls
class SkrlEnv(gymnasium_envs.GymnasiumWrapper):
    """A `VectorEnv` in skrl's torch wrapper of vectorized environments.

    A world starts its next episode in the next step, so that ``time_limit_bootstrap`` sees the last observation. The
    step in which a world is reset is a transition with reward 0, whose action has no effect.
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
        """Adapt an environment of the mode ``NEXT_STEP``, or make one for a task.

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
        # the wrapper copies all arrays into its own tensors
        super().__init__(adapted_environment(env, num_envs, AutoresetMode.NEXT_STEP, options))
        self._device = skrl.config.torch.parse_device(torch_device)

    def render(self, *args: Any, **kwargs: Any) -> Any:
        """Render as the `VectorEnv` does; None without a render mode, since trainers call this unless ``headless``."""
        return None if self._env.render_mode is None else self._env.render()
