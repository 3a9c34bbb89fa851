"""Robots of others in the velocity tasks: whether they stand."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from tightloop.env import VectorEnv

#: Steps of 20 ms: a second to settle, and five to stand.
SETTLING, STANDING = 50, 250


def check_stands(file: Path | str) -> None:
    """Check that a quadruped stands in its pose under actions of 0, from random starts."""
    env: Any = VectorEnv("QuadrupedVelocityFlat", 4, model=file, pushes=0.0, threads=1)
    try:
        obs, _ = env.reset(seed=0)
        task, robot = env.task, env.task.robot
        for step in range(SETTLING + STANDING):
            obs, reward, terminated, _, _ = env.step(np.zeros(env.action_space.shape))
            assert np.isfinite(obs).all() and np.isfinite(reward).all()
            assert not terminated.any(), f"it falls after {0.02 * step:.2f} s"
            if step > SETTLING:
                soles = np.abs(task.foot_heights(np, env.evaluation.worlds)).max()
                assert soles < 0.03 * robot.hip_height + 0.01, f"a foot is {soles:.3f} m off the ground"
        np.testing.assert_allclose(env.frame.joint_q[:, 2], robot.height, rtol=0.12)
    finally:
        env.close()


def check_starts(file: Path | str) -> None:
    """Check that a humanoid starts on its feet and has finite observations until it falls."""
    env: Any = VectorEnv("HumanoidVelocityFlat", 4, model=file, pushes=0.0, threads=1)
    try:
        obs, _ = env.reset(seed=0)
        soles = np.abs(env.task.foot_heights(np, env.evaluation.worlds)).max()
        assert soles < 0.15 * env.task.robot.hip_height, f"a foot is {soles:.3f} m off the ground"
        fell = np.zeros(4, bool)
        for step in range(100):
            obs, reward, terminated, _, _ = env.step(np.zeros(env.action_space.shape))
            fell |= terminated
            assert np.isfinite(obs).all() and np.isfinite(reward).all()
            assert step > 25 or not fell.any(), "it stands for half a second without balancing"
    finally:
        env.close()
