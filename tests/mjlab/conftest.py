"""Fixtures of the tests against mjlab; `make test-mjlab` installs it."""

from __future__ import annotations

import os

# mjlab's tasks choose a GPU where torch sees one, and Warp compiles its kernels for it
os.environ["CUDA_VISIBLE_DEVICES"] = ""

import shutil
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import torch
from both_sides import environment, motion_file

from tightloop.adapters.mjlab.simulation import Simulation


@pytest.fixture(scope="session", autouse=True)
def root() -> Iterator[Path]:
    """A root folder for this run's daemons, which is empty again at the end."""
    folder = Path(tempfile.mkdtemp(prefix="tightloop-mjlab-"))
    os.environ["TIGHTLOOP_ROOT"] = str(folder)
    yield folder
    left = sorted(path.name for path in folder.iterdir())
    shutil.rmtree(folder)
    assert not left, f"the tests left {left} behind"


@pytest.fixture(autouse=True)
def one_thread() -> None:
    """Sums of torch in one order, so that two runs may be compared bit for bit."""
    torch.set_num_threads(1)


@pytest.fixture(scope="session")
def motion(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A motion for the tracking tasks: the G1 stands and moves its arms."""
    return motion_file(tmp_path_factory.mktemp("motion") / "arms.npz")


@pytest.fixture
def made() -> Iterator[Callable[[Any], Any]]:
    """Notes simulations and environments that are closed at the end of the test."""
    noted: list[Any] = []

    def note(item: Any) -> Any:
        noted.append(item)
        return item

    yield note
    for item in noted:
        simulation = getattr(item, "sim", item)
        if isinstance(simulation, Simulation):
            simulation.close()


@pytest.fixture
def env_of(made: Callable[[Any], Any], motion: Path) -> Callable[..., Any]:
    """Makes an environment of a task, closed at the end of the test; see `both_sides.environment`."""
    return lambda *args, **kwargs: made(environment(*args, motion=motion, **kwargs))
