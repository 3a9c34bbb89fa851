"""Ctrl-C at any moment: the call ends, and the simulation or environment can be used again."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

import tightloop as tl

INTERRUPTS = 60


@pytest.fixture
def interrupt() -> Iterator[Callable[[Callable[[], Any]], None]]:
    """Repeats a call until a signal interrupts it, at a moment that differs each time."""
    draw = np.random.default_rng(1)
    # an alarm raises what Ctrl-C raises, and needs no second thread
    before = signal.signal(signal.SIGALRM, signal.default_int_handler)

    def repeat(call: Callable[[], Any]) -> None:
        signal.setitimer(signal.ITIMER_REAL, draw.uniform(0.001, 0.02))
        with pytest.raises(KeyboardInterrupt):
            while True:
                call()

    yield repeat
    signal.signal(signal.SIGALRM, before)


def test_a_simulation_steps_on(pendulum, interrupt):
    with tl.launch(pendulum, worlds=2) as sim:
        for _ in range(INTERRUPTS):
            interrupt(sim.step)
            before = sim.forward().step[0]
            assert sim.step().step[0] == before + 1


def test_a_simulation_steps_on_after_a_rollout(pendulum, interrupt):
    commands = {"joint_f": np.zeros((1000, 2, 2), np.float32)}
    with tl.launch(pendulum, worlds=2) as sim:
        for _ in range(INTERRUPTS):
            interrupt(lambda: sim.rollout(commands, fields=("joint_q",)))
            before = sim.forward().step[0]
            assert sim.step().step[0] == before + 1


def test_an_environment_is_reset_and_goes_on_as_a_new_one(envs, interrupt):
    actions = np.zeros((2, 1), np.float32)
    fresh, tried = envs("CartPoleBalance", 2), envs("CartPoleBalance", 2)
    first, _ = fresh.reset(seed=3)
    second, *_ = fresh.step(actions)
    tried.reset(seed=3)
    for _ in range(INTERRUPTS):
        interrupt(lambda: tried.step(actions))
        obs, _ = tried.reset(seed=3)
        assert obs.tobytes() == first.tobytes()
        assert tried.step(actions)[0].tobytes() == second.tobytes()


def test_an_environment_asks_for_what_is_missing(envs, interrupt):
    actions = np.zeros((2, 1), np.float32)
    tried = envs("CartPoleBalance", 2)
    tried.reset(seed=3)
    for _ in range(INTERRUPTS):
        interrupt(lambda: tried.step(actions))
        try:
            tried.step(actions)
        except tl.CommandRefused as error:
            # a mask of some worlds is not enough: the others went on unseen
            assert "recv or reset first" in str(error) or "call reset first" in str(error)
            with pytest.raises(tl.TightloopError, match="reset"):
                tried.reset(options={"reset_mask": np.array([True, False])})
            tried.reset(seed=3)
