"""skrl: many worlds as its wrapped environment.

>>> from skrl.trainers.torch import SequentialTrainer, SequentialTrainerCfg
>>> from tightloop.adapters.skrl import SkrlEnv
>>> env = SkrlEnv("FrankaReach", 256)
>>> SequentialTrainer(env=env, agents=agent, cfg=SequentialTrainerCfg(timesteps=10_000)).train()
"""

from __future__ import annotations

from typing import Any

from gymnasium.vector import AutoresetMode

from tightloop.adapters.needs import Given, environment, library

skrl = library("skrl", install="skrl")
gymnasium_envs = library("skrl.envs.wrappers.torch.gymnasium_envs", install="skrl")


class SkrlEnv(gymnasium_envs.GymnasiumWrapper):
    """skrl's wrapper of vectorized environments around a `VectorEnv`, in torch.

    Episodes go on in the next step, so that ``time_limit_bootstrap`` sees their last observation; the step in which a
    world is reset is a transition with reward 0, whose action has no effect.
    """

    def __init__(self, env: Given, num_envs: int | None = None, *, torch_device: str = "cpu", **options: Any) -> None:
        """An environment of mode ``NEXT_STEP``, or a task for one of its own.

        Args:
            env: A `VectorEnv`, or a task.
            num_envs: How many worlds, for a task.
            torch_device: Where torch's tensors go, such as ``"cuda:0"``; ``device`` is that of the physics.
            **options: What `VectorEnv` takes besides, for a task.

        Raises:
            ArgumentError: The environment has another autoreset mode.
        """
        # the wrapper copies all that it takes into tensors of its own
        super().__init__(environment(env, num_envs, AutoresetMode.NEXT_STEP, options))
        self._device = skrl.config.torch.parse_device(torch_device)

    def render(self, *args: Any, **kwargs: Any) -> Any:
        """As of the `VectorEnv`; nothing without a render mode, as trainers ask unless they are told ``headless``."""
        return None if self._env.render_mode is None else self._env.render()
