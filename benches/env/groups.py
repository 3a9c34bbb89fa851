"""Steps per second with a policy in NumPy: all worlds at once, and two groups of which one steps meanwhile.

    python -m benches groups

Of FrankaReach as environments, and of its arm alone, driven by targets, through `launch`. Both sides have as many
worlds, the same policy on one thread, and all cores but one for the physics; they take turns in one run. Writes
benches/results/MACHINE/groups.csv.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, Protocol

sys.path.insert(0, str(Path(__file__).parents[1]))
from record import print_table, write_results

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # the policy is on one thread

import numpy as np

import tightloop as tl
from tightloop.env import VectorEnv, make_groups
from tightloop.tasks.reach import FrankaReach

WORLDS, HIDDEN = 4096, 128
CORES = len(os.sched_getaffinity(0))


class Policy:
    """Two hidden layers of tanh, with weights that were drawn once."""

    def __init__(self, inputs: int, actions: int) -> None:
        rng = np.random.default_rng(0)
        sizes = [inputs, HIDDEN, HIDDEN, actions]
        self._weights = [rng.normal(0, n**-0.5, (n, m)).astype(np.float32) for n, m in pairwise(sizes)]

    def __call__(self, obs: Any) -> Any:
        """Actions ``(worlds, actions)``."""
        for weights in self._weights:
            obs = np.tanh(obs @ weights)
        return obs


class Side(Protocol):
    """Worlds that are stepped in two halves."""

    worlds: int

    def reset(self) -> Any: ...

    def send(self, actions: Any) -> None: ...

    def recv(self) -> Any: ...

    def close(self) -> None: ...


class Environments:
    """Worlds of a task, whose observations the policy sees."""

    def __init__(self, env: VectorEnv) -> None:
        self._env, self.worlds = env, env.num_envs
        self.send, self.close = env.send, env.close

    def reset(self) -> Any:
        """Observations ``(worlds, inputs)``."""
        return self._env.reset(seed=0)[0]

    def recv(self) -> Any:
        """Likewise."""
        return self._env.recv()[0]


class Arms:
    """Worlds of an arm, of which the policy sees positions and velocities."""

    def __init__(self, sim: tl.Sim) -> None:
        self._sim, self.worlds, self.close = sim, sim.worlds, sim.close
        self._start = np.copy(sim.reset().joint_q)
        self._seen = np.zeros((sim.worlds, len(sim.coord_names) + len(sim.dof_names)), np.float32)

    def _see(self, frame: tl.Frame) -> Any:
        """Positions and velocities ``(worlds, coords + dofs)``."""
        return np.concatenate((frame.joint_q, frame.joint_qd), axis=1, out=self._seen)

    def reset(self) -> Any:
        """What the policy sees at the start."""
        return self._see(self._sim.reset())

    def send(self, actions: Any) -> None:
        """Targets within 0.2 rad of the start."""
        self._sim.send(joint_target_q=self._start + np.float32(0.2) * actions)

    def recv(self) -> Any:
        """What the policy sees next."""
        return self._see(self._sim.recv())


def run(sides: Sequence[Side], policy: Callable[[Any], Any], seconds: float) -> float:
    """World steps a second of all groups, each sent its actions as soon as it was received."""
    for side in sides:
        side.send(policy(side.reset()))
    steps, begin = 0, time.perf_counter()
    while time.perf_counter() - begin < seconds:
        for side in sides:
            side.send(policy(side.recv()))
            steps += side.worlds
    taken = time.perf_counter() - begin
    for side in sides:
        side.recv()
    return steps / taken


def measure(what: str, one: Sequence[Side], two: Sequence[Side], policy: Policy, args: Any) -> dict[str, Any]:
    """A row of the results."""
    rates = np.array([[run(sides, policy, args.seconds) for sides in (one, two)] for _ in range(args.rounds)])
    seen = one[0].reset()
    begin = time.perf_counter()
    for _ in range(20):
        policy(seen)
    policy_ms = (time.perf_counter() - begin) / 20 * 1e3
    for side in (*one, *two):
        side.close()
    median = np.median(rates, axis=0)
    ratio = float(np.median(rates[:, 1] / rates[:, 0]))
    row = {"what": what, "worlds": WORLDS, "threads": max(1, CORES - 1), "policy_ms": f"{policy_ms:.2f}"}
    return row | {"one": f"{median[0]:.0f}", "two_groups": f"{median[1]:.0f}", "ratio": f"{ratio:.2f}"}


def main() -> None:
    """Measure both in turns, print and write the results."""
    parser = argparse.ArgumentParser(description="One simulation, or two groups of worlds.")
    parser.add_argument("--rounds", type=int, default=9, help="turns of each side (default 9)")
    parser.add_argument("--seconds", type=float, default=2.0, help="of a turn (default 2)")
    args = parser.parse_args()
    threads = max(1, CORES - 1)
    env = VectorEnv("FrankaReach", WORLDS, copy=False, threads=threads)
    (inputs,), (actions,) = env.single_observation_space.shape, env.single_action_space.shape  # pyright: ignore
    groups = make_groups("FrankaReach", WORLDS, 2, copy=False, threads=threads)
    two = [Environments(group) for group in groups]
    rows = [measure("environments of FrankaReach", [Environments(env)], two, Policy(inputs, actions), args)]
    scene = FrankaReach().scene()
    sim = tl.launch(scene, worlds=WORLDS, threads=threads)
    sims = tl.launch(scene, worlds=WORLDS, threads=threads, groups=2)
    policy = Policy(len(sim.coord_names) + len(sim.dof_names), len(sim.dof_names))
    rows.append(measure("its arm through launch", [Arms(sim)], [Arms(group) for group in sims], policy, args))
    print_table(rows)
    write_results("groups", rows, {"command": f"python -m benches groups --rounds {args.rounds}", "cores": CORES})


if __name__ == "__main__":
    main()
