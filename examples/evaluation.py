"""How good a policy is: one episode in each of 256 worlds, always the same ones, with the most likely actions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.env import AutoresetMode, VectorEnv

WORLDS = 256
SEED = 1_000_000  # of the first world; no training comes there


def evaluate(task: str, act: Callable[[NDArray[np.float32]], NDArray[Any]], *, threads: int) -> dict[str, float]:
    """Play one episode in each world.

    Args:
        task: Name of the task.
        act: Actions for observations, both with the worlds first.
        threads: Most threads that a step may use.

    Returns:
        Means over the worlds: ``return``, the sum of the rewards; and at the end of the episode, where the task knows
        them, ``success``, from 0 to 1, and ``error``, the distance from the goal [m].
    """
    env = VectorEnv(task, WORLDS, autoreset_mode=AutoresetMode.SAME_STEP, threads=threads)
    returns, going, last = np.zeros(WORLDS), np.ones(WORLDS, bool), {}
    try:
        obs, _ = env.reset(seed=SEED)
        while going.any():
            obs, reward, terminated, truncated, infos = env.step(act(obs))
            returns[going] += reward[going]
            for name in ("success", "error"):
                if name in infos:
                    last.setdefault(name, np.zeros(WORLDS))[going] = infos[name][going]
            going &= ~(terminated | truncated)
    finally:
        env.close()
    return {"return": float(returns.mean()), **{name: float(values.mean()) for name, values in last.items()}}


def told(found: dict[str, float]) -> dict[str, str]:
    """The numbers of `evaluate`, to be printed."""
    shown = {name: f"{value:.4g}" for name, value in found.items() if name != "error"}
    return shown | ({"error": f"{100 * found['error']:.2f} cm"} if "error" in found else {})
