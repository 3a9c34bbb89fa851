"""Deadlines of a plant of 1 kHz on one core, without and with a planner that is busy on the other core.

    python -m benches planner_beside_plant --seconds 60

The plant is the arm of examples/mpc.py. Its daemon and a controller in Python share one core at real-time priority. The
controller answers each frame at once, with the targets that are in shared memory. Predictive sampling writes them
there, from another process. It observes the plant, and plans all the time with 128 worlds in a daemon of its own. Both
are on the other core. Frames of a plan are as long as in the example. Without the planner, the same processes are there
and wait. Both sides run in turns, so that a machine that is busy for a while is busy for both.

A deadline is missed where a frame left more than a tenth of the period after it was due, or where its command was late.
Writes benches/results/MACHINE/planner.csv, and ends with 1 when the planner costs more deadlines than asked.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
from multiprocessing.sharedctypes import Synchronized
from multiprocessing.synchronize import Event
from pathlib import Path
from typing import Any

import numpy as np
from realtime import PERIOD, TURNS, from_python

import tightloop as tl

sys.path.insert(0, str(Path(__file__).parents[1]))
from record import REPOSITORY, print_table, write_results

sys.path.insert(0, str(REPOSITORY / "examples"))
from planning.arm import Arm
from planning.sampling import Sampling

PLANT_CORE, PLANNER_CORE = 1, 0
ASKED = 0.1  # [percentage points]
SIDES = ("without planner", "with planner")


def plan(name: str, targets: Any, busy: Event, ready: Event, plans: Synchronized[int]) -> None:
    """Plan for the plant of a name while `busy` is set; count the plans."""
    os.sched_setaffinity(0, {PLANNER_CORE})  # the daemon inherits it
    problem, out = Arm(), np.frombuffer(targets, np.float32)
    with (
        tl.attach(name) as plant,
        tl.launch(
            problem.scene(), worlds=problem.samples, threads=1, params=problem.params, fields=problem.fields
        ) as sim,
    ):
        problem.begin(sim, 0)
        planner = Sampling(problem, sim, 0)
        state = sim.snapshot().of_worlds([0])
        planner.update(state)
        ready.set()
        while True:
            busy.wait()
            seen = plant.latest()
            if seen is not None:
                # the same arm with longer frames
                state = tl.Snapshot.from_bytes(seen.state.tobytes()).with_model(sim.info["model_hash"])
            planner.update(state)
            out[:] = problem.full(planner.controls)
            with plans.get_lock():
                plans.value += 1


def main() -> int:
    """Measure in turns, print and write the results; 0 when the planner costs no more deadlines than asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=int, default=60, help="of each side, in all turns together")
    parser.add_argument("--priority", type=int, default=80, help="of SCHED_FIFO for the daemon, 0 for none")
    given = parser.parse_args()
    seconds = max(given.seconds // TURNS, 1)
    if not {PLANT_CORE, PLANNER_CORE} <= os.sched_getaffinity(0):
        parser.error(f"this machine has no cores {PLANT_CORE} and {PLANNER_CORE}")
    spawn = multiprocessing.get_context("spawn")
    problem = Arm()
    targets, plans = spawn.RawArray("f", problem.rest.tolist()), spawn.Value("l", 0)
    busy, ready = spawn.Event(), spawn.Event()
    scene = problem.scene()
    scene.dt, scene.substeps = PERIOD / 2, 2
    measured: dict[str, list[dict[str, float]]] = {side: [] for side in SIDES}
    with tl.launch(
        scene,
        worlds=1,
        threads=1,
        device="cpu",
        params=problem.params,
        fields=problem.fields,
        realtime=tl.RealTime(cores=(PLANT_CORE,), priority=given.priority or None),
    ) as plant:
        planner = spawn.Process(target=plan, args=(plant.name, targets, busy, ready, plans), daemon=True)
        planner.start()
        if notes := plant.info["notes"]:
            raise SystemExit(
                f"{'; '.join(notes)}: be root, set rtprio in /etc/security/limits.conf, or give --priority 0"
            )
        if not ready.wait(120):
            raise SystemExit("the planner did not start within 120 s")
        os.sched_setaffinity(0, {PLANT_CORE})
        if given.priority:  # the daemon goes first where both are due
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(given.priority - 1))
        problem.begin(plant, 0)
        for _ in range(TURNS):
            measured[SIDES[0]].append(from_python(plant, seconds, np.frombuffer(targets, np.float32)))
            busy.set()
            measured[SIDES[1]].append(from_python(plant, seconds, np.frombuffer(targets, np.float32)))
            busy.clear()
            if not planner.is_alive():
                raise SystemExit("the planner ended: without one, nothing is measured")
        planner.kill()
        planner.join()
    rows: list[dict[str, str | int]] = []
    missed = {}
    for side, turns in measured.items():
        frames, late = (sum(turn[key] for turn in turns) for key in ("frames", "late"))
        missed[side] = 100.0 * sum(turn["missed"] for turn in turns) / frames
        times = {f"{key}_us": f"{np.median([turn[key] for turn in turns]):.1f}" for key in ("p50", "p99", "p999")}
        row: dict[str, str | int] = {"side": side, "frames": f"{frames:.0f}", "missed_percent": f"{missed[side]:.3f}"}
        rows.append(row | {"late": f"{late:.0f}", **times, "worst_us": f"{max(turn['worst'] for turn in turns):.1f}"})
    more = missed[SIDES[1]] - missed[SIDES[0]]
    rows[0] |= {"plans_per_s": "–", "more_missed_points": "–", "asked_points": "–"}
    rows[1] |= {"plans_per_s": f"{plans.value / (TURNS * seconds):.0f}", "more_missed_points": f"{more:.3f}"}
    rows[1] |= {"asked_points": f"{ASKED}"}
    print_table(rows)
    command = f"python -m benches planner_beside_plant --seconds {TURNS * seconds} --priority {given.priority}"
    write_results("planner", rows, {"command": command, "period": "1 ms", "cores": os.cpu_count() or 1})
    print(f"the planner costs {more:.3f} percentage points of the deadlines, asked at most {ASKED}")
    return int(more > ASKED)


if __name__ == "__main__":
    sys.exit(main())
