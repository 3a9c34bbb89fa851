"""The page of an environment that is shown: plots of its reward, and the choice of a policy."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from browser import View, chromium
from processes import wait_until
from tightloop.env import Task, VectorEnv
from tightloop.errors import ArgumentError
from tightloop.tasks.cartpole import CartPoleBalance


class Weighed(CartPoleBalance):
    """The cart pole with a reward of two terms."""

    max_episode_steps = 100
    reward = Task.reward
    reward_weights = {"upright": 1.0, "effort": -0.1}  # noqa: RUF012

    def reward_terms(self, xp: Any, worlds: Any) -> dict[str, Any]:
        return {"upright": xp.cos(worlds.joint_q[:, 1]), "effort": worlds.action[:, 0] ** 2}


@pytest.fixture
def envs() -> Iterator[VectorEnv]:
    made = VectorEnv(Weighed, 4, autoreset_mode="SAME_STEP", render_mode="human")
    yield made
    made.close()


def test_the_page_plots_terms_of_the_reward_and_chooses_the_policy(envs: VectorEnv) -> None:
    viewer = envs.viewer
    assert viewer is not None and viewer.choice is None
    viewer.offer(["still", "push"])
    envs.reset(seed=0)

    def steps(count: int) -> None:
        for _ in range(count):
            envs.step(np.full((4, 1), float(viewer.choice == "push")))

    with chromium() as browser:
        steps(5)
        view = View(browser, viewer.url)
        wait_until(lambda: steps(5) or "effort" in view.text, 60.0)
        assert "upright" in view.text and "reward" in view.text and "Policy" in view.text
        view.choose("Policy", "push")
        wait_until(lambda: steps(5) or viewer.choice == "push", 60.0)
        # other names take the place of those before, and nothing is chosen
        viewer.offer(["first", "second"])
        assert viewer.choice is None
        wait_until(lambda: steps(1) or "first" in view.page.get_by_role("combobox", name="Policy").input_value(), 60.0)
        view.choose("Policy", "second")
        wait_until(lambda: steps(1) or viewer.choice == "second", 60.0)
        view.page.close()
        assert view.errors == [], view.console


def test_the_loop_does_not_wait_for_a_viewer_that_does_not_listen(envs: VectorEnv) -> None:
    viewer = envs.viewer
    assert viewer is not None
    os.kill(viewer.pid, signal.SIGSTOP)
    try:
        begun = time.monotonic()
        for step in range(3000):
            viewer.plot(0, 0.1 * step, {"reward": 1.0, "a term with a long name " * 300: 2.0})
        assert time.monotonic() - begun < 30.0
    finally:
        os.kill(viewer.pid, signal.SIGCONT)
    viewer.close()
    viewer.plot(0, 0.0, {"reward": 1.0})
    with pytest.raises(ArgumentError, match="choices is 'one'; give a list of names"):
        viewer.offer("one")


def test_environments_that_are_not_shown_have_no_viewer() -> None:
    envs = VectorEnv("CartPoleBalance", 1)
    assert envs.viewer is None
    envs.close()
