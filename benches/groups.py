"""Steps per second of FrankaReach with a policy in NumPy: one environment, and two groups of which one steps meanwhile.

    python benches/groups.py

Both sides have as many worlds, the same policy on one thread, and all cores but one for the physics; they take turns in
one run. Writes benches/results/MACHINE/groups.csv.
"""

from __future__ import annotations

import argparse
import os
import time
from itertools import pairwise
from typing import Any

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # the policy is on one thread

import numpy as np
from record import print_table, write_results

from tightloop.env import VectorEnv, make_groups

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


def run(envs: list[VectorEnv], policy: Policy, seconds: float) -> float:
    """Env steps a second of all groups, each sent its actions as soon as it was received."""
    for env in envs:
        env.send(policy(env.reset(seed=0)[0]))
    steps, begin = 0, time.perf_counter()
    while time.perf_counter() - begin < seconds:
        for env in envs:
            env.send(policy(env.recv()[0]))
            steps += env.num_envs
    taken = time.perf_counter() - begin
    for env in envs:
        env.recv()
    return steps / taken


def main() -> None:
    """Measure both in turns, print and write the results."""
    parser = argparse.ArgumentParser(description="One environment, or two groups of worlds.")
    parser.add_argument("--rounds", type=int, default=9, help="turns of each side (default 9)")
    parser.add_argument("--seconds", type=float, default=2.0, help="of a turn (default 2)")
    args = parser.parse_args()
    threads = max(1, CORES - 1)
    one = [VectorEnv("FrankaReach", WORLDS, copy=False, threads=threads)]
    two = make_groups("FrankaReach", WORLDS, 2, copy=False, threads=threads)
    (inputs,), (actions,) = one[0].single_observation_space.shape, one[0].single_action_space.shape  # pyright: ignore
    policy = Policy(inputs, actions)
    rates = np.array([[run(envs, policy, args.seconds) for envs in (one, two)] for _ in range(args.rounds)])
    obs = one[0].reset(seed=0)[0]
    begin = time.perf_counter()
    for _ in range(20):
        policy(obs)
    policy_ms = (time.perf_counter() - begin) / 20 * 1e3
    for env in (*one, *two):
        env.close()
    median = np.median(rates, axis=0)
    ratio = float(np.median(rates[:, 1] / rates[:, 0]))
    row = {"worlds": WORLDS, "threads": threads, "policy_ms": f"{policy_ms:.2f}", "one": f"{median[0]:.0f}"}
    rows = [row | {"two_groups": f"{median[1]:.0f}", "ratio": f"{ratio:.2f}"}]
    print_table(rows)
    write_results("groups", rows, {"command": f"python benches/groups.py --rounds {args.rounds}", "cores": CORES})


if __name__ == "__main__":
    main()
