"""What Python, shared memory and a second process add to a step of one world.

    python benches/round_trip.py

Runs the target demo in process (benches/round_trip.rs) and through `tightloop.launch`, in turns, so that a machine that
changes its speed meanwhile changes both. The budget is 5 us at the median. Ends with 1 when it is not kept.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

import tightloop as tl

REPOSITORY = Path(__file__).parents[1]
sys.path.insert(0, str(REPOSITORY / "examples"))
from franka_lesson import FRAMES, scene, targets  # noqa: E402  (the examples are no package)

ROUNDS = 5
WARM_UP = 2_000
MEASURED = 20_000
BUDGET_US = 5.0
PARTS = {"p50_us": 50, "p99_us": 99, "p999_us": 99.9}


def in_process() -> dict[str, float]:
    """Percentiles of a step in one process, in Rust [us]."""
    command = ["cargo", "bench", "--quiet", "--package", "tightloop", "--bench", "round_trip"]
    return json.loads(subprocess.run(command, cwd=REPOSITORY, stdout=subprocess.PIPE, check=True).stdout)


def through_python(sim: tl.Sim) -> dict[str, float]:
    """Percentiles of `Sim.step` with its command array ready [us]."""
    commands = [targets(frame, np.ones(1)) for frame in range(FRAMES)]
    clock = time.perf_counter_ns
    trips = np.empty(MEASURED)
    sim.reset()
    for frame in range(WARM_UP + MEASURED):
        action = commands[frame % FRAMES]
        start = clock()
        sim.step(joint_target_q=action)
        end = clock()
        if frame >= WARM_UP:
            trips[frame - WARM_UP] = (end - start) / 1e3
    return {part: float(np.percentile(trips, percent)) for part, percent in PARTS.items()}


def main() -> int:
    """Measure in turns, print medians over the rounds; 0 when the budget is kept."""
    rust, python = [], []
    with tl.launch(scene(driven=True), worlds=1, threads=1) as sim:
        for _ in range(ROUNDS):
            rust.append(in_process())
            python.append(through_python(sim))
    print(f"one world, {MEASURED} steps, median of {ROUNDS} rounds, {os.cpu_count()} cores")
    print(f"{'us':>20}{'p50':>9}{'p99':>9}{'p99.9':>9}")
    medians = [{part: float(np.median([row[part] for row in rows])) for part in PARTS} for rows in (rust, python)]
    for what, row in zip(("in process, Rust", "Python, daemon"), medians, strict=True):
        print(f"{what:>20}" + "".join(f"{row[part]:9.2f}" for part in PARTS))
    added = float(np.median([there["p50_us"] - here["p50_us"] for here, there in zip(rust, python, strict=True)]))
    print(f"{'added at p50':>20}{added:9.2f}   (budget {BUDGET_US:.0f})")
    return int(added > BUDGET_US)


if __name__ == "__main__":
    sys.exit(main())
