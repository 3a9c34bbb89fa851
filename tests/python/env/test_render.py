"""Environments that render: gymnasium's modes, and what its wrappers make of them."""

from __future__ import annotations

import urllib.request
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.wrappers import AddRenderObservation, RenderCollection

import tightloop as tl
from tightloop.env import AutoresetMode, Env, VectorEnv
from tightloop.tasks.reach import FrankaReach
from tightloop.view import Film


def test_an_environment_shows_itself_as_it_is_now() -> None:
    env = gymnasium.make("tightloop/CartPoleSwingUp-v0", render_mode="rgb_array")
    assert env.render_mode == "rgb_array" and env.unwrapped.metadata["render_fps"] == 50
    env.reset(seed=3)
    first: Any = env.render()
    assert first.dtype == np.uint8 and first.ndim == 3 and first.shape[2] == 3
    np.testing.assert_array_equal(env.render(), first)
    for _ in range(10):
        env.step(np.ones(1, np.float32))
    later: Any = env.render()
    assert (np.abs(later.astype(int) - first).sum(axis=-1) > 60).sum() > 30
    # the first episode of a seed looks the same again
    env.reset(seed=3)
    np.testing.assert_array_equal(env.render(), first)
    env.close()


def test_worlds_of_a_vector_are_shown_as_they_are_alone() -> None:
    envs: Any = gymnasium.make_vec("tightloop/FrankaReach-v0", num_envs=3, render_mode="rgb_array")
    envs.reset(seed=5)
    pictures = envs.render()
    assert isinstance(pictures, tuple) and len(pictures) == 3
    for world, picture in enumerate(pictures):
        alone: Any = gymnasium.make("tightloop/FrankaReach-v0", render_mode="rgb_array")
        alone.reset(seed=5 + world)
        np.testing.assert_array_equal(alone.render(), picture)
        alone.close()
    envs.close()


def test_goals_are_marked() -> None:
    class Unmarked(FrankaReach):
        goal_radius = None

    seen = []
    for task in ("FrankaReach", Unmarked):
        envs = VectorEnv(task, 1, render_mode="rgb_array")
        # a goal beside the arm, for which the camera does not move
        envs.reset(seed=1)
        pictures = envs.render()
        assert pictures is not None
        seen.append(pictures[0].astype(int))
        marks = envs.marks
        assert (marks is None) == (task is Unmarked)
        if marks is not None:
            places, radius, _ = marks["goal"]
            assert places.shape == (1, 3) and radius == 0.02
        envs.close()
    marked, plain = seen
    changed = np.abs(marked - plain).sum(axis=-1) > 12
    assert 10 < changed.sum() < 0.02 * changed.size
    more = (marked - plain)[changed].mean(axis=0)
    assert more[1] > more[0] and more[1] > more[2], "the ball is green"


def test_wrappers_of_gymnasium_take_the_pictures(tmp_path: Path) -> None:
    env: Any = RenderCollection(gymnasium.make("tightloop/CartPoleBalance-v0", render_mode="rgb_array"))
    env.reset(seed=0)
    for _ in range(4):
        env.step(env.action_space.sample())
    assert len(env.render()) == 5
    env.close()
    env = AddRenderObservation(gymnasium.make("tightloop/CartPoleBalance-v0", render_mode="rgb_array"))
    obs, _ = env.reset(seed=0)
    assert obs in env.observation_space and obs.shape == env.observation_space.shape
    env.close()


def test_a_video_is_recorded(tmp_path: Path) -> None:
    pytest.importorskip("moviepy", reason="RecordVideo needs it; gymnasium[other] brings it")
    env: Any = gymnasium.make("tightloop/CartPoleBalance-v0", render_mode="rgb_array")
    env = gymnasium.wrappers.RecordVideo(env, str(tmp_path), episode_trigger=lambda _: True)
    env.reset(seed=0)
    for _ in range(10):
        env.step(env.action_space.sample())
    env.close()
    assert [file.suffix for file in tmp_path.iterdir()] == [".mp4"]


def test_frames_of_an_environment_become_a_film(tmp_path: Path) -> None:
    envs = VectorEnv("FrankaPickCube", 4, render_mode="rgb_array", autoreset_mode=AutoresetMode.SAME_STEP)
    assert envs.frame is None
    with Film(tmp_path / "run", envs.sim, worlds=4, size=(96, 64), fps=20) as film:
        envs.reset(seed=0)
        for _ in range(6):
            film.add(envs.frame, goals=envs.marks)
            envs.step(envs.action_space.sample())
    envs.close()
    assert len(list((tmp_path / "run").iterdir())) == 6


def test_without_a_mode_there_is_a_warning_and_no_picture() -> None:
    envs = VectorEnv("CartPoleBalance", 2)
    assert envs.render_mode is None and "body_q" not in envs.sim.fields
    envs.reset(seed=0)
    with pytest.warns(UserWarning, match="rgb_array"):
        assert envs.render() is None
    envs.close()


def test_a_picture_before_the_first_episode_is_refused() -> None:
    envs = VectorEnv("CartPoleBalance", 2, render_mode="rgb_array")
    with pytest.raises(tl.CommandRefused, match="reset"):
        envs.render()
    envs.close()


def test_in_the_browser_a_step_takes_its_time(capfd: pytest.CaptureFixture[str]) -> None:
    env = Env("CartPoleBalance", render_mode="human")
    url = capfd.readouterr().err.split()[-1]
    with urllib.request.urlopen(url, timeout=30) as page:
        assert b"<html" in page.read().lower()
    env.reset(seed=0)
    env.step(np.zeros(1))
    assert env.render() is None
    env.close()
    with pytest.raises(OSError, match=r"refused|reset"):
        urllib.request.urlopen(url, timeout=5)
