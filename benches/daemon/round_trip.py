"""What Python, shared memory and a second process add to a step of one world.

    python -m benches round_trip

Runs the target demo in process (benches/daemon/round_trip.rs) and through `tightloop.launch`, in turns, so that a
machine that changes its speed meanwhile changes both. The budget is 5 us at the median. Ends with 1 when it is not
kept.
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

sys.path.insert(0, str(Path(__file__).parents[1]))
from record import REPOSITORY, write_results

sys.path.insert(0, str(REPOSITORY / "examples"))
from franka_lesson import FRAMES, scene, targets

ROUNDS = 5
WARM_UP = 2_000
MEASURED = 20_000
BUDGET_US = 5.0
PARTS = {"p50_us": 50, "p99_us": 99, "p999_us": 99.9}


def in_rust() -> tuple[dict[str, float], dict[str, float]]:
    """Percentiles of a step in Rust, in process and through a daemon [us]."""
    command = ["cargo", "bench", "--quiet", "--workspace", "--bench", "round_trip"]
    measured = json.loads(subprocess.run(command, cwd=REPOSITORY, stdout=subprocess.PIPE, check=True).stdout)
    return measured, measured["wire"]


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
    rows: dict[str, list[dict[str, float]]] = {"in process, Rust": [], "daemon, Rust": [], "daemon, Python": []}
    with tl.launch(scene(driven=True), worlds=1, threads=1) as sim:
        for _ in range(ROUNDS):
            for measured, percentiles in zip(rows.values(), (*in_rust(), through_python(sim)), strict=True):
                measured.append(percentiles)
    print(f"one world, {MEASURED} steps, median of {ROUNDS} rounds, {os.cpu_count()} cores [us]")
    print(f"{'':>20}{'p50':>9}{'p99':>9}{'p99.9':>9}")
    results: list[dict[str, str]] = []
    for what, measured in rows.items():
        medians = {part: f"{np.median([percentiles[part] for percentiles in measured]):.2f}" for part in PARTS}
        results.append({"side": what} | medians)
        print(f"{what:>20}" + "".join(f"{median:>9}" for median in medians.values()))
    here, _, there = rows.values()
    added = float(np.median([b["p50_us"] - a["p50_us"] for a, b in zip(here, there, strict=True)]))
    print(f"{'added by Python':>20}{added:9.2f}   (budget {BUDGET_US:.0f} at p50)")
    facts = {"command": "python -m benches round_trip", "worlds": 1, "threads": 1, "steps": MEASURED, "rounds": ROUNDS}
    write_results("round_trip", results, facts)
    return int(added > BUDGET_US)


if __name__ == "__main__":
    sys.exit(main())
