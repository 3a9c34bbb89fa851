"""What a task's functions cost in Python: observation, reward and success of 4096 worlds on one core.

    python -m benches tasks

The worlds are those of an environment after some random actions; its functions are called as it does itself, on arrays
whose temporaries lie in its arena, and the observation is packed into one array. The least of many rounds counts, since
other work on the machine only adds; the median stands beside it. `most_kb` is the most that a call takes beyond that
arena: NumPy's own buffers. Writes benches/results/MACHINE/tasks.csv, and ends with 1 when a task is slower than asked.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
from tqdm import tqdm

from tightloop.env import VectorEnv
from tightloop.env.registry import TASKS

sys.path.insert(0, str(Path(__file__).parents[1]))
from record import print_table, write_results

WORLDS = 4096
STEPS = 20
ASKED_US = {"FrankaReach": 350.0, "FrankaPickCube": 700.0}
Row = dict[str, str | int]


def row(task: str, calls: dict[str, Callable[[], object]], rounds: int) -> tuple[Row, float]:
    """For people and files, and the least time of all calls together [us]."""
    times = np.empty((rounds + rounds // 10, len(calls)))
    for number in range(len(times)):
        for place, call in enumerate(calls.values()):
            begin = time.perf_counter()
            call()
            times[number, place] = 1e6 * (time.perf_counter() - begin)
    # the first tenth warms caches and clocks
    counted = times[rounds // 10 :]
    least = counted.min(0)
    entry: Row = {"task": task, "worlds": WORLDS}
    entry |= {f"{what}_us": f"{us:.0f}" for what, us in zip(calls, least, strict=True)}
    entry |= {"sum_us": f"{least.sum():.0f}", "median_us": f"{np.median(counted.sum(1)):.0f}"}
    entry["asked_us"] = f"{ASKED_US[task]:.0f}" if task in ASKED_US else "–"
    entry["most_kb"] = f"{max(memory(call) for call in calls.values()) / 1024:.0f}"
    return entry, float(least.sum())


def memory(call: Callable[[], object]) -> int:
    """Most that a call takes while it runs [bytes]."""
    tracemalloc.start()
    call()
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return most


def main() -> int:
    """Measure each task, print and write the results; 0 when they are as fast as asked."""
    parser = argparse.ArgumentParser(description="Time of the tasks' functions, 4096 worlds on one core.")
    parser.add_argument("--rounds", type=int, default=2000, help="rounds that count (default 2000)")
    rounds = parser.parse_args().rounds
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    rng, rows, slow = np.random.default_rng(0), [], []
    for task in tqdm(TASKS, desc="tasks", disable=None):
        envs = VectorEnv(task, WORLDS, autoreset_mode="DISABLED", threads=1)
        obs, _ = envs.reset(seed=0)
        size = envs.single_action_space.shape or ()
        for _ in range(STEPS):
            # nothing falls, so that every episode goes on
            obs, *_ = envs.step(rng.uniform(-0.1, 0.1, (WORLDS, *size)).astype(np.float32))
        entry, least = row(
            task,
            {
                "observe": lambda envs=envs, obs=obs: envs._observe(obs),
                "reward": lambda envs=envs: envs.evaluation.call("reward"),
                "success": lambda envs=envs: envs.evaluation.call("success"),
                "terminated": lambda envs=envs: envs.evaluation.call("terminated"),
            },
            rounds,
        )
        envs.close()
        rows.append(entry)
        if least > ASKED_US.get(task, np.inf):
            slow.append(f"{task}: {least:.0f} us, asked {ASKED_US[task]:.0f}")
    print_table(rows)
    facts = {"command": f"python -m benches tasks --rounds {rounds}", "cores": 1, "numpy": np.__version__}
    write_results("tasks", rows, facts)
    print("\n".join(slow))
    return int(bool(slow))


if __name__ == "__main__":
    sys.exit(main())
