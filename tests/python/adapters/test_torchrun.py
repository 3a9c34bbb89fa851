"""Ranks of torchrun: shares of the worlds, which together are those of one environment. No test needs torch."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import pytest
from same_bits import assert_same_bits

import tightloop as tl
from tightloop.adapters.torchrun import Rank

SET = {"RANK": "1", "WORLD_SIZE": "3", "LOCAL_RANK": "0", "LOCAL_WORLD_SIZE": "1"}


def test_a_rank_is_read_from_what_torchrun_sets(monkeypatch: pytest.MonkeyPatch) -> None:
    assert Rank.of_process(SET) == Rank(rank=1, size=3, local_rank=0, local_size=1)
    for name, value in SET.items():
        monkeypatch.setenv(name, value)
    assert Rank.of_process() == Rank.of_process(SET)


def test_missing_and_wrong_variables_are_named() -> None:
    with pytest.raises(tl.ArgumentError, match=r"no environment variable RANK, WORLD_SIZE, .*torchrun --nproc-per"):
        Rank.of_process({"LOCAL_RANK": "0"})
    for wrong in ({"RANK": "one"}, {"RANK": "3"}, {"WORLD_SIZE": "0"}, {"LOCAL_RANK": "1"}, {"LOCAL_WORLD_SIZE": "-1"}):
        with pytest.raises(tl.ArgumentError, match=r"(?i)rank|size"):
            Rank.of_process(SET | wrong)
    with pytest.raises(tl.ArgumentError, match="num_envs is 2 for 3 ranks; give at least one world per rank"):
        Rank.of_process(SET).worlds(2)
    for name in ("daemon", "first_env"):
        with pytest.raises(tl.ArgumentError, match=f"{name} follows from the rank; leave it out"):
            Rank.of_process(SET).make_env("CartPoleBalance", 6, **{name: 1})


def test_ranks_share_all_worlds_and_do_what_one_environment_does(envs: Any) -> None:
    worlds, one = 7, envs("CartPoleSwingUp", 7, max_episode_steps=9)
    ranks = [Rank(rank, 3, rank, 3) for rank in range(3)]
    shares = [rank.worlds(worlds) for rank in ranks]
    assert [row for share in shares for row in range(share.start, share.stop)] == list(range(worlds))
    own = [rank.make_env("CartPoleSwingUp", worlds, max_episode_steps=9) for rank in ranks]
    try:
        assert [env.num_envs for env in own] == [3, 2, 2]
        cores = max(1, len(os.sched_getaffinity(0)) // 3)
        assert all(env.sim.info["threads"] <= cores for env in own)
        every = np.ones(worlds, np.bool_)
        started = np.concatenate([env.reset(seed=5)[0] for env in own])
        assert_same_bits("first observations", started, one.reset(seed=5)[0], every)
        rng = np.random.default_rng(0)
        for _ in range(30):
            actions = rng.uniform(-1, 1, (worlds, 1)).astype(np.float32)
            steps: list[Any] = [env.step(actions[share]) for env, share in zip(own, shares, strict=True)]
            for place, theirs in enumerate(one.step(actions)[:4]):
                mine = np.concatenate([step[place] for step in steps])
                assert_same_bits(f"result {place}", mine, theirs, every)
    finally:
        for env in own:
            env.close()
