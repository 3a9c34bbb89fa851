"""Environments: gymnasium's own checks, its own vector environment as the oracle, seeds, autoreset, copies."""

from __future__ import annotations

import warnings
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import SyncVectorEnv
from gymnasium.wrappers.vector import NormalizeObservation, RecordEpisodeStatistics

import tightloop as tl
from tightloop.env import AutoresetMode, Env, VectorEnv
from tightloop.env.registration import EPISODE_STEPS
from tightloop.env.registry import TASKS
from tightloop.tasks.cartpole import CartPoleBalance

MODES = list(AutoresetMode)


class Hasty(CartPoleBalance):
    """Episodes of all kinds: some end by a fall, some by time, and goals change on the way."""

    max_episode_steps = 12
    start = 0.2
    goal_draws = 2
    goal_steps = 5

    def goal(self, xp: Any, worlds: Any, draws: Any) -> Any:
        return draws + worlds.joint_q[:, :1]

    def observed(self) -> Any:
        from tightloop.env import Observed

        return [*super().observed(), Observed("goal", -2, 2, 2)]

    def observe(self, xp: Any, worlds: Any) -> Any:
        return *super().observe(xp, worlds), worlds.goal

    def success(self, xp: Any, worlds: Any) -> Any:
        return abs(worlds.joint_q[:, 1]) < 0.02


def actions(env: Any, steps: int, seed: int = 0) -> np.ndarray[Any, Any]:
    rng = np.random.default_rng(seed)
    shape = (steps, env.num_envs, *env.single_action_space.shape)  # pyright: ignore[reportOptionalIterable]
    return rng.uniform(-1, 1, shape).astype(np.float32)


@pytest.mark.parametrize("task", TASKS)
def test_check_env_passes(task: str) -> None:
    env = gymnasium.make(f"tightloop/{task}-v0")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # it recommends actions in [-1, 1], as an environment that has other ones knows
        warnings.filterwarnings("ignore", message=".*normalized space.*")
        check_env(env.unwrapped)
    env.close()


def test_registration_says_what_the_tasks_say() -> None:
    for name, steps in EPISODE_STEPS.items():
        env = gymnasium.make_vec(
            f"tightloop/{name}-v0", num_envs=2, device="auto", autoreset_mode=AutoresetMode.SAME_STEP
        )
        assert isinstance(env.unwrapped, VectorEnv)
        assert env.unwrapped.task.max_episode_steps == steps == env.unwrapped.max_episode_steps
        assert env.unwrapped.autoreset_mode is env.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
        assert env.spec is not None and env.spec.id == f"tightloop/{name}-v0"
        env.close()
    env = gymnasium.make_vec("tightloop/CartPoleBalance-v0", num_envs=2, max_episode_steps=7)
    assert isinstance(env.unwrapped, VectorEnv) and env.unwrapped.max_episode_steps == 7
    env.close()


@pytest.mark.parametrize("mode", MODES)
def test_agrees_with_gymnasiums_vector_of_single_environments(mode: AutoresetMode, envs: Any) -> None:
    count, steps = 5, 60
    ours = envs(Hasty, count, autoreset_mode=mode)
    theirs = SyncVectorEnv([lambda: Env(Hasty)] * count, autoreset_mode=mode)
    assert theirs.single_observation_space == ours.single_observation_space
    assert theirs.single_action_space == ours.single_action_space
    seeds: list[int | None] = [11, 3, 7, 7, 2**40]
    np.testing.assert_array_equal(ours.reset(seed=seeds)[0], theirs.reset(seed=seeds)[0])
    ended, falls, cuts = np.zeros(count, int), 0, 0
    for action in actions(ours, steps):
        own, other = ours.step(action), theirs.step(action)
        for mine, yours in zip(own[:4], other[:4], strict=True):
            np.testing.assert_array_equal(mine, np.asarray(yours, mine.dtype))
        same_infos(own[4], other[4])
        done = own[2] | own[3]
        ended += done
        falls, cuts = falls + own[2].sum(), cuts + own[3].sum()
        if mode is AutoresetMode.DISABLED and done.any():
            again, against = (env.reset(options={"reset_mask": done.copy()}) for env in (ours, theirs))
            np.testing.assert_array_equal(again[0], against[0])
    theirs.close()
    assert ended.min() >= 3
    assert falls and cuts, "episodes end in both ways"


def same_infos(mine: dict[str, Any], yours: dict[str, Any]) -> None:
    """Infos of the same rows are the same; gymnasium leaves out infos of no row."""
    told = {name for name in mine if name[0] != "_" and mine[f"_{name}"].any()}
    assert told == {name for name in yours if name[0] != "_"}
    for name in told:
        rows = mine[f"_{name}"]
        np.testing.assert_array_equal(rows, yours[f"_{name}"])
        if isinstance(mine[name], dict):
            same_infos(mine[name], yours[name])
        else:
            np.testing.assert_array_equal(mine[name][rows], np.stack(yours[name][rows]))


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_gymnasiums_wrappers_take_it(mode: AutoresetMode, envs: Any) -> None:
    env = RecordEpisodeStatistics(envs(Hasty, 6, autoreset_mode=mode))
    if mode is AutoresetMode.NEXT_STEP:  # the other modes it refuses
        env = NormalizeObservation(env)
    env.reset(seed=1)
    lengths = []
    for action in actions(env.unwrapped, 50):
        infos = env.step(action)[4]
        if "episode" in infos:
            lengths += [*infos["episode"]["l"][infos["_episode"]]]
    assert lengths and set(lengths) <= set(range(1, 13))


def test_a_world_is_a_function_of_its_seed(envs: Any) -> None:
    many, few = envs(Hasty, 9), envs(Hasty, 2)
    start = many.reset(seed=20)[0]
    np.testing.assert_array_equal(start, many.reset(seed=20)[0])
    np.testing.assert_array_equal(start[[4, 7]], few.reset(seed=[24, 27])[0])
    assert len(np.unique(start, axis=0)) == 9
    np.testing.assert_array_equal(*few.reset(seed=[5, 5])[0])
    # the next episode is another, and the same one again
    many.reset(seed=20)
    following = many.reset()[0]
    assert (following != start).any(axis=1).all()
    few.reset(seed=[24, 27])
    np.testing.assert_array_equal(following[[4, 7]], few.reset()[0])
    np.testing.assert_array_equal(many.reset(seed=np.arange(20, 29))[0], start)


def test_seeds_left_out_are_by_chance(envs: Any) -> None:
    env, other = envs(Hasty, 3), envs(Hasty, 3)
    first = env.reset()[0]
    assert (first != other.reset()[0]).any()
    assert len(np.unique(first, axis=0)) == 3
    mixed = env.reset(seed=[4, None, 4])[0]
    np.testing.assert_array_equal(mixed[0], mixed[2])
    assert (mixed[1] != mixed[0]).any()


def test_a_single_environment_is_the_world_of_that_seed(envs: Any) -> None:
    many, one = envs(Hasty, 4, autoreset_mode=AutoresetMode.SAME_STEP), Env(Hasty)
    start = many.reset(seed=8)[0]
    obs = one.reset(seed=10)[0]
    np.testing.assert_array_equal(obs, start[2])
    for action in actions(many, 30):
        all_obs, reward, terminated, truncated, infos = many.step(action)
        obs, own_reward, own_terminated, own_truncated, info = one.step(action[2])
        assert (own_reward, own_terminated, own_truncated) == (reward[2], terminated[2], truncated[2])
        assert type(own_reward) is float and type(own_terminated) is bool
        if own_terminated or own_truncated:
            np.testing.assert_array_equal(obs, infos["final_obs"][2])
            assert bool(info["success"]) == bool(infos["final_info"]["success"][2])
            obs = one.reset()[0]
        np.testing.assert_array_equal(obs, all_obs[2])
    one.close()


def test_reset_mask_touches_only_the_worlds_under_it(envs: Any) -> None:
    env, twin = envs(Hasty, 6, autoreset_mode="DISABLED"), envs(Hasty, 6, autoreset_mode="DISABLED")
    mask = np.array([True, False, False, True, False, True])
    options = {"reset_mask": mask}
    for each in (env, twin):
        each.reset(seed=0)
        before = each.step(np.full((6, 1), 0.3, np.float32))[0]
    obs, infos = env.reset(options=options)
    assert options["reset_mask"] is mask and infos == {}
    np.testing.assert_array_equal(obs[~mask], before[~mask])
    assert (obs[mask] != before[mask]).any(axis=1).all()
    own, other = (each.step(np.full((6, 1), -0.3, np.float32))[0] for each in (env, twin))
    np.testing.assert_array_equal(own[~mask], other[~mask])
    seeded = env.reset(seed=[9] * 6, options=options)[0]
    assert len(np.unique(seeded[mask], axis=0)) == 1
    np.testing.assert_array_equal(seeded[~mask], own[~mask])


@pytest.mark.parametrize(
    ("mask", "said"),
    [
        (np.zeros(3, bool), "no environment"),
        (np.ones(4, bool), "shape"),
        (np.ones(3), "bool"),
        ([True] * 3, "bool"),
    ],
)
def test_bad_masks_are_refused_by_name(mask: Any, said: str, envs: Any) -> None:
    env = envs(Hasty, 3)
    before = env.reset(seed=0)[0]
    with pytest.raises(tl.ArgumentError, match="reset_mask") as caught:
        env.reset(options={"reset_mask": mask})
    assert said in str(caught.value)
    np.testing.assert_array_equal(env.reset(seed=0)[0], before)


def test_copies_are_the_callers_own_and_equal_the_ring(envs: Any) -> None:
    """The aliasing regression: one reused buffer ruins training without an error."""
    for mode in MODES[:2]:
        own, ring = envs(Hasty, 16, autoreset_mode=mode), envs(Hasty, 16, autoreset_mode=mode, copy=False, slots=3)
        kept, views, before = [own.reset(seed=3)[0]], [ring.reset(seed=3)[0]], []
        for action in actions(own, 40):
            # copied when they come: what they are later is another matter
            before.append(views[-1].copy())
            mine, other = own.step(action), ring.step(action)
            np.testing.assert_array_equal(before[-1], kept[-1])
            kept.append(mine[0])
            views.append(other[0])
            for a, b in zip(mine[:4], other[:4], strict=True):
                np.testing.assert_array_equal(a, b)
            same_infos(mine[4], other[4])
            arrays = [array for array in (*mine[:4], mine[4].get("final_obs")) if array is not None]
            assert not any(np.shares_memory(array, past) for array in arrays for past in kept[:-1])
            assert all(array.flags.writeable for array in arrays)
        assert not any(np.shares_memory(a, b) for k, a in enumerate(kept) for b in kept[:k])
        # a ring of three: what came three steps ago lies where the newest does
        assert np.shares_memory(views[-1], views[-4])
        assert not any(np.shares_memory(views[-1], views[-k]) for k in (2, 3))
        assert all(view.ctypes.data % 64 == 0 for view in views)


def test_bounds_of_observations_are_true(envs: Any) -> None:
    for task in TASKS:
        env = envs(task, 32, autoreset_mode=AutoresetMode.SAME_STEP)
        assert env.reset(seed=0)[0] in env.observation_space
        for action in actions(env, 80):
            obs, reward = env.step(np.sign(action))[:2]
            assert obs in env.observation_space
            assert reward.dtype == np.float32 and np.isfinite(reward).all()


def test_actions_beyond_the_bounds_count_as_these(envs: Any) -> None:
    env, twin = envs("FrankaReach", 4), envs("FrankaReach", 4)
    limit = env.single_action_space.high
    for size, same in ((1000.0, True), (0.01, False)):
        for each, action in ((env, limit), (twin, size * limit)):
            each.reset(seed=0)
            seen = each.step(np.tile(action, (4, 1)))[0]
            assert (seen[:, 25:] == limit).all() == (same or each is env)
        alike = [each.step(np.zeros((4, 7)))[0] for each in (env, twin)]
        assert (alike[0] == alike[1]).all() == same


@pytest.mark.parametrize("mode", MODES[:2])
def test_a_world_whose_action_is_nan_fails_alone(mode: AutoresetMode, envs: Any) -> None:
    env, twin = envs("FrankaReach", 4, autoreset_mode=mode), envs("FrankaReach", 4, autoreset_mode=mode)
    for each in (env, twin):
        each.reset(seed=0)
    bad = np.zeros((4, 7), np.float32)
    bad[2, 3] = np.nan
    obs, reward, terminated, truncated, infos = env.step(bad)
    clean = twin.step(np.zeros((4, 7), np.float32))
    others = [0, 1, 3]
    np.testing.assert_array_equal(terminated, [False, False, True, False])
    told = infos["final_info"] if mode is AutoresetMode.SAME_STEP else infos
    assert told["fault"][2] & 1 and told["_fault"][2]
    assert np.isfinite(obs).all() and np.isfinite(reward).all() and not truncated.any()
    np.testing.assert_array_equal(obs[others], clean[0][others])
    # and it begins anew
    for _ in range(3):
        after, theirs = env.step(np.zeros((4, 7), np.float32)), twin.step(np.zeros((4, 7), np.float32))
        np.testing.assert_array_equal(after[0][others], theirs[0][others])
        assert np.isfinite(after[0]).all() and not after[2].any()


def test_misuse_is_refused_by_name(envs: Any) -> None:
    env = envs(Hasty, 2, autoreset_mode="DISABLED")
    with pytest.raises(tl.CommandRefused, match="call reset first"):
        env.step(np.zeros((2, 1)))
    with pytest.raises(tl.CommandRefused, match="call send first"):
        env.recv()
    env.reset(seed=0)
    for bad in (np.zeros((2, 2)), np.zeros(2), np.zeros((3, 1)), np.full((2, 1), "a"), [[0.0], [None]]):
        with pytest.raises(tl.ArgumentError, match="actions"):
            env.step(bad)
    env.send(np.zeros((2, 1)))
    for call in (env.reset, lambda: env.send(np.zeros((2, 1)))):
        with pytest.raises(tl.CommandRefused, match="call recv first"):
            call()
    env.recv()
    for seed in ("a", 1.5, [1], [1, -2], [True, 2]):
        with pytest.raises(tl.ArgumentError, match="seed"):
            env.reset(seed=seed)
    while not (done := np.logical_or(*env.step(np.ones((2, 1)))[2:4])).any():
        pass
    with pytest.raises(tl.CommandRefused, match="has ended"):
        env.step(np.zeros((2, 1)))
    env.reset(options={"reset_mask": done})
    env.step(np.zeros((2, 1)))
    env.close()
    with pytest.raises(tl.SimClosed):
        env.reset()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"task": "FrankaDance"}, "FrankaReach"),
        ({"task": int}, "Task"),
        ({"task": "FrankaReach", "control": "telepathy"}, "joint_delta"),
        ({"task": "FrankaReach", "colour": "red"}, "colour"),
        ({"task": Hasty, "autoreset_mode": "sometimes"}, "SAME_STEP"),
        ({"task": Hasty, "max_episode_steps": 0}, "max_episode_steps"),
        ({"task": Hasty, "slots": 1, "copy": False}, "slots"),
        ({"task": Hasty, "render_mode": "ansi"}, "rgb_array"),
        ({"task": Hasty, "device": "abacus"}, "abacus"),
    ],
)
def test_wrong_arguments_name_the_culprit(arguments: dict[str, Any], said: str) -> None:
    with pytest.raises(tl.TightloopError, match=said):
        VectorEnv(num_envs=2, **arguments)
