"""skrl: its trainer's PPO over the wrapped environment."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from skrl.agents.torch.ppo import PPO, PPO_CFG
from skrl.envs.wrappers.torch import Wrapper
from skrl.memories.torch import RandomMemory
from skrl.models.torch import DeterministicMixin, GaussianMixin, Model
from skrl.trainers.torch import SequentialTrainer, SequentialTrainerCfg
from skrl.utils import set_seed
from torch import nn

import tightloop as tl
from tightloop.adapters.skrl import SkrlEnv


class Policy(GaussianMixin, Model):
    """A small actor."""

    def __init__(self, env: Any) -> None:
        Model.__init__(self, observation_space=env.observation_space, action_space=env.action_space, device=env.device)
        GaussianMixin.__init__(self)
        self.net = nn.Sequential(nn.Linear(self.num_observations, 32), nn.Tanh(), nn.Linear(32, self.num_actions))
        self.log_std = nn.Parameter(torch.zeros(self.num_actions))

    def compute(self, inputs: dict[str, Any], role: str) -> Any:
        return self.net(inputs["observations"]), {"log_std": self.log_std}


class Value(DeterministicMixin, Model):
    """A small critic."""

    def __init__(self, env: Any) -> None:
        Model.__init__(self, observation_space=env.observation_space, action_space=env.action_space, device=env.device)
        DeterministicMixin.__init__(self)
        self.net = nn.Sequential(nn.Linear(self.num_observations, 32), nn.Tanh(), nn.Linear(32, 1))

    def compute(self, inputs: dict[str, Any], role: str) -> Any:
        return self.net(inputs["observations"]), {}


def train(env: Any, folder: Path, updates: int) -> tuple[torch.Tensor, list[float]]:
    """The policy's weights after so many updates, and what part of the steps ended with a fall before each."""
    set_seed(0)
    models = {"policy": Policy(env), "value": Value(env)}
    memory = RandomMemory(memory_size=32, num_envs=env.num_envs, device=env.device)
    cfg = PPO_CFG(
        rollouts=32,
        learning_epochs=5,
        mini_batches=4,
        time_limit_bootstrap=True,
        experiment={"directory": str(folder), "write_interval": 0, "checkpoint_interval": 0},
    )
    agent = PPO(
        models=models,
        memory=memory,
        cfg=cfg,
        observation_space=env.observation_space,
        action_space=env.action_space,
        device=env.device,
    )
    falls: list[float] = []
    update = agent.update

    def noted(**options: Any) -> None:
        falls.append(memory.get_tensor_by_name("terminated").float().mean().item())
        update(**options)

    agent.update = noted
    # `headless` is left out on purpose: the trainer then asks for a picture in every step
    trainer = SequentialTrainerCfg(timesteps=32 * updates, disable_progressbar=True, close_environment_at_exit=False)
    SequentialTrainer(env=env, agents=agent, cfg=trainer).train()
    return nn.utils.parameters_to_vector(models["policy"].parameters()).detach(), falls


def test_ppo_learns_to_balance_the_same_over_ring_and_copies(vector: Callable[..., Any], tmp_path: Path) -> None:
    def trained(*, copy: bool) -> tuple[torch.Tensor, list[float]]:
        return train(SkrlEnv(vector("CartPoleBalance", 64, copy=copy)), tmp_path, updates=30)

    (weights, falls), (weights_ring, falls_ring) = trained(copy=True), trained(copy=False)
    assert torch.equal(weights, weights_ring) and falls == falls_ring
    assert falls[-1] < 0.5 * falls[0], falls


def test_steps_are_those_of_the_environment(
    hasty: Any, made: Callable[[Any], Any], vector: Callable[..., Any], actions: Callable[..., Any]
) -> None:
    set_seed(3)
    ours, plain = made(SkrlEnv(hasty, 4)), vector(hasty, 4)
    assert isinstance(ours, Wrapper) and ours.num_envs == 4 and ours.observation_space == plain.single_observation_space
    obs, _ = ours.reset()
    assert np.array_equal(obs.numpy(), plain.reset(seed=3)[0])
    for action in actions(40, 4, 1):
        step, expected = ours.step(torch.from_numpy(action)), plain.step(action)
        for mine, other in zip(step[:4], expected[:4], strict=True):
            assert np.array_equal(mine.numpy().squeeze(), other.squeeze())
    assert ours.render() is None


def test_another_autoreset_mode_is_refused(hasty: Any, vector: Callable[..., Any]) -> None:
    with pytest.raises(tl.ArgumentError, match="NEXT_STEP"):
        SkrlEnv(vector(hasty, 2, autoreset_mode="SAME_STEP"))


def test_torch_has_one_thread_unless_set_otherwise(hasty: Any, made: Callable[[Any], Any]) -> None:
    for given, expected in (({}, 1), ({"torch_threads": 2}, 2), ({"torch_threads": None}, 3)):
        torch.set_num_threads(3)
        made(SkrlEnv(hasty, 2, **given))
        assert torch.get_num_threads() == expected
    with pytest.raises(tl.ArgumentError, match="torch_threads is 0"):
        SkrlEnv(hasty, 2, torch_threads=0)
