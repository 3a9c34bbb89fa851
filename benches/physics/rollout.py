"""Time of rollouts of 4096 command sequences, and of copying one world into 4096.

    python -m benches rollout

A rollout has 20 frames of 4 substeps. `contact-free` is the arm of the first lesson under random torques. `contacts` is
the grasp, whose arm holds its cube half-way up, with random targets. Each is measured in parts, in turns:

- `copy_from`: the state of a simulation of one world into all worlds, across two daemons;
- `physics`: 20 steps with the commands of each world, of a daemon that evaluates no field;
- `steps`: the same with the fields, without copies of them;
- `rollout`: `Sim.rollout` into arrays that are there, from where the worlds are;
- `cost`: the same with a cost instead of stored fields;
- `rollout from start`: `copy_from` and `rollout`, as a planner calls it.

Writes benches/results/MACHINE/rollout.csv, and ends with 1 when a median of `rollout` is above what was asked.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

import tightloop as tl

sys.path.insert(0, str(Path(__file__).parents[1]))
from record import REPOSITORY, print_table, write_results

sys.path[:0] = [str(REPOSITORY / "examples")]
import franka_grasp as grasp  # noqa: E402  (the examples are no package)
import franka_lesson as lesson  # noqa: E402

WORLDS, FRAMES, SUBSTEPS = 4096, 20, 4
FIELDS = ("joint_q", "joint_qd")
# Frames of the grasp before the rollouts: the cube is held, half-way up
HELD = 120
ASKED_MS = {"contact-free": 30.0, "contacts": 150.0}


def contact_free() -> tuple[tl.Scene, tl.Sim, dict[str, Any]]:
    """The arm under torques: scene, plant, commands."""
    scene = lesson.scene(driven=False)
    scene.substeps = SUBSTEPS
    torques = np.random.default_rng(0).uniform(-5, 5, (FRAMES, WORLDS, 9)).astype(np.float32)
    return scene, tl.launch(scene, worlds=1, fields=FIELDS), {"joint_f": torques}


def contacts() -> tuple[tl.Scene, tl.Sim, dict[str, Any]]:
    """The grasp around its targets: scene, plant, commands."""
    scene = grasp.scene()
    plant = tl.launch(scene, worlds=1, fields=FIELDS)
    for goal in grasp.targets()[:HELD]:
        plant.step(joint_target_q={"arm": goal})
    # the planner has shorter frames
    scene.substeps = SUBSTEPS
    short = tl.launch(scene, worlds=1, fields=FIELDS)
    short.restore(plant.snapshot().with_model(short.info["model_hash"]))
    plant.close()
    noise = np.random.default_rng(0).uniform(-0.02, 0.02, (FRAMES, WORLDS, 9)) * (np.arange(9) < 7)
    targets = np.zeros((FRAMES, WORLDS, len(short.dof_names)), np.float32)
    targets[..., short.dofs["arm"]] = grasp.targets()[HELD] + noise
    return scene, short, {"joint_target_q": targets}


def measure(what: str, rounds: int) -> tuple[list[dict[str, str | int]], str]:
    """Return the rows of one case, and the device."""
    scene, plant, commands = {"contact-free": contact_free, "contacts": contacts}[what]()
    with (
        plant,
        tl.launch(scene, worlds=WORLDS, fields=FIELDS) as plan,
        tl.launch(scene, worlds=WORLDS, fields=()) as bare,
    ):

        def steps(sim: tl.Sim) -> None:
            for frame in range(FRAMES):
                sim.step(**{name: array[frame] for name, array in commands.items()})

        def cost(frame: tl.Frame) -> np.ndarray:
            return np.einsum("ij,ij->i", frame.joint_q, frame.joint_q)

        stored, summed = plan.rollout(commands), plan.rollout(commands, cost=cost)
        # each part begins from the same state, which is not timed but for the first and the last
        calls: dict[str, tuple[tl.Sim, Callable[[], object]]] = {
            "copy_from": (plan, lambda: plan.copy_from(plant)),
            "physics": (bare, lambda: steps(bare)),
            "steps": (plan, lambda: steps(plan)),
            "rollout": (plan, lambda: plan.rollout(commands, out=stored)),
            "cost": (plan, lambda: plan.rollout(commands, cost=cost, out=summed)),
            "rollout from start": (plan, lambda: plan.rollout(commands, start=plant, out=stored)),
        }
        times: dict[str, list[float]] = {part: [] for part in calls}
        # the first tenth warms caches and clocks
        for number in tqdm(range(rounds + rounds // 10 + 1), desc=what, disable=None):
            for part, (sim, call) in calls.items():
                sim.copy_from(plant)
                begin = time.perf_counter()
                call()
                if number > rounds // 10:
                    times[part].append(time.perf_counter() - begin)
        assert not stored.faulted.any() and not summed.faulted.any()
        device = plan.device
    rows: list[dict[str, str | int]] = []
    for part, seen in times.items():
        ms = 1e3 * np.array(seen)
        asked = f"{ASKED_MS[what]:.0f}" if part == "rollout" else "–"
        median = f"{np.median(ms):.2f}"
        row = {"case": what, "part": part, "median_ms": median, "p99_ms": f"{np.percentile(ms, 99):.2f}"}
        rows.append({**row, "asked_ms": asked})
    return rows, device


def main() -> int:
    """Measure, print and write the results; 0 when the rollouts are as fast as asked."""
    parser = argparse.ArgumentParser(description="Time of rollouts of 4096 command sequences.")
    parser.add_argument("--rounds", type=int, default=50, help="rounds that count (default 50)")
    rounds = parser.parse_args().rounds
    rows, device = [], ""
    for what in ASKED_MS:
        measured, device = measure(what, rounds)
        rows += measured
    print_table(rows)
    facts = {"worlds": WORLDS, "frames": FRAMES, "substeps": SUBSTEPS, "fields": " ".join(FIELDS)}
    write_results(
        "rollout", rows, {"command": f"python -m benches rollout --rounds {rounds}", "device": device} | facts
    )
    slow = [row for row in rows if row["asked_ms"] != "–" and float(row["median_ms"]) > float(row["asked_ms"])]
    for late in slow:
        print(f"{late['case']}, {late['part']}: {late['median_ms']} ms, asked {late['asked_ms']}")
    return int(bool(slow))


if __name__ == "__main__":
    sys.exit(main())
