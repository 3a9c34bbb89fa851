"""Environments over several shards, here in one process: they return what one environment does, also after a loss."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from typing import Any

import numpy as np
import pytest
from same_bits import assert_same_bits, assert_same_steps

import tightloop as tl
from tightloop.adapters.environment import adapted_environment
from tightloop.adapters.gathering import gather_infos, ranges, seeds_after_restart
from tightloop.adapters.shard import Shard
from tightloop.adapters.shards import Lost
from tightloop.adapters.spread import SpreadVectorEnv
from tightloop.env import AutoresetMode, Observed
from tightloop.tasks.cartpole import CartPoleBalance

#: Worlds, which three shards cannot share evenly.
WORLDS = 10


class LocalFleet:
    """Shards in this process, which tests break."""

    needs = "{'test': 1}"

    def __init__(self, count: int) -> None:
        self.shards: list[Any] = [None] * count
        self.starts_left = 1000

    def start(self, shard: int) -> None:
        self.stop(shard)
        if self.starts_left > 0:
            self.starts_left -= 1
            self.shards[shard] = Shard()

    def call(self, shard: int, method: str, *arguments: Any) -> Any:
        if self.shards[shard] is None:
            return Lost("a test ended it")
        answer = getattr(self.shards[shard], method)(*arguments)
        # what crosses processes is a copy
        return type(answer)(*map(_copied, answer)) if isinstance(answer, tuple) else _copied(answer)

    def answers(self, calls: Sequence[Any], timeout: float) -> list[Any]:
        return list(calls)

    def stop(self, shard: int) -> None:
        if self.shards[shard] is not None:
            self.shards[shard].close()
        self.shards[shard] = None

    def close(self) -> None:
        for shard in range(len(self.shards)):
            self.stop(shard)


def _copied(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _copied(part) for name, part in value.items()}
    return value.copy() if isinstance(value, np.ndarray) else value


@pytest.fixture
def spread() -> Iterator[Callable[..., tuple[SpreadVectorEnv, LocalFleet]]]:
    """Makes environments over three shards, and closes them."""
    made: list[SpreadVectorEnv] = []

    def make(task: Any, num_envs: int = WORLDS, **given: Any) -> tuple[SpreadVectorEnv, LocalFleet]:
        fleet = LocalFleet(3)
        defaults = {
            "autoreset_mode": "NEXT_STEP",
            "copy": True,
            "slots": 2,
            "max_episode_steps": None,
            "first_env": 0,
            "launch_timeout": 0.5,
            "step_timeout": 10.0,
            "env_options": {"threads": 1},
            "task_options": {},
        }
        made.append(SpreadVectorEnv(task, num_envs, 3, fleet, **(defaults | given)))
        return made[-1], fleet

    yield make
    for env in made:
        env.close()


def actions_of(env: Any, steps: int) -> Iterator[Any]:
    """Random actions, shape ``(worlds, actions)``, which exceed the bounds."""
    rng = np.random.default_rng(3)
    for _ in range(steps):
        yield rng.uniform(-2, 2, env.action_space.shape).astype(np.float32)


def test_ranges_are_contiguous_and_nearly_equal() -> None:
    assert ranges(10, 3) == [slice(0, 4), slice(4, 7), slice(7, 10)]
    assert ranges(3, 3) == [slice(0, 1), slice(1, 2), slice(2, 3)]
    assert ranges(5, 1) == [slice(0, 5)]


def test_seeds_after_a_restart_are_new_and_depend_on_those_before_alone() -> None:
    seeds = np.array([0, 1, 2**64 - 1], np.uint64)
    again = seeds_after_restart(seeds)
    assert again.dtype == np.uint64 and len({*seeds.tolist(), *again.tolist()}) == 6
    assert (seeds_after_restart(seeds[1:]) == again[1:]).all()


def test_infos_that_concern_one_shard_are_zero_and_unmarked_in_others() -> None:
    mask = np.array([True, False])
    some = {
        "fault": np.array([2, 0], np.uint32),
        "_fault": mask,
        "final_info": {"error": np.ones((2, 3)), "_error": mask},
    }
    gathered = gather_infos([(slice(0, 2), {}), (slice(2, 4), some)], 4)
    assert gathered["fault"].tolist() == [0, 0, 2, 0] and gathered["fault"].dtype == np.uint32
    assert gathered["_fault"].tolist() == [False, False, True, False]
    assert gathered["final_info"]["error"].shape == (4, 3) and not gathered["final_info"]["error"][:2].any()
    assert gather_infos([(slice(0, 2), {}), (slice(2, 4), {})], 4) == {}


@pytest.mark.parametrize("mode", ["NEXT_STEP", "SAME_STEP"])
@pytest.mark.parametrize("task", ["FrankaReach", "QuadrupedVelocityFlat", "CartPoleSwingUp"])
def test_shards_return_what_one_environment_does(task: str, mode: str, spread: Any, envs: Any) -> None:
    own, _ = spread(task, autoreset_mode=mode, max_episode_steps=40, first_env=5)
    one = envs(task, WORLDS, autoreset_mode=mode, max_episode_steps=40, first_env=5, threads=1)
    every, some = np.ones(WORLDS, np.bool_), np.arange(WORLDS) % 4 == 1
    some[7:] = False  # one shard has none of them
    assert own.single_observation_space == one.single_observation_space and own.control_dt == one.control_dt
    assert own.action_space == one.action_space and own.metadata["autoreset_mode"] is one.autoreset_mode
    assert_same_steps(own.reset(seed=2**40), one.reset(seed=2**40), every)
    for env in (own, one):
        env.elapsed = np.arange(WORLDS)
    for number, actions in enumerate(actions_of(one, 130)):
        if number == 60:
            assert_same_steps(own.reset(options={"reset_mask": some}), one.reset(options={"reset_mask": some}), every)
        if number == 90:
            assert_same_steps(own.reset(seed=list(range(WORLDS))), one.reset(seed=list(range(WORLDS))), every)
        assert_same_steps(own.step(actions), one.step(actions.astype(np.float64)), every)
        assert (own.elapsed == one.elapsed).all() and (own.level == one.level).all()
    assert own.restarts == 0


def test_levels_follow_the_task_and_the_options(spread: Any, envs: Any) -> None:
    level = np.arange(WORLDS) % 3
    own, fleet = spread("QuadrupedVelocityRough", max_episode_steps=5, autoreset_mode="SAME_STEP")
    one = envs("QuadrupedVelocityRough", WORLDS, max_episode_steps=5, autoreset_mode="SAME_STEP", threads=1)
    for env in (own, one):
        env.reset(seed=1, options={"level": level})
        assert (env.level == level).all()
        for actions in actions_of(env, 12):
            env.step(actions)
    assert (own.level == one.level).all()
    before = own.level
    fleet.stop(2)
    own.step(next(actions_of(own, 1)))
    assert (own.level[own.rows[2]] == before[own.rows[2]]).all(), "a restarted world keeps its level"


def pair(spread: Any, envs: Any, mode: str, steps: int) -> tuple[Any, LocalFleet, Any]:
    """Poles that stay up, in three shards and in one environment, just reset; world 6 ends first in its shard."""
    options = {"autoreset_mode": mode, "max_episode_steps": steps}
    own, fleet = spread("CartPoleBalance", **options)
    one = envs("CartPoleBalance", WORLDS, threads=1, **options)
    for env in (own, one):
        env.reset(seed=4)
        env.elapsed = np.arange(WORLDS)
    return own, fleet, one


def gentle(env: Any, steps: int) -> Iterator[Any]:
    """Actions that do not make a pole fall in a few steps."""
    return (np.clip(actions, -0.1, 0.1) for actions in actions_of(env, steps))


#: The worlds of the second shard.
LOST, OTHERS = slice(4, 7), np.array([True] * 4 + [False] * 3 + [True] * 3)
OWN = np.ones(3, np.bool_)


def replaced(envs: Any, own: Any, mode: str, steps: int) -> tuple[Any, Any]:
    """What the second shard should do after its restart, and its first observations."""
    env = envs("CartPoleBalance", 3, autoreset_mode=mode, max_episode_steps=steps, threads=1)
    return env, env.reset(seed=own.seeds[LOST].tolist())[0]


def lose(own: Any, fleet: LocalFleet, one: Any, actions: Any) -> tuple[Any, ...]:
    """A step in which the second shard is lost, and what is the same in every mode."""
    seeds = own.seeds
    fleet.stop(1)
    obs, reward, terminated, truncated, infos = mine = own.step(actions)
    for place, theirs in enumerate(one.step(actions)[:4]):
        assert_same_bits(f"result {place}", mine[place], theirs, OTHERS)
    assert infos["restarted"].tolist() == infos["_restarted"].tolist() == (~OTHERS).tolist()
    assert (own.seeds[LOST] == seeds_after_restart(seeds[LOST])).all() and (own.seeds == seeds)[OTHERS].all()
    assert not terminated[LOST].any() and not reward[LOST].any() and own.restarts == 1
    return obs, truncated, infos


def test_a_lost_shard_of_the_mode_same_step_begins_again_and_the_others_go_on(spread: Any, envs: Any) -> None:
    own, fleet, one = pair(spread, envs, "SAME_STEP", 13)
    moves = gentle(own, 60)
    before = [(own.step(actions), one.step(actions)) for actions in islice(moves, 7)]
    last = before[-1][0][0]
    obs, truncated, infos = lose(own, fleet, one, next(moves))
    again, first = replaced(envs, own, "SAME_STEP", 13)
    assert truncated[LOST].all()
    assert_same_bits("first observations", obs[LOST], first, OWN)
    assert_same_bits("last observations", infos["final_obs"], last, ~OTHERS)
    assert infos["_final_obs"][LOST].all()
    # metrics of an end that nobody saw are unmarked
    unmarked = [name for name in infos["final_info"] if name[0] == "_"]
    assert not any(infos["final_info"][name][LOST].any() for name in unmarked)
    for actions in moves:
        mine, theirs, instead = own.step(actions), one.step(actions), again.step(actions[LOST])
        for place in range(4):
            assert_same_bits(f"result {place}", mine[place], theirs[place], OTHERS)
            assert_same_bits(f"result {place}", mine[place][LOST], instead[place], OWN)
        assert "restarted" not in mine[4]


def test_a_lost_shard_of_the_mode_next_step_begins_again_and_the_others_go_on(spread: Any, envs: Any) -> None:
    own, fleet, one = pair(spread, envs, "NEXT_STEP", 13)
    moves = gentle(own, 60)
    before = [(own.step(actions), one.step(actions)) for actions in islice(moves, 7)]
    last, _, _, ended, _ = before[-1][0]
    assert ended[LOST].tolist() == [False, False, True]
    obs, truncated, _ = lose(own, fleet, one, next(moves))
    again, first = replaced(envs, own, "NEXT_STEP", 13)
    # world 6 begins its episode in this step anyway, and the others of the shard in the next step
    cut = ~ended[LOST]
    assert (truncated[LOST] == cut).all()
    assert_same_bits("last observations", obs[LOST], last[LOST], cut)
    assert_same_bits("first observations", obs[LOST], first, ~cut)
    own_next, _, ended, late, _ = own.step(actions := next(moves))
    one.step(actions)
    again.step(actions[LOST])
    second, _ = again.reset(options={"reset_mask": cut})
    assert_same_bits("second observations", own_next[LOST], second, OWN)
    assert not (ended | late)[LOST].any()
    for actions in moves:
        mine, theirs, instead = own.step(actions), one.step(actions), again.step(actions[LOST])
        for place in range(4):
            assert_same_bits(f"result {place}", mine[place], theirs[place], OTHERS)
            assert_same_bits(f"result {place}", mine[place][LOST], instead[place], OWN)


def test_a_lost_shard_without_autoreset_waits_for_a_reset(spread: Any, envs: Any) -> None:
    own, fleet, one = pair(spread, envs, "DISABLED", 100)
    moves = gentle(own, 10)
    last, *_ = own.step(actions := next(moves))
    one.step(actions)
    obs, truncated, _ = lose(own, fleet, one, next(moves))
    assert truncated[LOST].all()
    assert_same_bits("last observations", obs, last, ~OTHERS)
    with pytest.raises(tl.CommandRefused, match="environment 4 has ended; call reset"):
        own.step(next(moves))
    begun, _ = own.reset(options={"reset_mask": ~OTHERS})
    assert_same_bits("others", begun, obs, OTHERS)
    mine, theirs = (env.step(actions) for env in (own, one))
    assert_same_bits("others", mine[0], theirs[0], OTHERS)


class Seeing(CartPoleBalance):
    """A task whose critic sees the state."""

    def privileged_observed(self) -> Any:
        """One part."""
        return [Observed("state", -np.inf, np.inf, 2)]

    def privileged_observe(self, xp: Any, worlds: Any) -> Any:
        """Positions."""
        return (worlds.joint_q,)


def test_privileged_observations_of_a_lost_shard_are_the_last_ones(spread: Any) -> None:
    for mode in ("SAME_STEP", "NEXT_STEP"):
        own, fleet = spread(Seeing, 3, autoreset_mode=mode)
        own.reset(seed=0)
        moves = actions_of(own, 3)
        last = own.step(next(moves))[4]["privileged"].copy()
        fleet.stop(1)
        infos = own.step(next(moves))[4]
        end = infos["final_info"] if mode == "SAME_STEP" else infos
        assert end["_privileged"][1] and end["privileged"][1].tobytes() == last[1].tobytes()
        assert infos["_privileged"].all() and infos["privileged"].shape == last.shape
        own.step(next(moves))


def test_a_reset_starts_lost_shards_again(spread: Any, envs: Any) -> None:
    own, fleet, one = pair(spread, envs, "NEXT_STEP", 50)
    fleet.stop(1)
    mine, theirs = own.reset(seed=9), one.reset(seed=9)
    assert_same_bits("observations", mine[0], theirs[0], np.ones(WORLDS, np.bool_))
    assert mine[1]["restarted"].tolist() == (~OTHERS).tolist() and own.restarts == 1
    fleet.stop(1)
    some = np.zeros(WORLDS, np.bool_)
    some[[0, 5]] = True
    mine, theirs = (env.reset(seed=list(range(WORLDS)), options={"reset_mask": some}) for env in (own, one))
    assert_same_bits("observations", mine[0], theirs[0], OTHERS | some)
    assert mine[1]["restarted"].tolist() == (~OTHERS).tolist()
    for actions in gentle(own, 5):
        assert_same_bits("observations", own.step(actions)[0], one.step(actions)[0], OTHERS | some)


def test_a_shard_that_cannot_start_is_an_error_with_a_cure_and_a_reset_tries_again(spread: Any) -> None:
    own, fleet = spread("CartPoleBalance")
    own.reset(seed=0)
    fleet.stop(2)
    fleet.starts_left = 0
    actions = np.zeros((WORLDS, 1))
    with pytest.raises(tl.LaunchError, match=r"worlds 7 to 9: no process .* 0\.5 s .*needs \{'test': 1\}: add a node"):
        own.step(actions)
    with pytest.raises(tl.CommandRefused, match="the last step or reset failed; call reset first"):
        own.step(actions)
    fleet.starts_left = 1
    own.reset(seed=0)
    own.step(actions)


def test_a_node_that_refuses_the_environment_is_an_error_and_a_reset_tries_again(
    spread: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    own, fleet = spread("CartPoleBalance")
    own.reset(seed=0)
    fleet.stop(1)
    with monkeypatch.context() as patched:
        patched.setattr(Shard, "open", lambda *_: tl.ResourceError("no shared memory; make room"))
        with pytest.raises(tl.ResourceError, match=r"no shared memory; make room .of worlds 4 to 6"):
            own.step(np.zeros((WORLDS, 1)))
    own.reset(seed=0)
    assert "restarted" not in own.step(np.zeros((WORLDS, 1)))[4]


class Broken(CartPoleBalance):
    """A task whose reward is no number in steep worlds."""

    def reward(self, xp: Any, worlds: Any) -> Any:
        """NaN after three steps."""
        return xp.where(worlds.elapsed < 3, 1.0, xp.nan)


def test_errors_of_a_shard_name_its_worlds(spread: Any) -> None:
    own, _ = spread(Broken)
    own.reset(seed=0)
    own.elapsed = [0] * 7 + [2] * 3
    with pytest.raises(tl.ArgumentError, match=r"reward is nan in world 0 .*of worlds 7 to 9, which this"):
        own.step(np.zeros((WORLDS, 1)))
    with pytest.raises(tl.CommandRefused, match="call reset first"):
        own.send(np.zeros((WORLDS, 1)))
    own.reset()


def test_calls_in_the_wrong_order_and_wrong_arguments_are_refused(spread: Any) -> None:
    own, _ = spread("CartPoleBalance")
    actions = np.zeros((WORLDS, 1))
    with pytest.raises(tl.CommandRefused, match="no episode has begun"):
        own.send(actions)
    with pytest.raises(tl.ArgumentError, match="first reset is of all environments"):
        own.reset(options={"reset_mask": np.arange(WORLDS) == 1})
    own.reset()
    for wrong in (np.zeros((3, 1)), [["a"]] * WORLDS):
        with pytest.raises(tl.ArgumentError, match=r"actions: expected real numbers of shape \(10, 1\)"):
            own.send(wrong)
    for wrong in ("a", [1, 2], -1):
        with pytest.raises(tl.ArgumentError, match="seed"):
            own.reset(seed=wrong)
    with pytest.raises(tl.ArgumentError, match="elapsed"):
        own.elapsed = [1, 2]
    with pytest.raises(tl.CommandRefused, match="recv: no step"):
        own.recv()
    own.send(actions)
    for call in (lambda: own.send(actions), own.reset, lambda: own.elapsed):
        with pytest.raises(tl.CommandRefused, match="a step is on its way; call recv first"):
            call()
    own.recv()
    with pytest.raises(tl.SignatureError, match="frobnicate"):
        spread("CartPoleBalance", task_options={"frobnicate": 1})
    for name, value in (("slots", 1), ("copy", "no"), ("launch_timeout", 0.0), ("autoreset_mode", "SOON")):
        with pytest.raises(tl.ArgumentError, match=name):
            spread("CartPoleBalance", **{name: value})
    own.close()
    with pytest.raises(tl.SimClosed, match="the environment was closed"):
        own.step(actions)


def test_adapters_take_it_and_views_are_those_of_a_ring(spread: Any) -> None:
    own, _ = spread("CartPoleBalance", autoreset_mode="SAME_STEP", copy=False)
    assert adapted_environment(own, None, AutoresetMode.SAME_STEP, {}) is own
    with pytest.raises(tl.ArgumentError, match="this library expects NEXT_STEP"):
        adapted_environment(own, None, AutoresetMode.NEXT_STEP, {})
    own.reset(seed=0)
    actions = np.zeros((WORLDS, 1))
    seen = [own.step(actions)[0] for _ in range(3)]
    assert np.shares_memory(seen[0], seen[2]) and not np.shares_memory(seen[0], seen[1])


@pytest.mark.parametrize("shard", [0, 1])
def test_a_shard_that_starts_again_with_another_version_is_refused(
    spread: Any, monkeypatch: pytest.MonkeyPatch, shard: int
) -> None:
    own, fleet = spread("CartPoleBalance")
    own.reset(seed=0)
    opened = Shard.open
    monkeypatch.setattr(Shard, "open", lambda *given: opened(*given)._replace(version="0.0.9"))
    fleet.stop(shard)
    with pytest.raises(tl.LaunchError, match=r"has tightloop 0\.0\.9 .* install the same tightloop"):
        own.reset(seed=0)


@pytest.mark.parametrize("at", ["call", "answers"])
def test_an_interrupted_step_is_dropped_by_a_reset(
    spread: Any, envs: Any, monkeypatch: pytest.MonkeyPatch, at: str
) -> None:
    own, fleet, one = pair(spread, envs, "NEXT_STEP", 50)
    actions = np.zeros((WORLDS, 1))
    usual, calls = getattr(fleet, at), 0

    def interrupted(*given: Any) -> Any:
        nonlocal calls
        calls += 1
        if calls == (2 if at == "call" else 1):  # between two shards
            raise KeyboardInterrupt
        return usual(*given)

    monkeypatch.setattr(fleet, at, interrupted)
    with pytest.raises(KeyboardInterrupt):
        own.step(actions)
    if at == "call":
        with pytest.raises(tl.CommandRefused, match="the last step or reset failed; call reset first"):
            own.step(actions)
    mine, theirs = own.reset(seed=9), one.reset(seed=9)
    assert_same_bits("observations", mine[0], theirs[0], np.ones(WORLDS, np.bool_))
    assert_same_steps(own.step(actions), one.step(actions), np.ones(WORLDS, np.bool_))
