"""A control loop of 1 kHz in real time: a Franka arm above its table, from Python, C and Rust, beside a bare loop.

    cargo build --release --workspace --lib
    python -m benches realtime --seconds 60

All sides run in turns, so that a machine that is busy for a while is busy for all. The bare loop has two threads that
sleep until shortly before a frame is due, and spin (benches/daemon/realtime.rs); it computes nothing. A deadline is
missed where the frame left more than a tenth of the period after it was due, or where its command was late. Latencies
are from the time at which a frame was due until the controller had it. Python takes the quickest of the next 50 frames
as on time.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from clients import program_in_c
from numpy.typing import NDArray

import tightloop as tl

sys.path.insert(0, str(Path(__file__).parents[1]))
from record import REPOSITORY, write_results

sys.path.insert(0, str(REPOSITORY / "examples"))
from franka_lesson import scene

PERIOD = 1e-3  # [s]
TURNS = 6
WARM_UP = 200
AHEAD = 50
"""Of so many frames, the quickest was on time."""


def program() -> list[str]:
    """The command of benches/daemon/realtime.rs, compiled."""
    build = ["cargo", "bench", "--quiet", "--workspace", "--bench", "realtime", "--no-run"]
    lines = subprocess.run(
        [*build, "--message-format=json"], cwd=REPOSITORY, stdout=subprocess.PIPE, check=True, text=True
    ).stdout.splitlines()
    made = [message["executable"] for message in map(json.loads, lines) if message.get("executable")]
    return [made[-1]]


def run(*arguments: str) -> dict[str, float]:
    """A turn of the program."""
    return json.loads(subprocess.run(arguments, stdout=subprocess.PIPE, check=True, text=True).stdout)


def from_python(sim: tl.Sim, seconds: int, target: NDArray[np.float32] | None = None) -> dict[str, float]:
    """A turn of a controller in Python that answers at once: with targets of its own, or those that are in an array."""
    if target is None:
        target = np.array(sim.forward().joint_q[0, : len(sim.dof_names)])
    frames = round(seconds / PERIOD)
    times = np.empty(frames)
    for _ in range(WARM_UP):
        sim.step(joint_target_q=target)
    sim.restart_timing()
    for frame in range(frames):
        sim.step(joint_target_q=target)
        times[frame] = time.monotonic()
    timing = sim.timing
    late = times - PERIOD * np.arange(frames)
    # periods that the daemon skipped, and the commands that it waited for, move all later frames
    later = np.lib.stride_tricks.sliding_window_view(late, AHEAD)
    late = (late[: len(later)] - later.min(axis=1)) * 1e6
    p50, p99, p999 = np.percentile(late, [50, 99, 99.9])
    return {
        "frames": timing.frames,
        "missed": timing.missed,
        "late": timing.late,
        "p50": p50,
        "p99": p99,
        "p999": p999,
        "worst": late.max(),
    }


def main() -> None:
    """Measure in turns and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=int, default=60, help="of each side, in all turns together")
    given = parser.parse_args()
    seconds = max(given.seconds // TURNS, 1)
    bench = program()
    folder = tempfile.TemporaryDirectory()
    in_c = program_in_c(REPOSITORY / "benches/daemon/realtime.c", Path(folder.name))
    turns: dict[str, list[dict[str, float]]] = {"bare loop": [], "Rust": [], "C": [], "Python": []}
    arm = scene(driven=True)
    arm.dt, arm.substeps = PERIOD / 2, 2
    arm.add_table()
    with tl.launch(arm, worlds=1, threads=1, device="cpu", realtime=1.0) as sim:
        for _ in range(TURNS):
            turns["bare loop"].append(run(*bench, "bare", str(seconds)))
            turns["Python"].append(from_python(sim, seconds))
            sim.release()
            turns["Rust"].append(run(*bench, "client", sim.name, str(seconds)))
            turns["C"].append(run(str(in_c), sim.name, str(seconds)))
    print(f"{'':>10}{'frames':>9}{'missed %':>10}{'late':>7}{'p50':>9}{'p99':>9}{'p99.9':>9}{'worst':>9}  [µs]")
    results = []
    for side, measured in turns.items():
        total = {key: sum(turn[key] for turn in measured) for key in ("frames", "missed", "late")}
        times = {key: float(np.median([turn[key] for turn in measured])) for key in ("p50", "p99", "p999")}
        worst = max(turn["worst"] for turn in measured)
        missed = 100.0 * total["missed"] / total["frames"]
        row = {"side": side, "frames": f"{total['frames']:.0f}", "missed_percent": f"{missed:.3f}"}
        row |= {"late": f"{total['late']:.0f}"} | {f"{key}_us": f"{value:.1f}" for key, value in times.items()}
        row["worst_us"] = f"{worst:.1f}"
        results.append(row)
        print(
            f"{side:>10}"
            + "".join(f"{row[key]:>{w}}" for key, w in zip(list(row)[1:], (9, 10, 7, 9, 9, 9, 9), strict=True))
        )
    write_results(
        "realtime", results, {"command": "python -m benches realtime", "period": "1 ms", "cores": os.cpu_count() or 1}
    )


if __name__ == "__main__":
    main()
