"""Records the lesson's torques, targets and grasp on this machine, for a replay on another processor.

PYTHONPATH=examples python tests/aarch64/record_lessons.py FOLDER
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import franka_grasp as grasp
import franka_lesson as lesson
import numpy as np

import tightloop as tl

WORLDS = 20  # a block that is not full, with 8 and with 16 lanes
FRAMES = 120


def record(path: Path, scene: tl.Scene, precision: str, step: Callable[[tl.Sim, int], object]) -> None:
    """Record frames of a simulation; ``step`` sends the command of one frame."""
    with tl.launch(scene, worlds=WORLDS, precision=precision, fields=("joint_q", "joint_qd")) as sim:
        command = [sys.executable, "-m", "tightloop", "record", sim.name, str(path), "--fields", "joint_q,joint_qd"]
        with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as recorder:
            assert recorder.stderr is not None
            said = recorder.stderr.readline()  # it says that it records
            for frame in range(FRAMES):
                step(sim, frame)
            sim.close()
            if recorder.wait():
                raise SystemExit(said + recorder.stderr.read())


def main() -> None:
    """Record each lesson in both precisions."""
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    amplitudes = np.linspace(0.5, 1.0, WORLDS)
    goals = grasp.targets()
    lessons: dict[str, tuple[tl.Scene, Callable[[tl.Sim, int], object]]] = {
        "torques": (
            lesson.scene(driven=False),
            lambda sim, frame: sim.step(joint_f=lesson.torques(frame, amplitudes)),
        ),
        "targets": (
            lesson.scene(driven=True),
            lambda sim, frame: sim.step(joint_target_q=lesson.targets(frame, amplitudes)),
        ),
        "grasp": (grasp.scene(), lambda sim, frame: sim.step(joint_target_q={"arm": goals[frame]})),
    }
    for name, (scene, step) in lessons.items():
        for precision in ("f32", "f64"):
            record(folder / f"{name}_{precision}.tlrec", scene, precision, step)


if __name__ == "__main__":
    main()
