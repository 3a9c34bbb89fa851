"""How good policies are: one episode in each of 256 worlds, with the most likely actions.

    pip install onnxruntime
    python examples/evaluation.py out/ppo/QuadrupedVelocityFlat-0 out/ppo/QuadrupedVelocityFlat-1

Takes folders of runs, or policies as ONNX with metadata. For each it prints means with 95 % intervals over the
episodes, and then the mean of all with its interval over the runs.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.env import AutoresetMode, VectorEnv

WORLDS = 256
SEED = 1_000_000  # of the first world; no training comes there
FINAL_SEED = 2_000_000  # of the first world once a training is over: no evaluation on the way came there
# 97.5 % quantiles of Student's t, from 1 degree of freedom on
QUANTILES = (12.71, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228)
UNITS = {"error": "m", "velocity_error": "mps"}  # of the metrics of tightloop's tasks; the others have none
# How tasks are made for evaluations: on ground of all levels
OPTIONS: dict[str, dict[str, Any]] = {"QuadrupedVelocityRough": {"first_levels": 10}}
NO_METRICS = ("fault", "final_obs", "final_info", "privileged")  # in infos


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


def options_of(task: str) -> dict[str, Any]:
    """How a task is made for evaluations, by its name, with or without ``tightloop/`` and ``-v0``."""
    return OPTIONS.get(task.removeprefix("tightloop/").removesuffix("-v0"), {})


def episodes(
    task: str,
    act: Callable[[NDArray[np.float32]], NDArray[Any]],
    *,
    threads: int,
    seed: int = SEED,
    options: Mapping[str, Any] | None = None,
) -> dict[str, NDArray[Any]]:
    """Play one episode in each world.

    Args:
        task: Name of the task.
        act: Actions for observations, both with the worlds first.
        threads: Most threads that a step may use.
        seed: Seed of the first world.
        options: How the task is made besides.

    Returns:
        Values of each world by name: ``return``, the sum of the rewards; and at the end of the episode, where the task
        defines them, ``success`` and the metrics of the task, such as ``error``, the distance from the goal [m].
    """
    given = {**options_of(task), **(options or {})}
    env = VectorEnv(task, WORLDS, autoreset_mode=AutoresetMode.SAME_STEP, threads=threads, **given)
    returns, going, last = np.zeros(WORLDS), np.ones(WORLDS, bool), {}
    try:
        obs, _ = env.reset(seed=seed)
        while going.any():
            obs, reward, terminated, truncated, infos = env.step(act(obs))
            returns[going] += reward[going]
            for name, value in metrics(infos):
                last.setdefault(name, np.zeros(WORLDS))[going] = value[going]
            going &= ~(terminated | truncated)
    finally:
        env.close()
    # the success comes first, where there is one
    success = {"success": last.pop("success")} if "success" in last else {}
    return {"return": returns, **success, **last}


def evaluate(
    task: str,
    act: Callable[[NDArray[np.float32]], NDArray[Any]],
    *,
    threads: int,
    options: Mapping[str, Any] | None = None,
) -> dict[str, float]:
    """Play one episode in each world, always the same ones; returns means of `episodes` over the worlds."""
    found = episodes(task, act, threads=threads, options=options)
    return {name: float(values.mean()) for name, values in found.items()}


def interval(values: Sequence[float] | NDArray[Any]) -> tuple[float, float]:
    """Return the 95 % confidence interval of the mean of at least two independent values.

    It is Wilson's where all values are 0 or 1, and Student's otherwise.
    """
    given = np.asarray(values, np.float64)
    count, mean = len(given), given.mean()
    if count > len(QUANTILES) and np.isin(given, (0.0, 1.0)).all():
        square = 1.96**2 / count
        half = np.sqrt(square * (mean * (1.0 - mean) + square / 4.0))
        low, high = ((mean + square / 2.0 + end) / (1.0 + square) for end in (-half, half))
        return float(low), float(high)
    freedom = count - 1
    # an expansion for many degrees of freedom, 1 % too small at 11
    quantile = QUANTILES[freedom - 1] if freedom <= len(QUANTILES) else 1.96 + 2.4 / freedom
    half = quantile * given.std(ddof=1) / np.sqrt(count)
    return float(mean - half), float(mean + half)


def told(found: Mapping[str, float]) -> dict[str, str]:
    """Format the values of `evaluate` for printing. Names of metrics have no units, so there are none."""
    return {name: f"{value:.4g}" for name, value in found.items()}


def told_with_intervals(found: Mapping[str, NDArray[Any]]) -> str:
    """Means of values by name with their 95 % intervals, to be printed."""
    shown = []
    for name, values in found.items():
        low, high = interval(values)
        shown.append(f"{name} {np.mean(values):.4g} ({low:.4g} to {high:.4g})")
    return ", ".join(shown)


def main() -> None:
    """Evaluate each, and all together."""
    from learning.program import needed

    with needed("onnxruntime"):
        import onnxruntime

    parser = argparse.ArgumentParser(description="Evaluate policies, with 95 % intervals.")
    parser.add_argument("runs", nargs="+", type=Path, help="folders of runs, or ONNX files")
    parser.add_argument("--task", help="the task, if the policy's metadata does not name it, as FILE.py:CLASS")
    parser.add_argument("--threads", type=int, default=1, help="most threads of the simulation (default 1)")
    args = parser.parse_args()
    means: dict[str, list[float]] = {}
    tasks: set[str] = set()
    for run in args.runs:
        file = run / "policy.onnx" if run.is_dir() else run
        if not file.is_file():
            raise SystemExit(f"there is no policy {file}; give folders of runs that are over, or ONNX files")
        try:
            policy = onnxruntime.InferenceSession(file, providers=["CPUExecutionProvider"])
        except Exception as problem:  # its errors have no common base
            raise SystemExit(f"{file} is no policy as ONNX: {problem}") from None
        said = policy.get_modelmeta().custom_metadata_map
        task = args.task or said.get("task")
        if task is None:
            raise SystemExit(f"{file} has no metadata; name its task by --task")
        if tasks and task not in tasks:
            raise SystemExit(f"{file} is a policy of {task}, and those before are of {tasks.pop()}")
        tasks.add(task)

        def act(obs: NDArray[np.float32], policy: Any = policy) -> NDArray[Any]:
            return policy.run(["action"], {"obs": obs.astype(np.float32)})[0]

        # a task that is named by hand is made as its file says
        options = {} if args.task else json.loads(said.get("task_options", "{}"))
        found = episodes(task, act, threads=args.threads, seed=FINAL_SEED, options=options)
        print(f"{run}: {told_with_intervals(found)}", flush=True)
        for name, values in found.items():
            means.setdefault(name, []).append(float(values.mean()))
    if len(args.runs) > 1:
        of_runs = {name: np.array(values) for name, values in means.items()}
        # what only some runs report has no interval over all
        shared = {name: values for name, values in of_runs.items() if len(values) == len(args.runs)}
        print(f"mean of {len(args.runs)} runs: {told_with_intervals(shared)}")


if __name__ == "__main__":
    main()
