"""Steps per second of FrankaPickCube with random actions, beside envpool and gymnasium's AsyncVectorEnv over MuJoCo C.

    make bench-env            # installs envpool
    python -m benches env

NumPy in and out, all cores. Three environments:

- ``tightloop/FrankaPickCube-v0``, which returns new arrays, and the same over a ring of views (``copy=False``); each
  also as two groups of worlds (`make_groups`), of which one steps while the other is sent its actions, as envpool's
  batches do.
- envpool's nearest task, ``PandaPickCube-v1`` (MuJoCo Playground's: a Panda and a cube, 66 numbers observed, 4 substeps
  of 5 ms). Its scene is smaller: of the arm only fingers and hand touch anything, and its solver stops after 5 rounds.
- MuJoCo C with our scene, observations and rewards, an environment a process (benches/env/mujoco_pick_cube.py). `alike`
  steps both through an episode and says how far they are from each other.

Several settings of each side are tried first, and the fastest is measured. Then the sides take turns, so that a machine
that changes its speed meanwhile changes all of them; ratios are taken within a round. An environment step is a control
step of one world, resets of episodes included; a physics step is one of its substeps. Rates are by the clock, and by
the processor time of all threads and processes, which other programs change less. Writes
benches/results/MACHINE/env.csv, and ends with 1 where a ratio of physics steps by the clock is below what was asked.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import envpool
import gymnasium
import mujoco
import numpy as np
from gymnasium.vector import AsyncVectorEnv
from mujoco_pick_cube import MujocoPickCube, model
from numpy.typing import NDArray
from tqdm import tqdm

import tightloop as tl
from tightloop.env import VectorEnv, make_groups
from tightloop.tasks.cube import DT
from tightloop.tasks.pick_cube import FrankaPickCube

sys.path.insert(0, str(Path(__file__).parents[1]))
from record import print_table, write_results

CORES = len(os.sched_getaffinity(0))
OURS, RING = "tightloop", "tightloop, ring"
ENVPOOL, ASYNC = "envpool PandaPickCube-v1", "gymnasium AsyncVectorEnv, MuJoCo C"
SUBSTEPS = {OURS: FrankaPickCube.substeps, RING: FrankaPickCube.substeps, ENVPOOL: 4, ASYNC: FrankaPickCube.substeps}
TIME_STEPS = {OURS: DT, RING: DT, ENVPOOL: 0.005, ASYNC: DT}
# Physics steps a second of ours over theirs
ASKED = {ENVPOOL: 30.0, ASYNC: 100.0}
ACTIONS = 32  # arrays of random actions, drawn before the clock starts
TRIED_S, MEASURED_S = 2.0, 4.0
# Worlds of `alike`
COMPARED = 16

#: Advances some environments by one step; returns how many.
Step = Callable[[], int]


class Rate(NamedTuple):
    """Environment steps a second, and a second of processor time of all threads and processes."""

    by_clock: float
    by_core: float


@dataclass(frozen=True)
class Setting:
    """How a side runs: environments, those of a batch, and threads or processes."""

    envs: int
    batch: int
    workers: int

    def __str__(self) -> str:
        return f"{self.envs} environments, {self.workers} at work" + (
            "" if self.batch == self.envs else f", batches of {self.batch}"
        )


def settings() -> dict[str, list[Setting]]:
    """What is tried of each side. An environment of envpool's takes 48 MB, so that it gets at most 16 a core."""
    whole = [Setting(n, n, CORES) for n in (CORES, 4 * CORES, 16 * CORES)]
    halves = [Setting(n, n // 2, CORES) for n in (4 * CORES, 16 * CORES)]
    ours = [Setting(worlds, worlds, CORES) for worlds in (1024, 4096, 8192)]
    ours += [Setting(worlds, worlds // 2, CORES) for worlds in (8192, 16384)]
    return {
        OURS: ours,
        RING: ours,
        ENVPOOL: [*whole, *halves],
        ASYNC: [Setting(n, n, n) for n in (CORES, 2 * CORES, 4 * CORES)],
    }


@dataclass(frozen=True)
class Groups:
    """Groups of worlds, each in a daemon of its own."""

    groups: list[VectorEnv]

    def close(self) -> None:
        """End them."""
        for group in self.groups:
            group.recv()
            group.close()


class Side:
    """An environment at work: `step`, and `close`."""

    def __init__(self, side: str, setting: Setting, binary: Path) -> None:
        """Start it; ``binary`` is MuJoCo's model."""
        self.env: Any
        self._others: list[int] = []  # processes
        if side == ENVPOOL:
            self.env = envpool.make_gymnasium(
                "PandaPickCube-v1",
                num_envs=setting.envs,
                batch_size=setting.batch,
                num_threads=setting.workers,
                seed=0,
            )
        elif side == ASYNC:
            # not forked: this process has threads
            makers = [partial(MujocoPickCube, binary)] * setting.envs
            self.env = AsyncVectorEnv(makers, copy=False, context="spawn")
            self._others = [process.pid for process in self.env.processes]
        elif setting.batch == setting.envs:
            self.env = gymnasium.make_vec(
                "tightloop/FrankaPickCube-v0", num_envs=setting.envs, threads=setting.workers, copy=side == OURS
            )
            self._others = [self.env.unwrapped.sim.pid]
        else:
            groups = setting.envs // setting.batch
            self.env = Groups(
                make_groups(FrankaPickCube, setting.envs, groups, threads=setting.workers, copy=side == OURS)
            )
            self._others = [group.sim.pid for group in self.env.groups]
        draw = np.random.default_rng(0).uniform
        dtype = np.float64 if side == ENVPOOL else np.float32
        self._actions = [draw(-1.0, 1.0, (setting.batch, 8)).astype(dtype) for _ in range(ACTIONS)]
        self._count = 0
        self.step: Step
        if setting.batch == setting.envs:
            self.env.reset(**({} if side == ENVPOOL else {"seed": 0}))
            self.step = self._whole
        elif side == ENVPOOL:
            self.env.async_reset()
            self.step = self._batch
        else:
            for group in self.env.groups:
                group.reset(seed=0)
                group.send(self._action())
            self.step = self._group

    def _action(self) -> NDArray[Any]:
        self._count += 1
        return self._actions[self._count % ACTIONS]

    def _whole(self) -> int:
        return len(self.env.step(self._action())[1])

    def _batch(self) -> int:
        *_, infos = self.env.recv()
        self.env.send(self._action(), infos["env_id"])
        return len(infos["env_id"])

    def _group(self) -> int:
        group = self.env.groups[self._count % len(self.env.groups)]
        reward = group.recv()[1]
        group.send(self._action())
        return len(reward)

    def rate(self, seconds: float) -> Rate:
        """Steps for so long."""
        begin, worked, steps = time.perf_counter(), self._worked(), 0
        while (taken := time.perf_counter() - begin) < seconds:
            steps += self.step()
        return Rate(steps / taken, steps / (self._worked() - worked))

    def _worked(self) -> float:
        """Processor time so far [s]."""
        stats = [Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split() for pid in self._others]
        return time.process_time() + sum(int(stat[11]) + int(stat[12]) for stat in stats) / os.sysconf("SC_CLK_TCK")

    def close(self) -> None:
        """End it."""
        self.env.close()


@dataclass
class Case:
    """A side in its best setting, and its rates, one a round."""

    side: str
    setting: Setting
    rates: list[Rate] = field(default_factory=list)


def best(side: str, binary: Path) -> Setting:
    """The setting in which it is fastest, each tried for a while."""
    rates: dict[Setting, float] = {}
    for setting in settings()[side]:
        at_work = Side(side, setting, binary)
        at_work.rate(TRIED_S / 4)
        rates[setting] = at_work.rate(TRIED_S).by_clock
        at_work.close()
        print(f"  {side}: {setting}: {rates[setting]:,.0f} environment steps/s")
    return max(rates, key=lambda setting: rates[setting])


def alike(binary: Path) -> NDArray[np.float64]:
    """How far our worlds are from MuJoCo's after each step of an episode: the largest difference of a number observed.

    Returns:
        Shape ``(50, worlds)``. Where contacts make a motion chaotic, rounding alone drives the two apart.
    """
    rng = np.random.default_rng(0)
    env = VectorEnv(FrankaPickCube, COMPARED)
    obs, _ = env.reset(seed=0)
    starts = env.sim.forward().joint_q.astype(float)
    # the cube's quaternion: MuJoCo has w first
    starts[:, 12:] = np.roll(starts[:, 12:], 1, axis=1)
    peers = [MujocoPickCube(binary) for _ in range(COMPARED)]
    for peer, start, goal in zip(peers, starts, obs[:, 26:29].astype(float), strict=True):
        peer.begin(start, goal)
    apart = np.zeros((FrankaPickCube.max_episode_steps, COMPARED))
    for row in apart:
        actions = rng.uniform(-1, 1, (COMPARED, 8)).astype(np.float32)
        obs, *_ = env.step(actions)
        theirs = [peer.step(action)[0] for peer, action in zip(peers, actions, strict=True)]
        row[:] = abs(obs - np.array(theirs)).max(axis=1)
    env.close()
    return apart


def measure(rounds: int, binary: Path) -> list[Case]:
    """All sides at their best, in turns."""
    print(f"settings, {CORES} cores:")
    cases = [Case(side, best(side, binary)) for side in SUBSTEPS]
    sides = [Side(case.side, case.setting, binary) for case in cases]
    try:
        # the first round warms caches and clocks, and is dropped
        for _ in tqdm(range(1 + rounds), desc="rounds", disable=None):
            for case, side in zip(cases, sides, strict=True):
                case.rates.append(side.rate(MEASURED_S))
    finally:
        for side in sides:
            side.close()
    for case in cases:
        del case.rates[0]
    return cases


def table(cases: list[Case]) -> list[dict[str, str | int]]:
    """For people and files; ratios are of our copying environment to the side, medians over the rounds."""
    ours = np.array(cases[0].rates)
    rows: list[dict[str, str | int]] = []
    for case in cases:
        rates, substeps = np.array(case.rates), SUBSTEPS[case.side]
        by_clock, by_core = np.median(rates, axis=0)
        ratio, core_ratio = np.median(ours / rates, axis=0)
        more = SUBSTEPS[OURS] / substeps
        rows.append(
            {
                "side": case.side,
                "environments": case.setting.envs,
                "batch": case.setting.batch,
                "workers": case.setting.workers,
                "substeps": substeps,
                "time_step_s": f"{TIME_STEPS[case.side]:g}",
                "env_steps_per_s": f"{by_clock:.0f}",
                "physics_steps_per_s": f"{by_clock * substeps:.0f}",
                "physics_steps_per_core_s": f"{by_core * substeps:.0f}",
                "env_ratio": f"{ratio:.2f}",
                "physics_ratio": f"{ratio * more:.2f}",
                "physics_ratio_per_core_s": f"{core_ratio * more:.2f}",
                "asked_physics_ratio": f"{ASKED[case.side]:.0f}" if case.side in ASKED else "–",
            }
        )
    return rows


def cores_busy() -> float:
    """How many cores other programs keep busy."""

    def idle() -> int:
        return sum(int(ticks) for ticks in Path("/proc/stat").read_text().split("\n", 1)[0].split()[4:6])

    begin, before = time.perf_counter(), idle()
    time.sleep(TRIED_S)
    idle_cores = (idle() - before) / os.sysconf("SC_CLK_TCK") / (time.perf_counter() - begin)
    return max(0.0, (os.cpu_count() or 1) - idle_cores)


def main() -> int:
    """Compare, measure in turns, print and write the results; 0 when ours is as many times as fast as asked."""
    parser = argparse.ArgumentParser(description="Environment steps per second beside envpool and AsyncVectorEnv.")
    parser.add_argument("--rounds", type=int, default=7, help="rounds that count (default 7)")
    rounds = parser.parse_args().rounds
    busy = cores_busy()
    with tempfile.TemporaryDirectory() as folder:
        binary = Path(folder) / "pick_cube.mjb"
        mujoco.mj_saveModel(model(), str(binary), None)
        apart = alike(binary).max(axis=0)
        far = f"{np.median(apart):.1e} at the median of {COMPARED} worlds, {apart.max():.1e} at most"
        print(f"an episode of ours and of MuJoCo's: observations are apart by {far}")
        rows = table(measure(rounds, binary))
    print_table(rows)
    facts = {
        "command": f"python -m benches env --rounds {rounds}",
        "cores": CORES,
        "cores_busy_before": f"{busy:.1f}",
        "mujoco": mujoco.__version__,
        "envpool": envpool.__version__,
        "gymnasium": gymnasium.__version__,
        "tightloop": tl.__version__,
        "observations_apart": far,
    }
    write_results("env", rows, facts)
    missed = [row for row in rows if row["side"] in ASKED and float(row["physics_ratio"]) < ASKED[str(row["side"])]]
    for row in missed:
        print(f"{row['side']}: {row['physics_ratio']} times in physics steps, asked {row['asked_physics_ratio']}")
    return int(bool(missed))


if __name__ == "__main__":
    sys.exit(main())
