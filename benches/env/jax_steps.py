"""Time of a step in a program of JAX, beside the same steps in a loop of Python.

    python -m benches jax_steps

A cart with a pole under random forces, and the task CartPoleBalance, with 1, 64 and 4096 worlds on one thread. A side
makes all its steps in a row, sides take turns, and the fastest of their turns counts. What a step costs beside
`sim.step` or `VectorEnv.step` is the difference. Writes benches/results/MACHINE/jax_steps.csv.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))
import jax
import numpy as np
from jax import lax
from record import print_table, write_results

import tightloop as tl
from tightloop.adapters.jax import JaxEnv, JaxSim
from tightloop.assets import CARTPOLE
from tightloop.env import VectorEnv

WORLDS, STEPS, WAYS = (1, 64, 4096), {1: 2000, 64: 2000, 4096: 300}, ("ffi", "io_callback")


def of_simulation(worlds: int, given: Any) -> Iterator[tuple[str, Callable[[], Any]]]:
    """Steps of a simulation, each side with the same forces."""
    scene = tl.Scene(dt=1 / 200, substeps=4)
    scene.add_urdf(CARTPOLE, name="cart")
    forces = np.concatenate([given, np.zeros_like(given)], axis=2)
    with tl.launch(scene, worlds=worlds, threads=1) as sim:

        def loop() -> None:
            for force in forces:
                frame = sim.step(joint_f=force)
                _ = frame.joint_q, frame.joint_qd  # views are made when they are read

        yield "sim.step, Python", loop
        for via in WAYS:
            made = JaxSim(sim, via=via)
            program = jax.jit(partial(lax.scan, lambda token, force, made=made: made.step(token, joint_f=force)))
            on_device = jax.numpy.asarray(forces)
            yield f"JaxSim, {via}", lambda made=made, run=program, x=on_device: run(made.token(), x)


def of_task(worlds: int, given: Any) -> Iterator[tuple[str, Callable[[], Any]]]:
    """Steps of a task, each side with the same actions."""
    envs = VectorEnv("CartPoleBalance", worlds, threads=1, autoreset_mode="SAME_STEP", copy=False)
    actions = jax.numpy.asarray(given)

    def loop() -> None:
        envs.reset(seed=0)
        for action in given:
            envs.step(action)

    yield "VectorEnv.step, Python", loop
    for via in WAYS:
        env = JaxEnv(envs, via=via)

        def step(state: Any, action: Any, env: JaxEnv = env) -> tuple[Any, Any]:
            state, *results = env.step(state, action)
            return state, results

        program = jax.jit(partial(lax.scan, step))
        yield f"JaxEnv, {via}", lambda env=env, run=program: run(env.reset(0)[0], actions)
    envs.close()


def measured(sides: list[tuple[str, Callable[[], Any]]], steps: int, rounds: int) -> dict[str, float]:
    """The time of a step of each side [us], the least of its turns."""
    least = {name: float("inf") for name, _ in sides}
    for turn in range(rounds + 1):
        for name, side in sides:
            begin = time.perf_counter()
            jax.block_until_ready(side())
            took = (time.perf_counter() - begin) / steps * 1e6
            if turn > 0:  # the first compiles
                least[name] = min(least[name], took)
    return least


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description="Time of a step in a program of JAX.")
    parser.add_argument("--rounds", type=int, default=7)
    rounds = parser.parse_args().rounds
    rows: list[dict[str, str | int]] = []
    for sides_of in (of_simulation, of_task):
        for worlds in WORLDS:
            given = np.random.default_rng(0).uniform(-1, 1, (STEPS[worlds], worlds, 1)).astype(np.float32)
            sides = sides_of(worlds, given)
            # closed when all are measured
            made = [next(sides) for _ in range(len(WAYS) + 1)]
            least = measured(made, STEPS[worlds], rounds)
            base = next(iter(least.values()))
            for name, took in least.items():
                rows.append(
                    {"worlds": worlds, "side": name, "us_a_step": f"{took:.1f}", "more_us": f"{took - base:.1f}"}
                )
            next(sides, None)
    print_table(rows)
    write_results(
        "jax_steps", rows, {"command": f"python -m benches jax_steps --rounds {rounds}", "jax": jax.__version__}
    )


if __name__ == "__main__":
    main()
