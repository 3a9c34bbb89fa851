"""RLlib: an iteration of its PPO over a vector entry point."""

from __future__ import annotations

import os
from collections.abc import Iterator
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
from ray.rllib.algorithms.ppo import PPOConfig

import tightloop as tl
from tightloop.adapters.rllib import make, register
from tightloop.env import AutoresetMode, Env, VectorEnv


@pytest.fixture(scope="module")
def cluster() -> Iterator[None]:
    """Ray on this machine."""
    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False, object_store_memory=80 * 1024**2)
    yield
    ray.shutdown()


def config(name: str, runners: int) -> Any:
    """A tiny PPO over 8 worlds a runner."""
    return (
        PPOConfig()
        .environment(name)
        .env_runners(
            num_env_runners=runners,
            num_envs_per_env_runner=8,
            gym_env_vectorize_mode="vector_entry_point",
            rollout_fragment_length=64,
        )
        .training(train_batch_size_per_learner=512 * max(runners, 1), minibatch_size=128, num_epochs=2)
        .debugging(seed=1)
    )


def test_an_iteration_of_ppo_in_this_process(cluster: None) -> None:
    algorithm = config(register("CartPoleBalance", threads=1), 0).build_algo()
    try:
        env = algorithm.env_runner.env.unwrapped
        assert isinstance(env, VectorEnv) and env.num_envs == 8 and env.autoreset_mode is AutoresetMode.NEXT_STEP
        result = algorithm.train()["env_runners"]
        assert result["num_env_steps_sampled"] >= 512
        # the pole falls at random actions, so that episodes have ended and were counted: 1 a step
        assert result["num_episodes"] > 0
        assert result["episode_return_mean"] == pytest.approx(result["episode_len_mean"])
    finally:
        algorithm.stop()


def test_episodes_are_those_of_single_environments(cluster: None) -> None:
    algorithm = config(register("CartPoleBalance", threads=1), 0).build_algo()
    try:
        episodes = algorithm.env_runner.sample(num_episodes=12, random_actions=True)
    finally:
        algorithm.stop()
    single = Env("CartPoleBalance")
    try:
        # what RLlib keeps, longer than a ring would, is what its actions lead to from its first observation
        first = {}
        for seed in range(64):
            obs, _ = single.reset(seed=seed)
            first[obs.tobytes()] = seed
        known = [episode for episode in episodes if np.asarray(episode.get_observations(0)).tobytes() in first]
        assert known
        for episode in known:
            obs = np.asarray(episode.get_observations())
            single.reset(seed=first[obs[0].tobytes()])
            for action, following in zip(episode.get_actions(), obs[1:], strict=True):
                assert np.array_equal(single.step(action)[0], following)
    finally:
        single.close()


def test_runners_in_other_processes_have_worlds_of_their_own(cluster: None) -> None:
    algorithm = config(register("CartPoleBalance", threads=1), 1).build_algo()
    try:
        assert algorithm.train()["env_runners"]["num_env_steps_sampled"] >= 512
    finally:
        algorithm.stop()


def test_without_a_number_there_is_one_world_and_what_is_not_to_be_chosen_is_refused(hasty: Any) -> None:
    env = make(hasty, {"threads": 1}, {})
    assert isinstance(env, Env)
    env.close()
    for options in ({"copy": False}, {"autoreset_mode": "SAME_STEP"}, {"num_envs": 4}):
        with pytest.raises(tl.ArgumentError, match="leave them out"):
            register(hasty, **options)
