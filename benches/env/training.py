"""How long legged robots take to learn to walk with the presets of examples/ppo.py, and how many steps.

    pip install matplotlib onnx onnxscript tensorboard torch tqdm && pip install --no-deps mjlab==1.6.0
    python -m benches training                    # G1, Go1 and the quadruped, seeds 0, 1 and 2, one after the other
    python -m benches training --runs G1 --seeds 0 --keep

A run is at its goal at the first evaluation from which all are better than the goal: mean velocity error and share of
falls over 256 episodes of 20 s, with random commands and pushes. Evaluations take a part of the time. Nothing else
should run beside it. With ``--keep`` curves and the first seed's policy go to examples/trained.
"""

from __future__ import annotations

import argparse
import csv
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).parents[1]))
from record import REPOSITORY, print_table, write_results

TRAINED = REPOSITORY / "examples/trained"


class Run(NamedTuple):
    """A training.

    Attributes:
        task: The task.
        model: The robot; None for the task's own.
        error: Greatest velocity error of the goal [m/s].
        falls: Greatest share of falls of the goal.
    """

    task: str
    model: str | None
    error: float
    falls: float

    @property
    def name(self) -> str:
        """Name of its folders and files."""
        return self.task if self.model is None else f"{self.task}-{self.model}"


RUNS = {
    "G1": Run("HumanoidVelocityFlat", "unitree_g1", 0.15, 0.02),
    "Go1": Run("QuadrupedVelocityFlat", "unitree_go1", 0.15, 0.02),
    "quadruped": Run("QuadrupedVelocityFlat", None, 0.15, 0.01),
}


def at_goal(curve: Sequence[dict[str, float]], run: Run) -> dict[str, float] | None:
    """Return the first evaluation from which all are better than the goal; None if the last one is not."""
    reached = None
    for row in reversed(curve):
        if row["velocity_error"] >= run.error or row["fell"] >= run.falls:
            break
        reached = row
    return reached


def train(run: Run, seed: int, out: Path, minutes: float | None) -> dict[str, str | int]:
    """Train once; returns a row of the table.

    Raises:
        SystemExit: The training failed.
    """
    command = [sys.executable, str(REPOSITORY / "examples/ppo.py"), run.task, "--seed", str(seed), "--out", str(out)]
    command += [] if run.model is None else ["--model", run.model]
    command += [] if minutes is None else ["--minutes", str(minutes)]
    done = subprocess.run(command, cwd=REPOSITORY, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{' '.join(command[1:])} failed with exit code {done.returncode}")
    with (out / f"{run.name}-{seed}/curve.csv").open() as file:
        curve = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]
    last, goal = curve[-1], at_goal(curve, run)
    # on episodes that no evaluation before had
    final = {name: re.findall(rf"{name} ([\d.e-]+) \(", done.stdout)[-1] for name in ("velocity_error", "fell")}
    return {
        "seed": seed,
        "minutes": f"{last['seconds'] / 60:.1f}",
        "steps_M": f"{last['steps'] / 1e6:.1f}",
        "steps_per_s": f"{last['steps'] / last['seconds']:.0f}",
        "goal_minutes": "–" if goal is None else f"{goal['seconds'] / 60:.1f}",
        "goal_steps_M": "–" if goal is None else f"{goal['steps'] / 1e6:.1f}",
        "error_mps": f"{float(final['velocity_error']):.3f}",
        "falls_percent": f"{100 * float(final['fell']):.1f}",
    }


def keep(run: Run, seeds: Sequence[int], out: Path) -> None:
    """Copy the curves of all seeds, and the picture and policy of the first one, to examples/trained."""
    for seed in seeds:
        curve = TRAINED / f"curves/{run.name}/{seed}.csv"
        curve.parent.mkdir(exist_ok=True)
        shutil.copy(out / f"{run.name}-{seed}/curve.csv", curve)
    first = out / f"{run.name}-{seeds[0]}"
    shutil.copy(first / "curve.png", TRAINED / f"plots/{run.name}-{seeds[0]}.png")
    shutil.copy(first / "policy.onnx", TRAINED / f"{run.name}.onnx")


def main() -> None:
    """Train all, and write the table."""
    parser = argparse.ArgumentParser(description="Measure how long robots take to learn to walk.")
    parser.add_argument("--runs", nargs="+", choices=RUNS, default=[*RUNS], help="which (default all)")
    parser.add_argument("--seeds", nargs="+", type=int, default=[0, 1, 2], help="of weights and episodes")
    parser.add_argument("--minutes", type=float, help="of each training, instead of the preset's")
    parser.add_argument("--out", type=Path, default=REPOSITORY / "out/training", help="folder of all runs")
    parser.add_argument("--keep", action="store_true", help="copy curves and policies to examples/trained")
    args = parser.parse_args()
    rows: list[dict[str, str | int]] = []
    for name in args.runs:
        for seed in args.seeds:
            rows.append({"robot": name, **train(RUNS[name], seed, args.out, args.minutes)})
            print_table(rows)
        if args.keep:
            keep(RUNS[name], args.seeds, args.out)
    goals = "; ".join(f"{name} error < {RUNS[name].error} m/s, falls < {RUNS[name].falls:.0%}" for name in args.runs)
    facts = {
        "command": "python -m benches training",
        "cores": os.cpu_count() or 1,
        "seeds": ", ".join(map(str, args.seeds)),
        "goals": goals,
    }
    write_results("training", rows, facts)


if __name__ == "__main__":
    main()
