"""Fixtures of the tests against real libraries of reinforcement learning; `make test-rl` installs them."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from tightloop.env import VectorEnv
from tightloop.tasks.cartpole import CartPoleBalance


class Hasty(CartPoleBalance):
    """Episodes of both kinds within a few steps: some end by a fall, some by time; a success is a pole at rest."""

    max_episode_steps = 12
    start = 0.15

    def success(self, xp: Any, worlds: Any) -> Any:
        """The pole hardly turns."""
        return abs(worlds.joint_qd[:, 1]) < 0.3


@pytest.fixture(scope="session", autouse=True)
def root() -> Iterator[Path]:
    """A root folder for this run's daemons, which is empty again at the end."""
    folder = Path(tempfile.mkdtemp(prefix="tightloop-rl-"))
    os.environ["TIGHTLOOP_ROOT"] = str(folder)
    yield folder
    left = sorted(path.name for path in folder.iterdir())
    shutil.rmtree(folder)
    assert not left, f"the tests left {left} behind"


@pytest.fixture(autouse=True)
def one_thread() -> None:
    """Sums of torch in one order, so that two trainings may be compared bit for bit."""
    torch.set_num_threads(1)
    torch.manual_seed(0)


@pytest.fixture
def hasty() -> type[Hasty]:
    """A task with short episodes."""
    return Hasty


@pytest.fixture
def made() -> Iterator[Callable[[Any], Any]]:
    """Notes what is to be closed at the end of the test."""
    noted: list[Any] = []

    def note(env: Any) -> Any:
        noted.append(env)
        return env

    yield note
    for env in noted:
        env.close()


@pytest.fixture
def vector(made: Callable[[Any], Any]) -> Callable[..., VectorEnv]:
    """Makes a `VectorEnv` that is closed at the end of the test."""
    return lambda *args, **kwargs: made(VectorEnv(*args, **kwargs))


@pytest.fixture
def actions() -> Callable[[int, int, int], NDArray[np.float32]]:
    """Random actions, shape ``(steps, worlds, size)``, that make the pole of `Hasty` fall now and then."""

    def draw(steps: int, worlds: int, size: int) -> NDArray[np.float32]:
        pushes = np.random.default_rng(5).uniform(-1, 1, (steps, worlds, size))
        return np.sign(pushes).astype(np.float32) * (np.arange(worlds)[:, None] % 2 + 0.2).astype(np.float32).clip(0, 1)

    return draw
