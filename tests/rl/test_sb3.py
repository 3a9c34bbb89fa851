"""Stable-Baselines3: its own checks, its own `DummyVecEnv` as the oracle, training."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.env_checker import check_env
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor, VecNormalize

import tightloop as tl
from tightloop.adapters.sb3 import Sb3VecEnv
from tightloop.env import Env

PAGE = Path(__file__).parents[2] / "docs/pages/use/rl-libraries.md"


@pytest.mark.parametrize("task", ["CartPoleBalance", "CartPoleSwingUp", "FrankaReach"])
def test_check_env_passes(task: str, made: Callable[[Any], Any]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # Reach's actions go to ±4, as its definition has them
        warnings.filterwarnings("ignore", "We recommend you to use a symmetric and normalized Box action space")
        check_env(made(Env(task)))


def test_it_does_what_a_dummy_vec_env_of_single_environments_does(
    hasty: Any, made: Callable[[Any], Any], actions: Callable[..., Any]
) -> None:
    worlds = 4
    ours = made(Sb3VecEnv(hasty, worlds))
    theirs = made(DummyVecEnv([lambda: Env(hasty) for _ in range(worlds)]))
    for env in (ours, theirs):
        env.seed(7)
    assert np.array_equal(ours.reset(), theirs.reset())
    ends = {True: 0, False: 0}
    for action in actions(60, worlds, 1):
        obs, reward, done, infos = ours.step(action)
        obs_theirs, reward_theirs, done_theirs, infos_theirs = theirs.step(action)
        assert np.array_equal(obs, obs_theirs) and np.array_equal(reward, reward_theirs)
        assert np.array_equal(done, done_theirs)
        for own, other in zip(infos, infos_theirs, strict=True):
            assert ("terminal_observation" in own) == ("terminal_observation" in other)
            if "terminal_observation" in own:
                assert np.array_equal(own["terminal_observation"], other["terminal_observation"])
                assert own["TimeLimit.truncated"] == other["TimeLimit.truncated"]
                assert own["is_success"] == bool(other["success"])
                ends[own["TimeLimit.truncated"]] += 1
    # both kinds of ends were there
    assert min(ends.values()) > 0


def test_arrays_belong_to_the_caller(hasty: Any, made: Callable[[Any], Any], actions: Callable[..., Any]) -> None:
    env = made(Sb3VecEnv(hasty, 8))
    handed = [(env.reset(),)]
    kept = [tuple(array.copy() for array in handed[0])]
    for action in actions(5, 8, 1):
        obs, reward, done, _ = env.step(action)
        reward += 1.0  # SB3 adds the value of last observations to rewards in place
        handed.append((obs, reward, done))
        kept.append(tuple(array.copy() for array in handed[-1]))
    assert all(
        np.array_equal(x, y) for now, then in zip(handed, kept, strict=True) for x, y in zip(now, then, strict=True)
    )


def test_training_over_the_ring_equals_training_on_copies(hasty: Any, vector: Callable[..., Any]) -> None:
    def trained(*, copy: bool) -> torch.Tensor:
        env = Sb3VecEnv(vector(hasty, 16, autoreset_mode="SAME_STEP", copy=copy))
        model = PPO("MlpPolicy", VecNormalize(env), n_steps=16, batch_size=64, n_epochs=2, seed=3, device="cpu")
        before = torch.nn.utils.parameters_to_vector(model.policy.parameters()).clone()
        after = torch.nn.utils.parameters_to_vector(model.learn(16 * 16 * 4).policy.parameters())
        assert not torch.equal(before, after)
        return after.detach()

    assert torch.equal(trained(copy=True), trained(copy=False))


def test_ppo_learns_to_balance(made: Callable[[Any], Any]) -> None:
    env = VecMonitor(made(Sb3VecEnv("CartPoleBalance", 64)))
    model = PPO("MlpPolicy", env, n_steps=64, batch_size=1024, learning_rate=2e-3, seed=0, device="cpu")
    judge = made(Monitor(Env("CartPoleBalance")))
    before, _ = evaluate_policy(model, judge, 10)
    model.learn(64 * 64 * 12)
    after, _ = evaluate_policy(model, judge, 10)
    # an untrained policy lets the pole fall within three of the ten seconds
    assert before < 150 and after > 400, f"mean length of an episode {before:.0f} before, {after:.0f} after"


def test_attributes_and_methods_are_those_of_the_environment(hasty: Any, made: Callable[[Any], Any]) -> None:
    env = made(Sb3VecEnv(hasty, 3))
    assert env.get_attr("max_episode_steps") == [12, 12, 12]
    assert env.get_attr("control_dt", indices=[0, 2]) == [pytest.approx(0.02)] * 2
    assert env.env_method("__str__", indices=[1]) == [str(env.env)]
    assert env.env_is_wrapped(Monitor) == [False] * 3 and env.env_is_wrapped(Monitor, indices=1) == [False]
    env.set_attr("note", "seen")
    assert env.get_attr("note", indices=1) == ["seen"]
    with pytest.raises(tl.ArgumentError, match="indices"):
        env.set_attr("note", "heard", indices=[1])
    assert not env.has_attr("nothing_like_it")


def test_a_seed_holds_for_one_reset(hasty: Any, made: Callable[[Any], Any]) -> None:
    env = made(Sb3VecEnv(hasty, 3))
    env.seed(11)
    first, second = env.reset(), env.reset()
    env.seed(11)
    assert np.array_equal(env.reset(), first) and not np.array_equal(first, second)


def test_options_of_a_reset_are_refused_once(hasty: Any, made: Callable[[Any], Any]) -> None:
    env = made(Sb3VecEnv(hasty, 2))
    env.set_options({"colour": "red"})
    with pytest.raises(tl.ArgumentError, match="set_options"):
        env.reset()
    assert env.reset().shape == (2, 5)


def test_another_autoreset_mode_is_refused(hasty: Any, vector: Callable[..., Any]) -> None:
    with pytest.raises(tl.ArgumentError, match="SAME_STEP"):
        Sb3VecEnv(vector(hasty, 2))


def test_torch_has_one_thread_unless_set_otherwise(hasty: Any, made: Callable[[Any], Any]) -> None:
    for given, expected in (({}, 1), ({"torch_threads": 2}, 2), ({"torch_threads": None}, 3)):
        torch.set_num_threads(3)
        made(Sb3VecEnv(hasty, 2, **given))
        assert torch.get_num_threads() == expected
    with pytest.raises(tl.ArgumentError, match="torch_threads is 0"):
        Sb3VecEnv(hasty, 2, torch_threads=0)


def test_the_block_of_the_page_trains_and_saves(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (block,) = re.findall(r'^```python title="needs stable-baselines3"\n(.*?)^```$', PAGE.read_text(), re.M | re.S)
    # two rollouts instead of all
    code, replaced = re.subn(r"model\.learn\([\d_]+\)", "model.learn(2 * 512 * 24)", block)
    assert replaced == 1
    monkeypatch.chdir(tmp_path)
    torch.set_num_threads(2)
    exec(code, {})
    assert torch.get_num_threads() == 1
    assert PPO.load("reach.zip", device="cpu").num_timesteps == 2 * 512 * 24
    assert (tmp_path / "reach.pkl").stat().st_size > 1000
