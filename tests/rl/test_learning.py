"""The parts of ``examples/learning`` that `ppo.py` learns with: symmetric networks and advantages."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from tightloop.env.mirror import MirrorColumns

sys.path.insert(0, str(Path(__file__).parents[2] / "examples"))
from learning.agent import Agent, Halves
from learning.rollout import Rollout

#: Values that swap, stay, or turn their sign.
OBS = MirrorColumns.of("obs", ([1, 0, 2, 3, 5, 4, 6], [1, 1, 1, -1, -1, -1, -1]), 7)
CRITIC = MirrorColumns.of("critic", ([1, 0, 2], [-1, -1, 1]), 3)
ACTION = MirrorColumns.of("action", ([1, 0, 2], [1, 1, -1]), 3)


def agent(mirrors: Any) -> Agent:
    made = Agent(7, 3, 3, 16, 0.5, mirrors=mirrors)
    torch.manual_seed(0)
    for weight in made.parameters():
        weight.data.normal_()
    made.see(torch.randn(100, 7) + 1.0, 2.0 * torch.randn(100, 3) - 1.0)
    return made


def test_a_mirrored_observation_gives_the_mirrored_action_and_the_same_value() -> None:
    own, obs, critic_obs = agent((OBS, ACTION, CRITIC)), torch.randn(50, 7), torch.randn(50, 3)
    flip, flip_action, flip_critic = (Halves(columns).flip for columns in (OBS, ACTION, CRITIC))
    action, value = own(obs), own.value(critic_obs)
    assert action.std() > 0.1 and value.std() > 0.1, "they depend on what is seen"
    # sums of 16 products of about 1 and more, rounded
    torch.testing.assert_close(own(flip(obs)), flip_action(action), rtol=1e-5, atol=1e-4)
    torch.testing.assert_close(own.value(flip_critic(critic_obs)), value, rtol=1e-5, atol=1e-4)


def test_a_symmetric_agent_is_one_of_plain_layers() -> None:
    own, obs, critic_obs = agent((OBS, ACTION, CRITIC)), torch.randn(50, 7), torch.randn(50, 3)
    plain = own.plain()
    assert plain.halves is None and [*plain.actor[::2]]
    torch.testing.assert_close(plain(obs), own(obs), rtol=1e-5, atol=1e-4)
    torch.testing.assert_close(plain.value(critic_obs), own.value(critic_obs), rtol=1e-5, atol=1e-4)
    assert agent(None).plain().halves is None


@dataclass
class Sizes:
    num_envs: int = 5
    steps: int = 7
    gamma: float = 0.9
    lam: float = 0.8


def test_advantages_are_sums_of_later_errors_up_to_the_end_of_the_episode() -> None:
    """As written: Σ (γλ)ᵏ δ(t+k), with the value of the last observation of an episode that was cut off."""
    size = Sizes()
    rollout, rng = Rollout(size, 2, 1, None, torch.device("cpu")), np.random.default_rng(0)
    reward, value = rng.normal(size=(7, 5)), rng.normal(size=(8, 5))
    done = rng.random((7, 5)) < 0.2
    done[3, 1] = True
    rollout.reward, rollout.done = torch.from_numpy(reward).float(), torch.from_numpy(done).float()
    rollout.cuts = [(3, torch.tensor([1]), torch.zeros(1, 2))]
    expected = np.zeros((7, 5))
    for world in range(5):
        for begin in range(7):
            weight = 1.0
            for step in range(begin, 7):
                following = 0.0 if done[step, world] else value[step + 1, world]
                if (step, world) == (3, 1):
                    following = 0.5
                error = reward[step, world] + 0.9 * following - value[step, world]
                expected[begin, world] += weight * error
                weight *= 0.9 * 0.8
                if done[step, world]:
                    break
    advantage, target = rollout.look_back(torch.from_numpy(value).float(), [torch.tensor([0.5])])
    np.testing.assert_allclose(advantage, expected, atol=1e-5)
    np.testing.assert_allclose(target, expected + value[:-1], atol=1e-5)
