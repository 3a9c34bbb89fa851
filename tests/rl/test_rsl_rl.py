"""rsl_rl: its contract, and its runner's training."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch
from rsl_rl.env import VecEnv
from rsl_rl.runners import OnPolicyRunner

import tightloop as tl
from tightloop.adapters.rsl_rl import GROUP, RslRlVecEnv

MODEL = {"class_name": "MLPModel", "hidden_dims": [32, 32], "obs_normalization": True}


def configuration() -> dict[str, Any]:
    """A small PPO; rsl_rl writes into it."""
    return {
        "num_steps_per_env": 32,
        "save_interval": 1000,
        "obs_groups": {"actor": [GROUP], "critic": [GROUP]},
        "actor": MODEL | {"distribution_cfg": {"class_name": "GaussianDistribution", "init_std": 1.0}},
        "critic": dict(MODEL),
        "algorithm": {"class_name": "PPO", "num_learning_epochs": 5, "num_mini_batches": 4, "entropy_coef": 0.0},
    }


def test_steps_are_those_of_the_environment(
    hasty: Any, made: Callable[[Any], Any], vector: Callable[..., Any], actions: Callable[..., Any]
) -> None:
    worlds = 6
    ours, plain = made(RslRlVecEnv(hasty, worlds)), vector(hasty, worlds, autoreset_mode="SAME_STEP")
    assert isinstance(ours, VecEnv) and ours.num_envs == worlds and ours.num_actions == 1
    assert ours.max_episode_length == 12 and ours.cfg["task"] == "Hasty"
    obs, _ = ours.reset(seed=4)
    handed, expected = [obs[GROUP]], [plain.reset(seed=4)[0]]
    late = fallen = 0
    for action in actions(40, worlds, 1):
        obs, reward, done, extras = ours.step(torch.from_numpy(action))
        expected_obs, expected_reward, terminated, truncated, infos = plain.step(action)
        handed.append(obs[GROUP])
        expected.append(expected_obs)
        assert np.array_equal(reward.numpy(), expected_reward)
        assert np.array_equal(done.numpy(), (terminated | truncated).astype(int))
        assert np.array_equal(extras["time_outs"].numpy(), truncated & ~terminated)
        ended = terminated | truncated
        assert ("log" in extras) == ended.any()
        if ended.any():
            assert extras["log"]["/success"] == pytest.approx(infos["final_info"]["success"][ended].mean())
        assert np.array_equal(ours.episode_length_buf.numpy(), plain.elapsed)
        late, fallen = late + extras["time_outs"].sum().item(), fallen + terminated.sum()
    # of all steps at once: what was handed out first has not changed since
    assert all(np.array_equal(mine.numpy(), other) for mine, other in zip(handed, expected, strict=True))
    assert late > 0 and fallen > 0
    assert torch.equal(ours.get_observations()[GROUP], handed[-1])


def test_episodes_end_when_their_length_is_set(made: Callable[[Any], Any]) -> None:
    env = made(RslRlVecEnv("FrankaReach", 4, max_episode_steps=200))
    env.episode_length_buf = torch.tensor([0, 197, 198, 60])
    still = torch.zeros(4, 7)
    ends = torch.stack([env.step(still)[2] for _ in range(4)])
    assert ends.argmax(0).tolist() == [0, 2, 1, 0] and ends.sum(0).tolist() == [0, 1, 1, 0]
    assert env.episode_length_buf.tolist() == [4, 1, 2, 64]
    # the copy that was handed out is not the environment's
    env.episode_length_buf[:] = 0
    assert env.episode_length_buf.tolist() == [4, 1, 2, 64]


def test_the_runner_learns_to_balance_the_same_over_ring_and_copies(vector: Callable[..., Any]) -> None:
    def trained(*, copy: bool) -> tuple[torch.Tensor, list[float]]:
        torch.manual_seed(0)
        env = RslRlVecEnv(vector("CartPoleBalance", 64, autoreset_mode="SAME_STEP", copy=copy))
        env.reset(seed=0)
        runner = OnPolicyRunner(env, configuration())
        falls = []
        for iterations in (1, 12, 12):
            runner.learn(iterations)
            falls.append(runner.alg.storage.dones.float().mean().item())
        return torch.nn.utils.parameters_to_vector(runner.alg.actor.parameters()).detach(), falls

    (weights, falls), (weights_ring, falls_ring) = trained(copy=True), trained(copy=False)
    assert torch.equal(weights, weights_ring) and falls == falls_ring
    # poles fall less than half as often
    assert falls[-1] < 0.5 * falls[0], falls


def test_another_autoreset_mode_is_refused(hasty: Any, vector: Callable[..., Any]) -> None:
    with pytest.raises(tl.ArgumentError, match="SAME_STEP"):
        RslRlVecEnv(vector(hasty, 2))
    with pytest.raises(tl.ArgumentError, match="max_episode_steps"):
        RslRlVecEnv(vector(hasty, 2, autoreset_mode="SAME_STEP", max_episode_steps=float("inf")))


def test_torch_has_one_thread_unless_set_otherwise(hasty: Any, made: Callable[[Any], Any]) -> None:
    for given, expected in (({}, 1), ({"torch_threads": 2}, 2), ({"torch_threads": None}, 3)):
        torch.set_num_threads(3)
        made(RslRlVecEnv(hasty, 2, **given))
        assert torch.get_num_threads() == expected
    with pytest.raises(tl.ArgumentError, match="torch_threads is 0"):
        RslRlVecEnv(hasty, 2, torch_threads=0)


def test_torch_keeps_its_threads_where_it_computes_on_a_gpu(hasty: Any, made: Callable[[Any], Any]) -> None:
    torch.set_num_threads(3)
    # no tensor is made before the first reset, so no GPU is needed
    made(RslRlVecEnv(hasty, 2, torch_device="cuda:0"))
    assert torch.get_num_threads() == 3
