"""Model predictive control in real time: a cart swings its pole up, and an arm holds its hand and evades a ball.

    python examples/mpc.py cartpole --planner ilqr --seeds 20
    python examples/mpc.py arm --realtime --view

The plant is a daemon with one world, and the planner works in another one with a world per rollout. While a frame of
the plant runs, the planner computes the command of the next frame. With --realtime, the plant keeps to real time on a
core of its own and holds the last command when the planner is late. Otherwise it waits for the planner.
"""

from __future__ import annotations

import argparse
import os
import time
from contextlib import ExitStack

import numpy as np
from planning.arm import Arm
from planning.cartpole import CartPole
from planning.ilqr import ILQR
from planning.problem import Problem
from planning.sampling import Sampling

import tightloop as tl

PROBLEMS = {"cartpole": CartPole, "arm": Arm}
PLANT_CORE, PLANNER_CORE = 1, 0


class Still:
    """No planner: the command of the problem without a plan."""

    def __init__(self, problem: Problem) -> None:
        self.controls = problem.rest[list(problem.columns)]

    def update(self, state: tl.Snapshot) -> None:
        """Keep the controls."""


def run(problem: Problem, planner: Sampling | ILQR | Still, plant: tl.Sim, seed: int) -> list[float]:
    """Run the plant with a planner; return how long the planner took for each frame [s]."""
    problem.begin(plant, seed)
    times = []
    for frame in range(round(problem.duration / problem.seconds)):
        problem.between(plant, frame)
        state = plant.snapshot()
        plant.send(**{problem.command: problem.full(planner.controls)})
        begin = time.perf_counter()
        planner.update(state)
        times.append(time.perf_counter() - begin)
        problem.observe(plant.recv())
    return times


def make(kind: str, problem: Problem, stack: ExitStack) -> tl.Sim | None:
    """Launch the simulation of a planner; "none" has none."""
    if kind == "none":
        return None
    worlds = problem.samples if kind == "sampling" else ILQR.worlds
    return stack.enter_context(
        tl.launch(problem.scene(), worlds=worlds, threads=1, params=problem.params, fields=problem.fields)
    )


def planner_of(kind: str, problem: Problem, plan: tl.Sim | None, seed: int) -> Sampling | ILQR | Still:
    """Return a planner for a run."""
    if plan is None:
        return Still(problem)
    if kind == "ilqr":
        assert isinstance(problem, CartPole), "the problem has no residuals"
        return ILQR(problem, plan, seed)
    return Sampling(problem, plan, seed)


def main() -> None:
    """Run the problem once per seed."""
    parser = argparse.ArgumentParser(description="Model predictive control in real time.")
    parser.add_argument("problem", nargs="?", choices=PROBLEMS, default="cartpole")
    parser.add_argument("--planner", choices=("sampling", "ilqr", "none"), default="sampling")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--realtime", action="store_true", help="keep to real time; else the plant waits for plans")
    parser.add_argument("--view", action="store_true", help="open the viewer")
    given = parser.parse_args()
    problem = PROBLEMS[given.problem]()
    if given.planner == "ilqr" and not isinstance(problem, CartPole):
        parser.error(f"{given.problem} has no residuals for ilqr; choose --planner sampling")
    cores = os.sched_getaffinity(0)
    separate = given.realtime and {PLANT_CORE, PLANNER_CORE} <= cores
    realtime = tl.RealTime(late="hold", cores=(PLANT_CORE,) if separate else ()) if given.realtime else None
    with ExitStack() as stack:
        plant = stack.enter_context(
            tl.launch(problem.scene(), worlds=1, params=problem.params, fields=problem.fields, realtime=realtime)
        )
        if separate:
            os.sched_setaffinity(0, {PLANNER_CORE})  # the planner's daemon inherits it
        plan = make(given.planner, problem, stack)
        if given.view:
            plant.view(open=True)
        done = []
        for seed in range(given.seeds):
            planner = planner_of(given.planner, problem, plan, seed)
            plant.restart_timing()
            times = 1e3 * np.array(run(problem, planner, plant, seed))
            success, text = problem.judge()
            done.append(success)
            late = f", {plant.timing.late} frames without a new command" if given.realtime else ""
            p50, p99 = np.percentile(times, [50, 99])
            print(f"seed {seed}: {text}; {p50:.1f} ms per plan, p99 {p99:.1f}, of {1e3 * problem.seconds:.0f} ms{late}")
    print(f"{sum(done)} of {len(done)} seeds succeed")


if __name__ == "__main__":
    main()
