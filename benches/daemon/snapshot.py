"""Time that it takes to keep and to put back 4096 worlds of the grasp.

    python -m benches snapshot

The arm of the grasp holds its cube in every world; then a snapshot is taken, restored, and one of its worlds put into
all, many times in turn, through the daemon and Python, as bytes in memory. Each time includes the way of the bytes
through shared memory, their checksum on both sides, and the frame that answers. Beside it, as a part of them all, that
frame alone. Writes benches/results/MACHINE/snapshot.csv, and ends with 1 when a median is above the 10 ms asked.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from tqdm import tqdm

import tightloop as tl

sys.path.insert(0, str(Path(__file__).parents[1]))
from record import REPOSITORY, print_table, write_results

sys.path[:0] = [str(REPOSITORY / "examples")]
import franka_grasp as grasp  # noqa: E402  (the examples are no package)

WORLDS = 4096
# The cube is held, half-way up
FRAMES = 120
ASKED_MS = 10.0


def row(what: str, times: list[float], *, size: int | None) -> dict[str, str | int]:
    """For people and files; `size` [bytes] is that of the snapshot, where there is one."""
    ms = 1e3 * np.array(times)
    return {
        "what": what,
        "worlds": WORLDS,
        "megabytes": f"{size / 1e6:.2f}" if size else "–",
        "median_ms": f"{np.median(ms):.2f}",
        "p99_ms": f"{np.percentile(ms, 99):.2f}",
        "asked_ms": f"{ASKED_MS:.0f}" if size else "–",
    }


def main() -> int:
    """Measure in turns, print and write the results; 0 when they are as fast as asked."""
    parser = argparse.ArgumentParser(description="Time of snapshots of 4096 worlds.")
    parser.add_argument("--rounds", type=int, default=200, help="rounds that count (default 200)")
    rounds = parser.parse_args().rounds
    with tl.launch(grasp.scene(), worlds=WORLDS, fields=("joint_q",)) as sim:
        print(f"tightloop {tl.__version__}: {sim.device}")
        sim.write(joint_q={"cube": grasp.cubes(WORLDS)})
        for goal in grasp.targets()[:FRAMES]:
            sim.step(joint_target_q={"arm": goal})
        snapshot = sim.snapshot()
        calls: dict[str, Callable[[], object]] = {
            "snapshot": sim.snapshot,
            "restore": lambda: sim.restore(snapshot),
            "restore from one world": lambda: sim.restore(snapshot, from_world=1),
            "forward": sim.forward,
        }
        times: dict[str, list[float]] = {what: [] for what in calls}
        # The first tenth warms caches and clocks
        for number in tqdm(range(rounds + rounds // 10), desc="rounds", disable=None):
            for what, call in calls.items():
                begin = time.perf_counter()
                call()
                if number >= rounds // 10:
                    times[what].append(time.perf_counter() - begin)
        device = sim.device
    size = len(snapshot.to_bytes())
    rows = [row(what, seen, size=size if what != "forward" else None) for what, seen in times.items()]
    print_table(rows)
    write_results("snapshot", rows, {"command": f"python -m benches snapshot --rounds {rounds}", "device": device})
    slow = [row for row in rows if row["asked_ms"] != "–" and float(row["median_ms"]) > ASKED_MS]
    for late in slow:
        print(f"{late['what']}: {late['median_ms']} ms, asked {late['asked_ms']}")
    return int(bool(slow))


if __name__ == "__main__":
    sys.exit(main())
