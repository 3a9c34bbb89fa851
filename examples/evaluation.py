"""How good a policy is: one episode in each of 256 worlds, always the same ones, with the most likely actions."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.env import AutoresetMode, VectorEnv

WORLDS = 256
SEED = 1_000_000  # of the first world; no training comes there
UNITS = {"error": "m", "velocity_error": "mps"}  # of the metrics of tightloop's tasks; the others have none
# How tasks are made for evaluations: on ground of all levels
OPTIONS: dict[str, dict[str, Any]] = {"QuadrupedVelocityRough": {"first_levels": 10}}
NO_METRICS = ("fault", "final_obs", "final_info")  # in infos


def metrics(infos: Mapping[str, Any]) -> Iterator[tuple[str, NDArray[Any]]]:
    """Metrics and success of a step, by name, shape ``(worlds,)``.

    In the mode ``SAME_STEP`` the row of an episode that ended belongs to its last step.
    """
    for name, value in infos.items():
        if f"_{name}" in infos and name not in NO_METRICS:
            yield name, value


def with_unit(name: str) -> str:
    """Name of a metric for a log, such as ``error_m``."""
    return f"{name}_{UNITS[name]}" if name in UNITS else name


def evaluate(task: str, act: Callable[[NDArray[np.float32]], NDArray[Any]], *, threads: int) -> dict[str, float]:
    """Play one episode in each world.

    Args:
        task: Name of the task.
        act: Actions for observations, both with the worlds first.
        threads: Most threads that a step may use.

    Returns:
        Means over the worlds: ``return``, the sum of the rewards; and at the end of the episode, where the task defines
        them, ``success``, from 0 to 1, and the metrics of the task, such as ``error``, the distance from the goal [m].
    """
    env = VectorEnv(task, WORLDS, autoreset_mode=AutoresetMode.SAME_STEP, threads=threads, **OPTIONS.get(task, {}))
    returns, going, last = np.zeros(WORLDS), np.ones(WORLDS, bool), {}
    try:
        obs, _ = env.reset(seed=SEED)
        while going.any():
            obs, reward, terminated, truncated, infos = env.step(act(obs))
            returns[going] += reward[going]
            for name, value in metrics(infos):
                last.setdefault(name, np.zeros(WORLDS))[going] = value[going]
            going &= ~(terminated | truncated)
    finally:
        env.close()
    means = {name: float(values.mean()) for name, values in last.items()}
    # the success comes first, where there is one
    success = {"success": means.pop("success")} if "success" in means else {}
    return {"return": float(returns.mean()), **success, **means}


def told(found: Mapping[str, float]) -> dict[str, str]:
    """The numbers of `evaluate`, to be printed."""
    shown = {name: f"{value:.4g}" for name, value in found.items() if name != "error"}
    return shown | ({"error": f"{100 * found['error']:.2f} cm"} if "error" in found else {})
