"""Environments in a daemon of their own: trainers come and go, the worlds stay. And groups, and a step on its way."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

import tightloop as tl
from tightloop.env import VectorEnv, make_groups

# A trainer: says what it saw first, and steps until it is killed
TRAINER = """
import sys, numpy as np
from tightloop.env import VectorEnv, make_groups
env = VectorEnv("FrankaReach", daemon=sys.argv[1])
obs, _ = env.reset(seed=5)
print(env.num_envs, obs.tobytes().hex(), flush=True)
while True:
    env.step(np.ones((env.num_envs, 7)))
"""


@pytest.fixture
def serve(unique: Callable[[], str]) -> Iterator[Any]:
    """Starts ``python -m tightloop.env serve``, and returns the daemon's name."""
    started: list[subprocess.Popen[str]] = []

    def start(task: str, *arguments: str) -> str:
        name = unique()
        command = [sys.executable, "-m", "tightloop.env", "serve", task, "--name", name, *arguments]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        started.append(process)
        assert process.stdout is not None
        assert "ready" in process.stdout.readline()
        return name

    yield start
    for process in started:
        process.send_signal(signal.SIGTERM)
        assert process.wait(20) == 0


def test_a_trainer_that_is_killed_comes_back_to_the_running_daemon(serve: Any) -> None:
    name = serve("FrankaReach", "--num-envs", "8")
    seen = []
    for _ in range(3):
        trainer = subprocess.Popen([sys.executable, "-c", TRAINER, name], stdout=subprocess.PIPE, text=True)
        assert trainer.stdout is not None
        seen.append(trainer.stdout.readline())
        trainer.kill()
        trainer.wait()
    worlds, obs = seen[0].split()
    assert worlds == "8" and set(seen) == {seen[0]}
    env = VectorEnv("FrankaReach", daemon=name)
    assert env.reset(seed=5)[0].tobytes().hex() == obs
    pid = env.sim.pid
    env.close()
    other = VectorEnv("FrankaReach", 8, daemon=name)
    assert other.sim.pid == pid
    other.close()


def test_a_joined_daemon_does_what_a_launched_one_does(serve: Any) -> None:
    name = serve("FrankaReach", "--num-envs", "3", "--option", "control=joint_delta")
    joined = VectorEnv("FrankaReach", daemon=name, control="joint_delta")
    own = VectorEnv("FrankaReach", 3, control="joint_delta")
    for each in (joined, own):
        each.reset(seed=2)
    for action in np.random.default_rng(0).uniform(-1, 1, (130, 3, 7)):
        for mine, other in zip(joined.step(action)[:4], own.step(action)[:4], strict=True):
            np.testing.assert_array_equal(mine, other)
    joined.close()
    own.close()


def test_a_daemon_of_something_else_is_refused_by_name(serve: Any) -> None:
    name = serve("FrankaReach", "--num-envs", "2")
    with pytest.raises(tl.ArgumentError, match=f"`{name}` runs another scene"):
        VectorEnv("CartPoleBalance", daemon=name)
    with pytest.raises(tl.ArgumentError, match="does not show site_inverse_jacobian"):
        VectorEnv("FrankaReach", daemon=name, control="end_effector_delta")
    with pytest.raises(tl.ArgumentError, match="num_envs is 7"):
        VectorEnv("FrankaReach", 7, daemon=name)
    with pytest.raises(tl.UnknownDaemon):
        VectorEnv("FrankaReach", daemon=f"{name}-not")
    # none of these keeps it
    env = VectorEnv("FrankaReach", daemon=name)
    env.reset(seed=0)
    with pytest.raises(tl.LeaseHeld):
        VectorEnv("FrankaReach", daemon=name).reset(seed=0)
    env.close()


def test_misuse_of_serve_is_reported(unique: Callable[[], str]) -> None:
    for arguments, said in (
        (["serve", "FrankaDance", "--name", "a"], "FrankaReach"),
        (["serve", "FrankaReach"], "--name"),
        (["serve", "FrankaReach", "--name", unique(), "--option", "control=wings"], "joint_delta"),
    ):
        done = subprocess.run(
            [sys.executable, "-m", "tightloop.env", *arguments], capture_output=True, text=True, check=False
        )
        assert done.returncode == 2
        assert said in done.stderr and "Traceback" not in done.stderr


def test_two_groups_do_what_one_does() -> None:
    """The policy works on one group while the other steps: the same numbers as one environment of all worlds."""
    whole = VectorEnv("FrankaReach", 10)
    groups = make_groups("FrankaReach", 10)
    rows = [slice(0, 5), slice(5, 10)]
    seen = whole.reset(seed=3)[0]
    np.testing.assert_array_equal(seen, np.concatenate([group.reset(seed=3)[0] for group in groups]))

    def policy(obs: Any) -> Any:
        return np.tanh(obs[:, :7] * 3 + obs[:, 18:19])

    for group, own in zip(groups, rows, strict=True):
        group.send(policy(seen[own]))
    for _ in range(125):
        obs, reward = whole.step(policy(seen))[:2]
        for group, own in zip(groups, rows, strict=True):
            mine = group.recv()
            np.testing.assert_array_equal(mine[0], obs[own])
            np.testing.assert_array_equal(mine[1], reward[own])
            group.send(policy(mine[0]))
        seen = obs
    for env in (whole, *groups):
        env.close()


def test_groups_that_are_not_even_are_refused() -> None:
    for count, said in ((3, "evenly"), (11, "evenly"), (0, "at least 1")):
        with pytest.raises(tl.ArgumentError, match=said):
            make_groups("FrankaReach", 10, count)
    with pytest.raises(tl.ArgumentError, match="first_env is not taken"):
        make_groups("FrankaReach", 10, first_env=5)


def test_the_daemon_that_is_killed_is_reported() -> None:
    env = VectorEnv("FrankaReach", 2)
    env.reset(seed=0)
    os.kill(env.sim.pid, signal.SIGKILL)
    with pytest.raises(tl.DaemonLost):
        for _ in range(100):
            env.step(np.zeros((2, 7)))
    env.close()


def test_a_trainer_that_draws_needs_a_daemon_that_shows_bodies(serve: Any) -> None:
    with pytest.raises(tl.ArgumentError, match="--render"):
        VectorEnv("CartPoleBalance", daemon=serve("CartPoleBalance"), render_mode="rgb_array")
    envs = VectorEnv("CartPoleBalance", daemon=serve("CartPoleBalance", "--render"), render_mode="rgb_array")
    envs.reset(seed=0)
    assert len(envs.render() or ()) == envs.num_envs == 1
    envs.close()
