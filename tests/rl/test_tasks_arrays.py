"""The tasks' functions on arrays of torch and JAX are those on NumPy's, to rounding."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tightloop.env import VectorEnv, Worlds
from tightloop.env.registry import TASKS

sys.path[:0] = [str(Path(__file__).parents[1] / "python/tasks")]
from reference_tasks import any_worlds  # noqa: E402  (tests are no package)

WORLDS = 1024
# Libraries round square roots and hyperbolic tangents their own way, some ten times on the way
TOLERANCE = 10 * 2.0**-24


@pytest.fixture(params=["torch", "jax"])
def namespace(request: pytest.FixtureRequest) -> Any:
    """What NumPy is for its arrays, of another library."""
    pytest.importorskip(request.param)
    return import_module({"torch": "array_api_compat.torch", "jax": "jax.numpy"}[request.param])


@pytest.fixture(params=TASKS)
def envs(request: pytest.FixtureRequest) -> Iterator[Any]:
    made = VectorEnv(request.param, 1)
    yield made
    made.close()


def test_functions_are_the_same_on_arrays_of_other_libraries(envs: Any, namespace: Any) -> None:
    task, worlds = envs.task, any_worlds(envs, WORLDS, seed=1)

    def converted(array: Any) -> Any:
        if isinstance(array, dict):
            return {name: namespace.asarray(part) for name, part in array.items()}
        return namespace.asarray(array)

    theirs = Worlds(**{field: converted(array) for field, array in vars(worlds).items()})
    draws = np.random.default_rng(2).uniform(size=(WORLDS, max(1, task.goal_draws))).astype(np.float32)
    given, made = task.goal(np, worlds, draws), task.goal(namespace, theirs, namespace.asarray(draws))
    compare(given, made, 1.0)
    for part, own, other in zip(
        task.observed(), task.observe(np, worlds), task.observe(namespace, theirs), strict=True
    ):
        assert type(other) is type(theirs.joint_q), part.name
        compare(own, other, 8.0)
    certain = np.ones(WORLDS, bool)
    for function in ("success", "terminated"):
        own, other = getattr(task, function)(np, worlds), getattr(task, function)(namespace, theirs)
        assert (own is None) == (other is None)
        if own is not None:
            certain &= own == np.asarray(other)
    # what is on an edge may fall on either side
    assert (~certain).sum() <= 1
    own, other = task.reward(np, worlds)[certain], np.asarray(task.reward(namespace, theirs))[certain]
    compare(own, other, 40.0 if type(task).__name__ == "FrankaLift" else 2.0)


def compare(own: Any, other: Any, largest: float) -> None:
    """Numbers of at most this size agree, and so do their types."""
    other = np.asarray(other)
    assert other.dtype == own.dtype
    np.testing.assert_allclose(other.astype(float), own.astype(float), rtol=0, atol=TOLERANCE * largest)
