"""Results of a task's functions that are no numbers, names of metrics, and options of a reset."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest

import tightloop as tl
from tightloop.env import Env, JointTorque, VectorEnv
from tightloop.tasks.cartpole import CartPoleBalance

WORLDS = 4


class Undefined(CartPoleBalance):
    """NaN in world 2 from the third step on, in one of the functions."""

    where = "reward"

    def reward(self, xp, worlds):
        return self.spoiled("reward", super().reward(xp, worlds), worlds)

    def observe(self, xp, worlds):
        first, *others = super().observe(xp, worlds)
        return (self.spoiled("observe", first, worlds), *others)

    def spoiled(self, name, values, worlds):
        spoiled = np.array(values)
        if self.where == name:
            spoiled[2] = np.where(worlds.elapsed[2] >= 3, np.nan, spoiled[2])
        return spoiled


class SpoiledReward(Undefined):
    where = "reward"


class SpoiledObservation(Undefined):
    where = "observe"


@pytest.mark.parametrize(
    ("task", "named"),
    [
        (SpoiledReward, r"SpoiledReward\.reward is nan in world 2; .*on_nan"),
        (SpoiledObservation, r"SpoiledObservation\.observe: `.+` is NaN in world 2; "),
    ],
)
@pytest.mark.parametrize("mode", ["NEXT_STEP", "SAME_STEP", "DISABLED"])
def test_nan_is_refused_by_function_and_world(task, named, mode):
    envs = VectorEnv(task, WORLDS, autoreset_mode=mode)
    try:
        envs.reset(seed=1)
        actions = np.zeros((WORLDS, 1))
        envs.step(actions)
        envs.step(actions)
        with pytest.raises(tl.ArgumentError, match=named):
            envs.step(actions)
        with pytest.raises(tl.CommandRefused, match="the last step or reset failed; call reset first"):
            envs.step(actions)
        with pytest.raises(tl.ArgumentError, match="the first reset is of all environments"):
            envs.reset(options={"reset_mask": np.arange(WORLDS) == 2})
        envs.reset(seed=1)
        envs.step(actions)
    finally:
        envs.close()


@pytest.mark.parametrize("task", [SpoiledReward, SpoiledObservation])
@pytest.mark.parametrize("mode", ["NEXT_STEP", "SAME_STEP", "DISABLED"])
def test_nan_ends_its_episode_by_choice(task, mode):
    envs = VectorEnv(task, WORLDS, autoreset_mode=mode, on_nan="fault")
    try:
        envs.reset(seed=1)
        actions = np.zeros((WORLDS, 1))
        for _ in range(2):
            _, _, terminated, _, infos = envs.step(actions)
            assert not terminated.any() and "fault" not in infos
        obs, reward, terminated, _, infos = envs.step(actions)
        assert terminated.tolist() == [False, False, True, False]
        where = infos["final_info"] if mode == "SAME_STEP" else infos
        assert where["fault"].tolist() == [0, 0, 16, 0] and where["_fault"].tolist() == [False, False, True, False]
        assert np.isfinite(obs).all() and np.isfinite(reward).all()
        last = infos["final_obs"] if mode == "SAME_STEP" else obs
        assert reward[2] == 0 and not last[2].any(), "the whole observation, and a reward that is finite"
        assert reward[1] != 0 and last[1].any() == (mode != "SAME_STEP")
        if mode == "SAME_STEP":
            assert np.isfinite(infos["final_obs"]).all() and envs.elapsed[2] == 0
        if mode == "NEXT_STEP":
            _, _, terminated, _, infos = envs.step(actions)
            assert not terminated[2] and envs.elapsed[2] == 0
    finally:
        envs.close()


class SpoiledStart(CartPoleBalance):
    """NaN in a part of the first observation of each episode of world 1."""

    def observe(self, xp, worlds):
        first, *others = super().observe(xp, worlds)
        spoiled = np.array(first)
        spoiled[1] = np.where(worlds.elapsed[1] == 0, np.nan, spoiled[1])
        return (spoiled, *others)


def test_nan_in_a_first_observation_is_refused():
    envs = VectorEnv(SpoiledStart, WORLDS)
    try:
        with pytest.raises(tl.ArgumentError, match=r"SpoiledStart\.observe: `.+` is NaN in world 1; "):
            envs.reset(seed=1)
        with pytest.raises(tl.CommandRefused, match="the last step or reset failed; call reset first"):
            envs.step(np.zeros((WORLDS, 1)))
    finally:
        envs.close()


@pytest.mark.parametrize("mode", ["NEXT_STEP", "SAME_STEP", "DISABLED"])
def test_nan_in_a_first_observation_ends_its_episode_at_its_first_step(mode):
    envs = VectorEnv(SpoiledStart, WORLDS, autoreset_mode=mode, on_nan="fault")
    alone = np.arange(WORLDS) == 1
    actions = np.zeros((WORLDS, 1))
    try:
        obs, _ = envs.reset(seed=1)
        assert not obs[1].any() and obs[0].any()
        for _ in range(2):
            obs, reward, terminated, _, infos = envs.step(actions)
            where = infos["final_info"] if mode == "SAME_STEP" else infos
            assert terminated.tolist() == alone.tolist() and where["fault"].tolist() == (16 * alone).tolist()
            assert reward[1] == 0 and not obs[1].any() and reward[0] != 0
            if mode == "NEXT_STEP":
                obs, _, terminated, _, infos = envs.step(actions)
                assert not terminated.any() and not obs[1].any()
            if mode == "DISABLED":
                obs, _ = envs.reset(options={"reset_mask": alone})
                assert not obs[1].any() and obs[0].any()
    finally:
        envs.close()


def test_infinite_rewards_are_refused():
    class Endless(CartPoleBalance):
        def reward(self, xp, worlds):
            return xp.where(worlds.elapsed > 1, np.inf, 0.0) + 0.0 * worlds.joint_q[:, 0]

    envs = VectorEnv(Endless, WORLDS)
    try:
        envs.reset(seed=1)
        envs.step(np.zeros((WORLDS, 1)))
        with pytest.raises(tl.ArgumentError, match=r"Endless\.reward is inf in world 0 \(and 3 more\)"):
            envs.step(np.zeros((WORLDS, 1)))
    finally:
        envs.close()


@pytest.mark.parametrize("name", ["success", "fault", "final_obs", "episode", "_upright", 3])
def test_names_of_metrics_that_are_taken_are_refused(name):
    class Named(CartPoleBalance):
        def metrics(self, xp, worlds):
            return {name: worlds.joint_q[:, 0]}

    envs = VectorEnv(Named, WORLDS)
    try:
        envs.reset(seed=1)
        with pytest.raises(tl.ArgumentError, match=r"Named\.metrics: .*"):
            envs.step(np.zeros((WORLDS, 1)))
    finally:
        envs.close()


def test_options_of_a_reset_that_do_not_exist_are_refused():
    envs = VectorEnv("CartPoleBalance", WORLDS)
    try:
        envs.reset(seed=1, options={})
        before = envs.step(np.ones((WORLDS, 1)))[0]
        with pytest.raises(tl.ArgumentError, match=r"reset: options has 'mask', which is unknown; .*reset_mask"):
            envs.reset(options={"mask": np.array([True, False, False, False])})
        assert (envs.elapsed == 1).all() and before.any(), "no world was reset"
    finally:
        envs.close()
    env = Env("CartPoleBalance")
    try:
        env.reset(options={})
        with pytest.raises(tl.ArgumentError, match="options has 'start', which is unknown"):
            env.reset(options={"start": 1})
    finally:
        env.close()


@pytest.mark.parametrize(
    ("given", "named"),
    [
        (lambda: JointTorque(["cartpole/slider"], 1.0), "got JointTorque; return a list of controls"),
        (lambda: [JointTorque], "return controls, such as"),
        (lambda: [None], "got None in the list"),
    ],
)
def test_controls_that_are_no_list_of_controls_are_refused(given, named):
    class Lone(CartPoleBalance):
        def controls(self):
            return given()

    with pytest.raises(tl.ArgumentError, match=rf"Lone\.controls: .*{named}"):
        VectorEnv(Lone, 1)


def test_gymnasium_passes_on_what_nan_does():
    env = gymnasium.make("tightloop/CartPoleBalance-v0", on_nan="fault")
    env.close()
