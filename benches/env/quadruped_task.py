"""Environment steps per second of QuadrupedVelocityFlat on one core, beside the same task on PyPI's mjbatch.

    python -m benches quadruped_task

mjbatch steps MuJoCo C, in a process with an environment and a MuJoCo of its own (out/mjbatch, made by the first run);
benches/env/quadruped_peer.py is the task there, in NumPy. Both sides take the same random actions, and begin episodes
anew where they end. All processes of a side share one core, and the sides take turns. Rates are by the clock, and by
the processor time of a side. Writes benches/results/MACHINE/quadruped_task.csv.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import tightloop as tl
from tightloop.env import VectorEnv
from tightloop.tasks.quadruped import QuadrupedVelocityFlat

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parents[1] / "physics"))
from mujoco_models import Mjbatch
from record import print_table, write_results

TASK, ASKED = "QuadrupedVelocityFlat", 15.0
WORLDS = (2048, 256)  # of tightloop and of mjbatch, each where it is fastest
ACTIONS, SPREAD = 32, 0.5
MEASURED_S, SETTLED_S = 3.0, 4.0
TICKS = os.sysconf("SC_CLK_TCK")


class Ours:
    """tightloop's side."""

    def __init__(self, actions: np.ndarray) -> None:
        self.env = VectorEnv(TASK, actions.shape[1], threads=1, device="cpu", copy=False)
        self.actions, self.count = actions, 0
        self.env.reset(seed=0)

    def turn(self, seconds: float) -> list[float]:
        """Step for that long; returns environment steps per second, and per second of processor time."""
        steps, before, begin = 0, self._worked(), time.perf_counter()
        while (passed := time.perf_counter() - begin) < seconds:
            self.env.step(self.actions[self.count % ACTIONS])
            self.count += 1
            steps += self.env.num_envs
        return [steps / passed, steps / (self._worked() - before)]

    def _worked(self) -> float:
        stat = Path(f"/proc/{self.env.sim.pid}/stat").read_text().rpartition(")")[2].split()
        return time.process_time() + (int(stat[11]) + int(stat[12])) / TICKS


def main() -> int:
    """Measure, print and write the results."""
    parser = argparse.ArgumentParser(description=f"{TASK} beside mjbatch, on one core.")
    parser.add_argument("--rounds", type=int, default=9, help="rounds that count (default 9)")
    parser.add_argument("--core", type=int, default=max(os.sched_getaffinity(0)), help="the core that both sides use")
    given = parser.parse_args()
    os.sched_setaffinity(0, {given.core})
    rng = np.random.default_rng(0)
    actions = [SPREAD * rng.standard_normal((ACTIONS, worlds, 12)).astype(np.float32) for worlds in WORLDS]
    ours, peer = Ours(actions[0]), Mjbatch("env/quadruped_peer.py")
    scene = QuadrupedVelocityFlat().scene()
    (robot,) = scene.robots
    with tempfile.TemporaryDirectory() as folder:
        xml, given_actions = str(Path(folder) / "quadruped.xml"), str(Path(folder) / "actions.npy")
        scene.to_mujoco(xml)
        np.save(given_actions, actions[1])
        peer.ask("start", xml=xml, robot=robot, actions=given_actions, worlds=WORLDS[1])
    rates: dict[str, list[list[float]]] = {"tightloop": [], "mjbatch": []}
    for count in range(given.rounds + 1):
        seconds = MEASURED_S if count else SETTLED_S
        own, their = ours.turn(seconds), peer.ask("turn", seconds=seconds)["rates"]
        if count:
            rates["tightloop"].append(own)
            rates["mjbatch"].append(their)
    ours.env.close()
    peer.close()
    ratio, core_ratio = np.median(np.array(rates["tightloop"]) / np.array(rates["mjbatch"]), axis=0)
    rows: list[dict[str, str | int]] = []
    for (side, own), worlds in zip(rates.items(), WORLDS, strict=True):
        by_clock, by_core = np.median(np.array(own), axis=0)
        rows.append(
            {
                "side": side,
                "environments": worlds,
                "env_steps_per_s": f"{by_clock:.0f}",
                "env_steps_per_core_s": f"{by_core:.0f}",
                "ratio": f"{ratio:.2f}" if side == "mjbatch" else "1.00",
                "asked_ratio": f"{ASKED:.0f}" if side == "mjbatch" else "–",
                "ratio_per_core_s": f"{core_ratio:.2f}" if side == "mjbatch" else "1.00",
            }
        )
    print_table(rows)
    head = {
        "command": f"python -m benches quadruped_task --rounds {given.rounds}",
        "cores": 1,
        "load_1_minute": f"{os.getloadavg()[0]:.1f}",
        "tightloop": tl.__version__,
        **peer.versions,
    }
    write_results("quadruped_task", rows, head)
    return 0


if __name__ == "__main__":
    sys.exit(main())
