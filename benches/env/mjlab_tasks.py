"""Environment steps per second of mjlab's tasks of the G1 and the Go1, with three classes behind its `Simulation`.

    pip install 'mjlab==1.6.*'    # beside tightloop
    python -m benches mjlab_tasks

Each side is a process with mjlab's own managers, on torch and the CPU:

- MuJoCo-Warp: mjlab's own `Simulation`, on Warp's CPU device;
- mjbatch: MuJoCo C on a pool of threads, benches/env/mjbatch_simulation.py. mjlab asks for MuJoCo 3.11, and PyPI's
  mjbatch 0.1.4 for MuJoCo 3.14. This side alone gets mjbatch with its MuJoCo from out/mjbatch, made by the first run,
  and mjlab and MuJoCo-Warp run with it unchanged;
- tightloop: `tightloop.adapters.mjlab`.

All sides use the same cores, torch with OMP_WAIT_POLICY=passive, and random actions that deviate as those of an
untrained policy. Robots fall and episodes begin anew: `ends_per_1000` counts ends in 1000 environment steps. Sides
take turns, so that a machine that changes its speed changes all of them, and ratios are taken within a round. `ratio`
is tightloop with the most worlds over the row. `ratio_same_worlds` is tightloop with as many worlds. MuJoCo-Warp has
the fewest worlds only, since a step of 4096 takes it seconds.

The milliseconds are those of a control step: four physics steps, an evaluation of all fields, and the rest, which is
mjlab's managers in torch.

Not the same: MuJoCo C computes in double precision. Writes benches/results/MACHINE/mjlab_tasks.csv; ends with 1 where
a ratio is missed.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import tightloop as tl

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parents[1] / "physics"))
from mujoco_models import ENVIRONMENT, Peer, mjbatch_python
from record import REPOSITORY, print_table, write_results

TASKS = ("Mjlab-Velocity-Flat-Unitree-G1", "Mjlab-Velocity-Flat-Unitree-Go1")
WARP, MJBATCH, OURS = "MuJoCo-Warp on the CPU", "mjbatch", "tightloop"
#: `ratio` that is asked over each side, where it has the most worlds.
ASKED = {WARP: 30.0, MJBATCH: 8.0}
CORES = 2


class Run(NamedTuple):
    """A side with so many worlds."""

    side: str
    worlds: int


def peer(side: str) -> Peer:
    """Start the process of a side."""
    # threads of torch that wait for work else spin on the cores of the physics
    environ = {"OMP_WAIT_POLICY": "passive"}
    if side == MJBATCH:
        mjbatch_python()
        packages = ENVIRONMENT / f"lib/python{sys.version_info.major}.{sys.version_info.minor}/site-packages"
        if not (packages / "mjbatch").exists():
            raise SystemExit(f"{ENVIRONMENT} is of another Python than this one; remove it")
        environ["PYTHONPATH"] = os.pathsep.join([str(packages), *filter(None, [os.environ.get("PYTHONPATH")])])
    return Peer(side, [sys.executable, REPOSITORY / "benches/env/mjlab_side.py", side], environ)


def measure(task: str, given: argparse.Namespace, versions: dict[str, str]) -> list[dict[str, str | int]]:
    """Measure all sides of a task in turns; returns their rows."""
    runs = [Run(WARP, min(given.worlds))]
    runs += [Run(side, worlds) for side in (MJBATCH, OURS) for worlds in sorted(given.worlds)]
    peers: dict[Run, Peer] = {}
    answers: dict[Run, list[dict[str, float]]] = {run: [] for run in runs}
    try:
        for run in runs:
            peers[run] = peer(run.side)
            peers[run].ask("start", task=task, worlds=run.worlds, settle=given.settle)
            print(f"{task}: {run.side} with {run.worlds} worlds is ready", flush=True)
        for count in range(given.rounds + 1):
            for run in runs:
                answer = peers[run].ask("turn", seconds=given.seconds)
                # the first round warms caches and clocks
                answers[run] += [answer] if count else []
    finally:
        for at_work in peers.values():
            at_work.close()
    for run in runs:
        theirs = peers[run].versions
        if run.side == MJBATCH:
            theirs = {"mjbatch": theirs["mjbatch"], "mujoco_of_mjbatch": theirs["mujoco"]}
        versions |= theirs
    return [row(task, run, answers) for run in runs]


def row(task: str, run: Run, answers: dict[Run, list[dict[str, float]]]) -> dict[str, str | int]:
    """Medians of a side, and ratios of tightloop to it."""

    def median(name: str) -> float:
        return float(np.median([answer[name] for answer in answers[run]]))

    def ratio(worlds: int) -> float:
        rates = [np.array([answer["env_steps_per_s"] for answer in answers[key]]) for key in (Run(OURS, worlds), run)]
        return float(np.median(rates[0] / rates[1]))

    most = max(key.worlds for key in answers)
    is_largest = run.worlds == max(key.worlds for key in answers if key.side == run.side)
    return {
        "task": task,
        "side": run.side,
        "worlds": run.worlds,
        "env_steps_per_s": f"{median('env_steps_per_s'):.0f}",
        **{f"{part}_ms": f"{median(f'{part}_ms'):.1f}" for part in ("physics", "forward", "rest")},
        "ends_per_1000": f"{median('ends_per_1000'):.1f}",
        "ratio_same_worlds": f"{ratio(run.worlds):.2f}",
        "ratio": f"{ratio(most):.2f}",
        "asked_ratio": f"{ASKED[run.side]:.0f}" if run.side in ASKED and is_largest else "–",
    }


def missed(rows: list[dict[str, str | int]]) -> bool:
    """Print asked and measured ratios; whether any is missed."""
    slow = False
    for each in rows:
        if each["asked_ratio"] != "–":
            short = float(each["ratio"]) < float(each["asked_ratio"])
            verdict = "missed" if short else "met"
            print(
                f"{each['task']}, {each['side']} with {each['worlds']} worlds: asked {each['asked_ratio']}, "
                f"measured {each['ratio']}: {verdict}"
            )
            slow |= short
    return slow


def main() -> int:
    """Measure, print and write the results."""
    parser = argparse.ArgumentParser(description="mjlab's tasks with MuJoCo-Warp, mjbatch and tightloop, on two cores.")
    parser.add_argument("--tasks", nargs="+", default=list(TASKS), help="names of tasks (default: of G1 and Go1)")
    parser.add_argument("--worlds", type=int, nargs="+", default=[256, 4096], help="worlds (default 256 4096)")
    parser.add_argument("--rounds", type=int, default=5, help="rounds that count (default 5)")
    parser.add_argument("--seconds", type=float, default=5.0, help="length of a turn [s] (default 5)")
    parser.add_argument("--settle", type=int, default=80, help="control steps before the rounds (default 80)")
    parser.add_argument("--dry-run", action="store_true", help="write no file")
    given = parser.parse_args()
    cores = sorted(os.sched_getaffinity(0))[-CORES:]
    os.sched_setaffinity(0, cores)
    versions: dict[str, Any] = {}
    rows = [each for task in given.tasks for each in measure(task, given, versions)]
    print_table(rows)
    if not given.dry_run:
        facts = {
            "command": " ".join(["python -m benches mjlab_tasks", *sys.argv[1:]]),
            "cores": len(cores),
            "load_1_minute": f"{os.getloadavg()[0]:.1f}",
            "tightloop": tl.__version__,
            **versions,
        }
        write_results("mjlab_tasks", rows, facts)
    return int(missed(rows))


if __name__ == "__main__":
    sys.exit(main())
