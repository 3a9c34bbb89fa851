"""Steps per second beside MuJoCo C, on one thread each, in one run.

    python -m benches peers

The lesson's two demos without contacts: MuJoCo's `rollout`, tightloop through its daemon and Python, and tightloop in
process (benches/physics/step.rs) with each width of lanes that the processor has. The sides take turns, so that a
machine that changes its speed meanwhile changes all of them; ratios are taken within a round. Writes
benches/results/MACHINE/peers.csv, and ends with 1 when the target demo is slower than asked.

Like with like: one model, one time step, one solver, commands of every frame the same on both sides, in all worlds
("one") or with an amplitude of each world's own ("own"; in process there is only "one"). Not the same: MuJoCo computes
in double precision, tightloop in single; MuJoCo's worlds are fewer, which its steps do not notice.
"""

from __future__ import annotations

import argparse
import csv
import json
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import mujoco.rollout
import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

import tightloop as tl

sys.path.insert(0, str(Path(__file__).parents[1]))
from record import REPOSITORY, write_results

MODELS = REPOSITORY.parent / "shared/reference/models"
sys.path[:0] = [str(REPOSITORY / "examples"), str(REPOSITORY / "tests/python/mujoco")]
from franka_lesson import FRAMES, START, scene, targets, torques  # noqa: E402  (the examples are no package)
from mujoco_model import MujocoModel  # noqa: E402  (nor are the tests)

WORLDS = 4096
MUJOCO_WORLDS = 16
DEMOS = {"target": (targets, "joint_target_q", "target"), "torque": (torques, "joint_f", "torque_free")}
MUJOCO = "MuJoCo C rollout"
DAEMON = "tightloop, daemon and Python"
# Steps per second of the target demo over MuJoCo's, by the lanes of a run
ASKED = {"sixteen": 40.0, "eight": 20.0}


@dataclass
class Case:
    """One side in one demo; rates are steps per second, one a round."""

    demo: str
    commands: str
    side: str
    lanes: str
    worlds: int
    precision: str
    rates: list[float] = field(default_factory=list)


class Rival:
    """MuJoCo C: the recorded reference's model where it is present, otherwise what it makes of our URDF."""

    def __init__(self, demo: str) -> None:
        binary = MODELS / f"{DEMOS[demo][2]}.mjb"
        if binary.exists():
            self.model, self.origin = mujoco.MjModel.from_binary_path(str(binary)), binary.name
        else:
            self.model, self.origin = MujocoModel(scene(driven=demo == "target")).model, "the project's URDF"
            self.model.opt.iterations, self.model.opt.tolerance = 20, 1e-8
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        self.data = mujoco.MjData(self.model)
        self.torque = demo == "torque"

    def rate(self, commands: NDArray[np.float32], substeps: int) -> float:
        """Steps per second of a demo; commands ``(frames, worlds, dofs)``."""
        size = mujoco.mj_stateSize(self.model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        start = np.zeros((commands.shape[1], size))
        start[:, 1:10] = START
        control = commands.astype(float).swapaxes(0, 1).repeat(substeps, axis=1)
        spec = mujoco.mjtState.mjSTATE_QFRC_APPLIED if self.torque else mujoco.mjtState.mjSTATE_CTRL
        if not self.torque and self.model.nu == 2 * self.model.nv:
            # the reference model has two actuators a joint, and the second takes a velocity target
            control = np.stack([control, np.zeros_like(control)], axis=-1).reshape(*control.shape[:2], -1)
        state = np.empty((*control.shape[:2], size))
        begin = time.perf_counter()
        mujoco.rollout.rollout(self.model, self.data, start, control, control_spec=int(spec), state=state)
        return control.shape[0] * control.shape[1] / (time.perf_counter() - begin)


def daemon_rate(sim: tl.Sim, commands: NDArray[np.float32], name: str) -> float:
    """Steps per second of a demo through the daemon; commands ``(frames, worlds, dofs)``."""
    sim.reset()
    begin = time.perf_counter()
    for action in commands:
        sim.step(**{name: action})
    return len(commands) * sim.worlds * sim.substeps / (time.perf_counter() - begin)


def step_bench() -> Path:
    """The built bench of steps in process."""
    command = ["cargo", "bench", "--quiet", "--workspace", "--bench", "step", "--no-run"]
    command += ["--message-format", "json"]
    lines = subprocess.run(command, cwd=REPOSITORY, stdout=subprocess.PIPE, check=True, text=True).stdout.splitlines()
    built = [message.get("executable") for message in map(json.loads, lines)]
    return Path(next(path for path in built if path))


def in_process_rates(bench: Path) -> dict[tuple[str, str, str], float]:
    """Steps per second by demo, lanes and precision, of one pass of each demo."""
    command = [str(bench), str(WORLDS), "once", "sixteen", "eight", *DEMOS]
    text = subprocess.run(command, cwd=REPOSITORY, stdout=subprocess.PIPE, check=True, text=True).stdout
    rows = csv.DictReader(text.splitlines())
    return {(row["demo"], row["lanes"].lower(), row["precision"].lower()): float(row["steps_per_s"]) for row in rows}


def measure(rounds: int) -> list[Case]:
    """All sides of all demos, in turns."""
    bench = step_bench()
    cases: dict[tuple[str, ...], Case] = {}

    def note(rate: float, *key: str, worlds: int, precision: str) -> None:
        cases.setdefault(key, Case(*key, worlds=worlds, precision=precision)).rates.append(rate)

    rivals = {demo: Rival(demo) for demo in DEMOS}
    sims = {demo: tl.launch(scene(driven=demo == "target"), worlds=WORLDS, threads=1) for demo in DEMOS}
    print(f"MuJoCo {mujoco.__version__}: " + ", ".join(f"{demo} of {rival.origin}" for demo, rival in rivals.items()))
    print(f"tightloop {tl.__version__}: {sims['target'].device}")
    amplitudes = {"one": np.ones_like, "own": lambda worlds: np.linspace(1.0, -1.0, len(worlds))}
    try:
        # the first round warms caches and clocks, and is dropped
        for _ in tqdm(range(1 + rounds), desc="rounds", disable=None):
            for demo, (values, name, _model) in DEMOS.items():
                for kind, spread in amplitudes.items():
                    few, many = (
                        np.array([values(frame, spread(np.empty(worlds))) for frame in range(FRAMES)])
                        for worlds in (MUJOCO_WORLDS, WORLDS)
                    )
                    sim = sims[demo]
                    rate = rivals[demo].rate(few, sim.substeps)
                    note(rate, demo, kind, MUJOCO, "–", worlds=MUJOCO_WORLDS, precision="f64")
                    note(daemon_rate(sim, many, name), demo, kind, DAEMON, "auto", worlds=WORLDS, precision="f32")
            for (demo, lanes, precision), rate in in_process_rates(bench).items():
                note(rate, demo, "one", "tightloop, in process", lanes, worlds=WORLDS, precision=precision)
    finally:
        for sim in sims.values():
            sim.close()
    for case in cases.values():
        del case.rates[0]
    return sorted(cases.values(), key=lambda case: (case.demo, case.commands, case.side))


def table(cases: list[Case]) -> list[dict[str, str | int]]:
    """Rows for people and files: best and median rates, and the median of the ratios to MuJoCo, round by round."""
    rivals = {(case.demo, case.commands): case.rates for case in cases if case.side == MUJOCO}
    return [
        {
            "demo": case.demo,
            "commands": case.commands,
            "side": case.side,
            "lanes": case.lanes,
            "precision": case.precision,
            "worlds": case.worlds,
            "best_steps_per_s": f"{max(case.rates):.0f}",
            "median_steps_per_s": f"{np.median(case.rates):.0f}",
            "best_ratio": f"{max(case.rates) / max(rivals[case.demo, case.commands]):.2f}",
            "median_ratio": f"{np.median(np.divide(case.rates, rivals[case.demo, case.commands])):.2f}",
        }
        for case in cases
    ]


def main() -> int:
    """Measure in turns, print and write the results; 0 when the target demo is as fast as asked."""
    parser = argparse.ArgumentParser(description="Steps per second beside MuJoCo C, on one thread each.")
    parser.add_argument("--rounds", type=int, default=5, help="rounds that count (default 5)")
    rounds = parser.parse_args().rounds
    cases = measure(rounds)
    rows = table(cases)
    print(f"\n{'demo':<8}{'commands':<10}{'side':<32}{'lanes':<9}{'best steps/s':>14}{'median':>14}{'ratio':>9}")
    for row in rows:
        print(
            f"{row['demo']:<8}{row['commands']:<10}{row['side']:<32}{row['lanes']:<9}"
            f"{int(row['best_steps_per_s']):>14,}{int(row['median_steps_per_s']):>14,}{row['median_ratio']:>9}"
        )
    command = f"python -m benches peers --rounds {rounds}"
    write_results("peers", rows, {"command": command, "mujoco": mujoco.__version__, "threads": 1})

    widest = "sixteen" if any(row["lanes"] == "sixteen" for row in rows) else "eight"
    short = False
    for row in rows:
        lanes = widest if row["lanes"] == "auto" else row["lanes"]
        if row["demo"] == "target" and lanes in ASKED:
            ratio, asked = float(row["median_ratio"]), ASKED[str(lanes)]
            verdict = "" if ratio >= asked else ", missed"
            short |= ratio < asked
            print(f"target, {row['commands']}, {row['side']}, {lanes} lanes: {ratio:.1f} (asked {asked:.0f}{verdict})")
    return int(short)


if __name__ == "__main__":
    sys.exit(main())
