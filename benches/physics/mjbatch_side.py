"""The side of PyPI's mjbatch in benches/physics/mujoco_models.py: a process with an environment of its own.

It reads a line of JSON for each thing to do, and answers each with one.
"""

from __future__ import annotations

import json
import sys
import time
from importlib.metadata import version
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from mjbatch import Batch  # pyright: ignore[reportMissingImports]
from mujoco_robots import ROBOTS, contacts_of

# Warnings after which MuJoCo resets a simulation
UNSTABLE = [int(getattr(mujoco.mjtWarning, f"mjWARN_BAD{name}")) for name in ("QPOS", "QVEL", "QACC")]


class Side:
    """What mjbatch runs at the moment."""

    def robot(self, name: str, reference: str) -> dict[str, Any]:
        """Compile a model."""
        self.model = ROBOTS[name].model(Path(reference))
        sizes = [self.model.nq, self.model.nv, self.model.nu, self.model.na, self.model.ngeom]
        return {"sizes": [int(size) for size in sizes], "mass": float(self.model.body_mass.sum())}

    def start(self, worlds: int, nstep: int, state: str, ctrl: str) -> dict[str, Any]:
        """Place simulations at the states of a file, with the ctrl of another."""
        self.batch = Batch(self.model, worlds, num_threads=1)
        self.nstep, self.given, self.frame = nstep, np.load(ctrl), 0
        self.state = {name: self.batch.bind(name) for name in ("qpos", "qvel", "act") if name != "act" or self.model.na}
        self.ctrl, self.warnings = self.batch.bind("ctrl"), self.batch.bind("warning")
        with np.load(state) as values:
            for name, array in self.state.items():
                array[:] = values[name]
        return {}

    def turn(self, seconds: float) -> dict[str, Any]:
        """Step for that long, and at least once; returns physics steps of one world per second, and per CPU second."""
        calls, before, begin = 0, time.process_time(), time.perf_counter()
        while (passed := time.perf_counter() - begin) < seconds:
            self.ctrl[:] = self.given[self.frame % len(self.given)]
            self.batch.step(nstep=self.nstep)
            self.frame += 1
            calls += 1
        steps = calls * len(self.ctrl) * self.nstep
        return {"rates": [steps / passed, steps / (time.process_time() - before)]}

    def end(self, sampled: int) -> dict[str, Any]:
        """Contacts, Newton iterations from a cold start, and how many simulations MuJoCo had to reset."""
        state = {name: array[:sampled] for name, array in self.state.items()}
        contacts, iterations = contacts_of(self.model, state, self.ctrl[:sampled])
        # of each warning its last info and its count
        unstable = (self.warnings[:, UNSTABLE, 1] > 0).any(axis=1)
        return {"contacts": contacts, "iterations": iterations, "unstable": int(unstable.sum())}


def main() -> None:
    """Do what the lines of stdin say, until it closes."""
    side = Side()
    print(json.dumps({"mjbatch": version("mjbatch"), "mujoco": mujoco.__version__}), flush=True)
    for line in sys.stdin:
        request = json.loads(line)
        print(json.dumps(getattr(side, request.pop("do"))(**request)), flush=True)


if __name__ == "__main__":
    main()
