"""torchrl: its own check, rollouts against the environment, a collector."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch
from tensordict import TensorDict
from torchrl.envs.utils import check_env_specs

import tightloop as tl
from tightloop.adapters.torchrl import TorchRlEnv


@pytest.mark.parametrize("task", ["CartPoleBalance", "FrankaReach"])
def test_check_env_specs_passes(task: str, made: Callable[[Any], Any]) -> None:
    check_env_specs(made(TorchRlEnv(task, 3)), seed=0)


def test_a_rollout_is_what_the_environment_does(
    hasty: Any, made: Callable[[Any], Any], vector: Callable[..., Any], actions: Callable[..., Any]
) -> None:
    worlds, steps = 5, 40
    script = actions(steps, worlds, 1)
    ours, plain = made(TorchRlEnv(hasty, worlds)), vector(hasty, worlds, autoreset_mode="DISABLED")
    ours.set_seed(4)
    turn = iter(script)

    def policy(observation: torch.Tensor) -> torch.Tensor:
        return torch.from_numpy(next(turn))

    found = ours.rollout(steps, policy, break_when_any_done=False)
    assert found.shape == (worlds, steps)
    obs, _ = plain.reset(seed=4)
    ended = 0
    infos: dict[str, Any] = {}
    for step, action in enumerate(script):
        now = found[:, step]
        assert np.array_equal(now["observation"].numpy(), obs)
        obs, reward, terminated, truncated, infos = plain.step(action)
        following = now["next"]
        assert np.array_equal(following["observation"].numpy(), obs)
        assert np.array_equal(following["reward"].numpy()[:, 0], reward)
        assert np.array_equal(following["terminated"].numpy()[:, 0], terminated)
        assert np.array_equal(following["truncated"].numpy()[:, 0], truncated)
        done = terminated | truncated
        assert np.array_equal(following["done"].numpy()[:, 0], done)
        ended += done.sum()
        if done.any():
            obs, _ = plain.reset(options={"reset_mask": done})
    assert ended > worlds
    assert np.array_equal(ours.infos["success"], infos["success"])


def test_a_rollout_over_the_ring_equals_one_over_copies(hasty: Any, vector: Callable[..., Any]) -> None:
    def rolled(*, copy: bool) -> Any:
        torch.manual_seed(1)
        env = TorchRlEnv(vector(hasty, 4, autoreset_mode="DISABLED", copy=copy))
        env.set_seed(2)
        return env.rollout(30, break_when_any_done=False)

    copies, ring = rolled(copy=True), rolled(copy=False)
    assert (copies == ring).all()


def test_a_reset_without_a_mask_is_of_all_worlds(hasty: Any, made: Callable[[Any], Any]) -> None:
    env = made(TorchRlEnv(hasty, 3))
    env.set_seed(1)
    first = env.reset()
    again = env.reset(TensorDict({}, batch_size=[3]))
    assert not torch.equal(first["observation"], again["observation"])
    assert not again["done"].any() and again["observation"].shape == (3, 5)


def test_another_autoreset_mode_is_refused(hasty: Any, vector: Callable[..., Any]) -> None:
    with pytest.raises(tl.ArgumentError, match="DISABLED"):
        TorchRlEnv(vector(hasty, 2))


def test_torch_has_one_thread_unless_set_otherwise(hasty: Any, made: Callable[[Any], Any]) -> None:
    for given, expected in (({}, 1), ({"torch_threads": 2}, 2), ({"torch_threads": None}, 3)):
        torch.set_num_threads(3)
        made(TorchRlEnv(hasty, 2, **given))
        assert torch.get_num_threads() == expected
    with pytest.raises(tl.ArgumentError, match="torch_threads is 0"):
        TorchRlEnv(hasty, 2, torch_threads=0)
