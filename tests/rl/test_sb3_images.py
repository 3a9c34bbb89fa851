"""Stable-Baselines3 on observations that are dicts, and adapters that take none."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv

import tightloop as tl
from tightloop.adapters.environment import adapted_environment
from tightloop.adapters.sb3 import Sb3VecEnv
from tightloop.env import AutoresetMode, Env, Observed
from tightloop.errors import ArgumentError
from tightloop.tasks.cartpole import CartPoleBalance


class Watched(CartPoleBalance):
    """The cart pole, whose colours and depths are seen."""

    fields = (*CartPoleBalance.fields, "side_rgb", "side_depth")
    max_episode_steps = 6

    def scene(self) -> tl.Scene:
        scene = super().scene()
        scene.add_camera(pos=(0, -3, 0.3), target=(0, 0, 0.3), width=40, height=36, name="side")
        return scene

    def observed(self) -> Sequence[Observed]:
        images = Observed("rgb", 0, 255, shape=(36, 40, 3)), Observed("depth", 0, 5, shape=(36, 40))
        return [*super().observed(), *images]

    def observe(self, xp: Any, worlds: Any) -> Sequence[Any]:
        return (*super().observe(xp, worlds), worlds.side_rgb, worlds.side_depth)


def test_dicts_are_those_of_a_dummy_vec_env(made: Callable[[Any], Any], actions: Callable[..., Any]) -> None:
    ours = made(Sb3VecEnv(Watched, 3, dict_observations=True))
    theirs = made(DummyVecEnv([lambda: Env(Watched, dict_observations=True) for _ in range(3)]))
    for env in (ours, theirs):
        env.seed(7)
    seen, ends = [ours.reset(), theirs.reset()], 0
    for action in actions(15, 3, 1):
        for name in ("state", "rgb", "depth"):
            assert np.array_equal(seen[0][name], seen[1][name]) and seen[0][name].dtype == seen[1][name].dtype, name
        obs, _, _, infos = ours.step(action)
        obs_theirs, _, _, infos_theirs = theirs.step(action)
        seen = [obs, obs_theirs]
        for info, other in zip(infos, infos_theirs, strict=True):
            if "terminal_observation" in other:
                ends += 1
                for name, array in other["terminal_observation"].items():
                    assert np.array_equal(info["terminal_observation"][name], array), name
    assert ends >= 6


def test_a_policy_with_convolutions_learns(made: Callable[[Any], Any]) -> None:
    env = made(Sb3VecEnv(Watched, 4, dict_observations=True))
    model = PPO("MultiInputPolicy", env, n_steps=8, batch_size=16, n_epochs=1, device="cpu")
    kinds = {name: type(part).__name__ for name, part in model.policy.features_extractor.extractors.items()}
    assert kinds == {"rgb": "NatureCNN", "depth": "Flatten", "state": "Flatten"}
    model.learn(64)


def test_adapters_without_dicts_refuse_them() -> None:
    with pytest.raises(ArgumentError, match="dict_observations: this adapter takes observations that are one array"):
        adapted_environment(Watched, 2, AutoresetMode.SAME_STEP, {"dict_observations": True})
