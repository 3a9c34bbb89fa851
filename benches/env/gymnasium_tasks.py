"""Steps per second of gymnasium's Ant and Humanoid on one core, beside gymnasium's SyncVectorEnv and envpool.

    make bench-env                                # installs envpool
    .venv/bin/python -m benches gymnasium_tasks

NumPy in and out, random actions, episodes that end begin anew. All processes of a side share one core, the daemon of
tightloop's included. Sides:

- ``tightloop/Ant-v5`` and ``tightloop/Humanoid-v5``, float32, which return new arrays of float64 as gymnasium does;
- gymnasium's own ``Ant-v5`` and ``Humanoid-v5`` in a `SyncVectorEnv`;
- envpool's ``Ant-v4`` and ``Humanoid-v4`` with one thread, where it is installed. Ant-v4 observes 27 numbers, and its
  states go on alike; Humanoid-v4 observes 376.

Each side tries several numbers of environments, and the fastest is measured. Then the sides take turns, so that a
machine that changes its speed changes all of them; ratios are taken within a round. Rates are by the clock, and by the
processor time of all processes of a side, which other programs change less. Writes
benches/results/MACHINE/gymnasium_tasks.csv.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium
import mujoco
import numpy as np
from gymnasium.vector import SyncVectorEnv

import tightloop as tl
import tightloop.env

sys.path.insert(0, str(Path(__file__).parents[1]))
from record import print_table, write_results

try:
    import envpool
except ImportError:
    envpool = None

OURS, SYNC, ENVPOOL = "tightloop", "gymnasium SyncVectorEnv", "envpool"
TASKS = ("Ant", "Humanoid")
#: Environment steps of ours over those of the others.
ASKED = 15.0
#: Environments that are tried of each side.
TRIED = {OURS: (512, 1024, 2048), SYNC: (1, 8), ENVPOOL: (8, 64)}
ACTIONS = 32  # arrays of random actions, drawn before the clock starts
TRIED_S, MEASURED_S, SETTLED_S = 1.5, 3.0, 2.0
TICKS = os.sysconf("SC_CLK_TCK")


class Rate(NamedTuple):
    """Environment steps a second, and a second of processor time."""

    by_clock: float
    by_core: float


class Side:
    """A vector environment at work."""

    def __init__(self, side: str, task: str, envs: int) -> None:
        self._others: list[int] = []  # processes
        self.env: Any
        if side == OURS:
            self.env = gymnasium.make_vec(f"tightloop/{task}-v5", num_envs=envs, threads=1, device="cpu")
            self._others = [self.env.unwrapped.sim.pid]
        elif side == SYNC:
            self.env = SyncVectorEnv([lambda: gymnasium.make(f"{task}-v5")] * envs, copy=False)
        else:
            assert envpool is not None
            self.env = envpool.make_gymnasium(f"{task}-v4", num_envs=envs, num_threads=1, seed=0)
        space = gymnasium.spec(f"{task}-v5").make().action_space
        assert isinstance(space, gymnasium.spaces.Box)
        rng = np.random.default_rng(0)
        dtype = np.float64 if side == ENVPOOL else np.float32
        shape = (envs, *space.shape)
        self._actions = [rng.uniform(space.low, space.high, shape).astype(dtype) for _ in range(ACTIONS)]
        self._count = 0
        self.envs = envs
        self.env.reset(**({} if side == ENVPOOL else {"seed": 0}))

    def rate(self, seconds: float) -> Rate:
        """Steps for so long."""
        begin, worked, steps = time.perf_counter(), self._worked(), 0
        while (taken := time.perf_counter() - begin) < seconds:
            self._count += 1
            self.env.step(self._actions[self._count % ACTIONS])
            steps += self.envs
        return Rate(steps / taken, steps / (self._worked() - worked))

    def _worked(self) -> float:
        """Processor time so far [s]."""
        stats = [Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split() for pid in self._others]
        return time.process_time() + sum(int(stat[11]) + int(stat[12]) for stat in stats) / TICKS

    def close(self) -> None:
        """End it."""
        self.env.close()


def best(side: str, task: str) -> Side:
    """Return the side with the number of environments with which it is fastest."""
    rates: dict[int, float] = {}
    for envs in TRIED[side]:
        at_work = Side(side, task, envs)
        # until episodes end at random times
        at_work.rate(SETTLED_S)
        rates[envs] = at_work.rate(TRIED_S).by_core
        at_work.close()
        print(f"  {task}, {side}: {envs} environments: {rates[envs]:,.0f} steps per core second")
    return Side(side, task, max(rates, key=lambda envs: rates[envs]))


def measure(task: str, rounds: int) -> list[dict[str, str | int]]:
    """Measure all sides of a task in turns."""
    sides = {side: best(side, task) for side in TRIED if side != ENVPOOL or envpool is not None}
    rates: dict[str, list[Rate]] = {side: [] for side in sides}
    try:
        for at_work in sides.values():
            at_work.rate(SETTLED_S)
        for _ in range(rounds):
            for side, at_work in sides.items():
                rates[side].append(at_work.rate(MEASURED_S))
    finally:
        for at_work in sides.values():
            at_work.close()
    rows: list[dict[str, str | int]] = []
    ours = np.array(rates[OURS])
    for side, at_work in sides.items():
        own = np.array(rates[side])
        by_clock, by_core = np.median(own, axis=0)
        ratio, core_ratio = np.median(ours / own, axis=0)
        rows.append(
            {
                "task": f"{task}-v4" if side == ENVPOOL else f"{task}-v5",
                "side": side,
                "environments": at_work.envs,
                "env_steps_per_s": f"{by_clock:.0f}",
                "env_steps_per_core_s": f"{by_core:.0f}",
                "ratio": f"{ratio:.2f}",
                "asked_ratio": "–" if side == OURS else f"{ASKED:.0f}",
                "ratio_per_core_s": f"{core_ratio:.2f}",
            }
        )
    return rows


def main() -> int:
    """Measure, print and write the results."""
    parser = argparse.ArgumentParser(description="Ant and Humanoid beside gymnasium and envpool, on one core.")
    parser.add_argument("--rounds", type=int, default=5, help="rounds that count (default 5)")
    parser.add_argument("--core", type=int, default=max(os.sched_getaffinity(0)), help="the core that all sides use")
    given = parser.parse_args()
    os.sched_setaffinity(0, {given.core})
    rows = [row for task in TASKS for row in measure(task, given.rounds)]
    print_table(rows)
    facts = {
        "command": f"python -m benches gymnasium_tasks --rounds {given.rounds}",
        "cores": 1,
        "load_1_minute": f"{os.getloadavg()[0]:.1f}",
        "mujoco": mujoco.__version__,
        "envpool": "not installed" if envpool is None else envpool.__version__,
        "gymnasium": gymnasium.__version__,
        "tightloop": tl.__version__,
    }
    write_results("gymnasium_tasks", rows, facts)
    return 0


if __name__ == "__main__":
    sys.exit(main())
