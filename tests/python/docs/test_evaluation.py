"""Confidence intervals of ``examples/evaluation.py``."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pytest

from conftest import REPOSITORY

sys.path.insert(0, str(REPOSITORY / "examples"))
from evaluation import interval, told, told_with_intervals
from tightloop.tasks.cartpole import CartPoleBalance


def test_few_values_have_students_interval() -> None:
    # Student's t with 1 and 2 degrees of freedom: 12.71 and 4.303
    assert interval([0.5, 2.5]) == pytest.approx((1.5 - 12.71, 1.5 + 12.71))
    assert interval([1.0, 2.0, 3.0]) == pytest.approx((2.0 - 4.303 / 3**0.5, 2.0 + 4.303 / 3**0.5))


def test_shares_have_wilsons_interval_which_has_a_width_at_0_and_1() -> None:
    low, high = interval(np.ones(256))
    assert high == pytest.approx(1.0) and low == pytest.approx(1 / (1 + 1.96**2 / 256))
    # the textbook's: 40 of 100
    assert interval(np.arange(100) < 40) == pytest.approx((0.3094, 0.4980), abs=1e-4)


@pytest.mark.parametrize("count", [2, 11, 12, 256])
def test_95_of_100_intervals_hold_the_mean(count: int) -> None:
    draws = np.random.default_rng(count).normal(3.0, 2.0, (4000, count))
    held = [low < 3.0 < high for low, high in map(interval, draws)]
    # three standard deviations of a share of 4000
    assert abs(np.mean(held) - 0.95) < 3 * (0.95 * 0.05 / 4000) ** 0.5


def test_means_are_reported_with_their_intervals() -> None:
    assert told_with_intervals({"return": np.array([1.0, 2.0, 3.0])}) == "return 2 (-0.4843 to 4.484)"


class NoSuccess(CartPoleBalance):
    """A task that says nothing of success."""

    max_episode_steps = 5


class Upright(NoSuccess):
    def success(self, xp, worlds):
        """Half of the worlds, whatever they do."""
        return worlds.joint_q[:, 0] * 0.0 + xp.arange(len(worlds.joint_q)) % 2 > 0.5


class Still:
    """A policy that does nothing."""

    def run(self, _names, given):
        return [np.zeros((len(given["obs"]), 1), np.float32)]


@pytest.mark.parametrize(("task", "end"), [(NoSuccess, "± 0"), (Upright, "± 0, success at the end 50.0%")])
def test_a_played_policy_has_a_success_only_if_its_task_has_one(task, end, envs) -> None:
    pytest.importorskip("onnxruntime")
    pytest.importorskip("matplotlib")
    import play

    made = envs(task, 4, autoreset_mode="SameStep")
    still: Any = Still()
    kept = play.play(made, still, 0, None)
    assert ("success" in kept) == (task is Upright)
    assert play.summary("Own", kept) == f"Own: return 5 {end}"


def test_a_metric_is_printed_as_the_task_returns_it():
    assert told({"return": 12.0, "error": 0.25, "angle": 1e-5}) == {"return": "12", "error": "0.25", "angle": "1e-05"}
