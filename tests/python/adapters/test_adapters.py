"""What adapters have in common, for which none of their libraries is needed; the others are in tests/rl."""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Iterator
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

import tightloop as tl
from tightloop.adapters.environment import adapted_environment, library, set_torch_threads
from tightloop.env import AutoresetMode, VectorEnv


@pytest.fixture(scope="module")
def env() -> Iterator[VectorEnv]:
    """Two worlds of mode ``NEXT_STEP``."""
    made = VectorEnv("FrankaReach", 2)
    yield made
    made.close()


def test_a_missing_library_is_named_with_its_cure():
    with pytest.raises(tl.MissingLibrary, match=r"no module `no_such_library`: pip install 'no-such\[all\]'") as told:
        library("no_such_library.inside", install="no-such[all]")
    assert isinstance(told.value, ImportError)


def test_what_a_library_itself_misses_is_its_own_to_tell(tmp_path, monkeypatch):
    (tmp_path / "half_a_library.py").write_text("import what_it_forgot")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ModuleNotFoundError, match="what_it_forgot") as told:
        library("half_a_library", install="half-a-library")
    assert not isinstance(told.value, tl.TightloopError)


def test_tightloop_imports_no_library_of_reinforcement_learning():
    heavy = {"torch", "stable_baselines3", "rsl_rl", "skrl", "torchrl", "ray"}
    code = f"import sys, tightloop.env, tightloop.adapters; print({heavy} & set(sys.modules))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "set()\n"


def test_threads_of_torch_are_set_only_where_it_computes_on_the_cpu():
    told: list[int] = []
    torch = SimpleNamespace(
        device=lambda name: SimpleNamespace(type=str(name).partition(":")[0]), set_num_threads=told.append
    )
    set_torch_threads(torch, 1)
    set_torch_threads(torch, 3, "cpu:0")
    set_torch_threads(torch, None)
    set_torch_threads(torch, 1, "cuda:0")
    assert told == [1, 3]
    for wrong in (0, 1.5):
        with pytest.raises(tl.ArgumentError, match="torch_threads"):
            set_torch_threads(torch, wrong)  # type: ignore[arg-type]
    assert told == [1, 3]


def test_an_environment_is_taken_as_it_is_or_refused(env):
    assert adapted_environment(env, None, AutoresetMode.NEXT_STEP, {}) is env
    with pytest.raises(tl.ArgumentError, match=r"NEXT_STEP, .* expects SAME_STEP; .*autoreset_mode='SAME_STEP'"):
        adapted_environment(env, None, AutoresetMode.SAME_STEP, {})
    with pytest.raises(tl.ArgumentError, match="num_envs, threads: the environment given has its own"):
        adapted_environment(env, 4, AutoresetMode.NEXT_STEP, {"threads": 1})
    with pytest.raises(tl.ArgumentError, match="the adapter chooses them"):
        adapted_environment("FrankaReach", 4, AutoresetMode.NEXT_STEP, {"copy": True})


def test_a_task_becomes_an_environment_of_the_mode_asked_for():
    made = adapted_environment("CartPoleBalance", 3, AutoresetMode.DISABLED, {"max_episode_steps": math.inf})
    try:
        assert made.num_envs == 3 and made.autoreset_mode is AutoresetMode.DISABLED and made.max_episode_steps is None
    finally:
        made.close()


def test_elapsed_steps_may_be_set_and_goals_follow(env):
    env.reset(seed=0)
    still = np.zeros((2, 7))
    goals = [env.step(still)[0][:, 18:25].copy()]
    # the second goal is due after 120 steps, the third after 240
    env.elapsed = [118, 245]
    assert list(env.elapsed) == [118, 245]
    goals += [env.step(still)[0][:, 18:25].copy() for _ in range(4)]
    changed = np.array([(now != then).any(1) for then, now in pairwise(goals)])
    assert changed[:, 0].tolist() == [False, True, False, False]
    assert changed[:, 1].tolist() == [True, True, False, False]
    env.elapsed = [358, 10]
    *_, truncated, _ = env.step(still)
    assert truncated.tolist() == [False, False]
    *_, truncated, _ = env.step(still)
    assert truncated.tolist() == [True, False]
