"""Libraries on a vector environment over Ray actors: each takes it as it is."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

# no report of use leaves the machine, and no package is sent to workers of the same one
os.environ |= {
    "RAY_USAGE_STATS_ENABLED": "0",
    "RAY_ENABLE_UV_RUN_RUNTIME_ENV": "0",
    "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0",
}

import ray
import torch
from ray.rllib.algorithms.ppo import PPOConfig
from ray.tune.registry import register_env
from rsl_rl.runners import OnPolicyRunner
from stable_baselines3 import PPO

from tightloop.adapters.ray import RayVectorEnv
from tightloop.adapters.rsl_rl import GROUP, RslRlVecEnv
from tightloop.adapters.sb3 import Sb3VecEnv
from tightloop.adapters.skrl import SkrlEnv
from tightloop.adapters.torchrl import TorchRlEnv
from tightloop.env import VectorEnv

WORLDS = 8


@pytest.fixture(scope="module", autouse=True)
def cluster() -> Iterator[None]:
    """Ray on this machine."""
    ray.init(
        address="local", num_cpus=4, include_dashboard=False, log_to_driver=False, object_store_memory=80 * 1024**2
    )
    yield
    ray.shutdown()


@pytest.fixture
def both(made: Callable[[Any], Any]) -> Iterator[Any]:
    """The same worlds on two actors, and in one daemon."""
    options: dict[str, Any] = {"autoreset_mode": "SAME_STEP", "max_episode_steps": 20, "copy": False}
    yield [
        made(RayVectorEnv("CartPoleBalance", WORLDS, actors=2, **options)),
        made(VectorEnv("CartPoleBalance", WORLDS, threads=1, **options)),
    ]


def test_stable_baselines3_learns_the_same_weights(both: Any) -> None:
    weights = []
    for env in both:
        model = PPO("MlpPolicy", Sb3VecEnv(env), n_steps=32, batch_size=64, seed=0, device="cpu")
        model.learn(1024)
        weights.append([value.numpy() for value in model.policy.state_dict().values()])
    assert all(np.array_equal(ours, theirs) for ours, theirs in zip(*weights, strict=True))


def test_rsl_rl_learns_the_same_weights(both: Any, tmp_path: Any) -> None:
    model = {"class_name": "MLPModel", "hidden_dims": [32, 32], "obs_normalization": True}
    weights = []
    for env in both:
        torch.manual_seed(0)
        env.reset(seed=0)
        configuration = {
            "num_steps_per_env": 32,
            "save_interval": 1000,
            "obs_groups": {"actor": [GROUP], "critic": [GROUP]},
            "actor": model | {"distribution_cfg": {"class_name": "GaussianDistribution", "init_std": 1.0}},
            "critic": dict(model),
            "algorithm": {"class_name": "PPO", "num_learning_epochs": 2, "num_mini_batches": 2, "entropy_coef": 0.0},
        }
        adapted = RslRlVecEnv(env)
        adapted.reset(seed=0)
        runner = OnPolicyRunner(adapted, configuration, log_dir=None, device="cpu")
        runner.learn(3, init_at_random_ep_len=True)
        weights.append([value.numpy().copy() for value in runner.alg.actor.state_dict().values()])
    assert all(np.array_equal(ours, theirs) for ours, theirs in zip(*weights, strict=True))


def test_skrl_and_torchrl_step_it(made: Callable[[Any], Any]) -> None:
    ours = made(SkrlEnv(RayVectorEnv("CartPoleBalance", WORLDS, actors=2)))
    ours.reset()
    obs, reward, *_ = ours.step(torch.zeros(WORLDS, 1))
    assert obs.shape == (WORLDS, 5) and (reward == 1.0).all()
    options: dict[str, Any] = {"autoreset_mode": "DISABLED", "max_episode_steps": 5}
    theirs = made(TorchRlEnv(RayVectorEnv("CartPoleBalance", WORLDS, actors=2, **options)))
    rollout = theirs.rollout(12, break_when_any_done=False)
    assert rollout["next", "truncated"].sum(1).eq(2).all()


def test_an_iteration_of_rllib_on_two_actors() -> None:
    register_env("tightloop-on-ray", lambda context: RayVectorEnv("CartPoleBalance", context["num_envs"], actors=2))
    config = (
        PPOConfig()
        .environment("tightloop-on-ray")
        .env_runners(
            num_env_runners=0,
            num_envs_per_env_runner=WORLDS,
            gym_env_vectorize_mode="vector_entry_point",
            rollout_fragment_length=64,
        )
        .training(train_batch_size_per_learner=512, minibatch_size=128, num_epochs=2)
        .debugging(seed=1)
    )
    algorithm = config.build_algo()
    try:
        env = algorithm.env_runner.env.unwrapped
        assert isinstance(env, RayVectorEnv) and len(env.rows) == 2
        result = algorithm.train()["env_runners"]
        # the pole falls at random actions, so that episodes have ended and were counted: 1 a step
        assert result["num_env_steps_sampled"] >= 512 and result["num_episodes"] > 0
        assert result["episode_return_mean"] == pytest.approx(result["episode_len_mean"])
    finally:
        algorithm.stop()
        env.close()
