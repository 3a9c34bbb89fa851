"""Inverse kinematics of random reachable poses of the FR3's hand beside PyPI's mink, on one core, in turns.

    python -m benches ik

Poses are those of joint positions that are drawn uniformly within limits; MuJoCo evaluates them. Both sides start at
one position, count a pose as reached within 1 mm and 0.1°, and try again from random positions. MuJoCo's kinematics
check all solutions. mink solves quadratic programs with daqp, in a process with an environment and a MuJoCo of its own
(out/ik, made by the first run). Its parameters are the best of those in benches/physics/ik_side.py. tightloop takes all
poses in one call, which mink cannot. Writes benches/results/MACHINE/ik.csv, and ends with 1 if tightloop reaches less
than 99.5 %, or is slower than asked.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
import venv
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import tightloop as tl

sys.path.insert(0, str(Path(__file__).parents[1]))
from record import REPOSITORY, print_slow, print_table, write_results

ENVIRONMENT = REPOSITORY / "out/ik"
REQUIREMENTS = REPOSITORY / "py-client/requirements-ik.txt"
URDF = REPOSITORY / "examples/assets/fr3/fr3_franka_hand.urdf"
FRAME = "arm/fr3_hand_tcp"
HOME = [0.0, -0.8, 0.0, -2.4, 0.0, 1.6, 0.8, 0.04, 0.04]
TOLERANCE = (1e-3, float(np.radians(0.1)))
RESTARTS = 100
# Solves per second over mink's
ASKED = {"tightloop f32": 200.0}
REACHED = 0.995

Poses = NDArray[np.float64]


@dataclass
class Side:
    """What one side did; an entry a round where there are several."""

    rates: list[float] = field(default_factory=list)
    reached: int = 0
    solved: int = 0
    iterations: int = 0
    restarts: int = 0


class Mink:
    """mink, in a process of its own. `ask` names a method of benches/physics/ik_side.py."""

    def __init__(self, environment: Path) -> None:
        python = environment / "bin/python"
        if not python.exists():
            print(f"installing mink into {environment}", flush=True)
            venv.create(environment, with_pip=True)
            subprocess.run([python, "-m", "pip", "install", "--quiet", "-r", REQUIREMENTS], check=True)
        threads = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        command = [python, REPOSITORY / "benches/physics/ik_side.py"]
        environ = os.environ | threads
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environ)
        self.versions = self._answer()

    def _answer(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise SystemExit("mink ended; its error is above")
        return json.loads(line)

    def ask(self, do: str, **arguments: Any) -> dict[str, Any]:
        """Have it do something, and return its answer."""
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps({"do": do, **arguments}) + "\n")
        self._process.stdin.flush()
        return self._answer()

    def poses(self, joint_q: NDArray[np.float64], folder: Path) -> Poses:
        """Where MuJoCo finds the hand, ``(n, 7)``."""
        file = folder / "ik_states.npy"
        np.save(file, joint_q)
        found = np.array(self.ask("poses", joint_q=str(file))["poses"])
        file.unlink()
        return found

    def close(self) -> None:
        """End the process."""
        self._process.communicate()


def reached(found: Poses, targets: Poses) -> int:
    """How many poses are within the tolerance."""
    distance = np.linalg.norm(found[:, :3] - targets[:, :3], axis=1)
    chords = [np.linalg.norm(found[:, 3:] - sign * targets[:, 3:], axis=1) for sign in (1, -1)]
    angle = 4.0 * np.arcsin(np.clip(0.5 * np.minimum(*chords), 0.0, 1.0))
    # MuJoCo reads the URDF's numbers as we do, and both round
    return int(((distance <= TOLERANCE[0] + 1e-9) & (angle <= TOLERANCE[1] + 1e-7)).sum())


def main() -> None:
    """Measure, and write the table."""
    parser = argparse.ArgumentParser(description="Inverse kinematics beside mink, on one core.")
    parser.add_argument("--poses", type=int, default=10_000, help="random poses (default 10000)")
    parser.add_argument("--rounds", type=int, default=5, help="rounds; mink solves a part of the poses in each")
    parser.add_argument("--environment", type=Path, default=ENVIRONMENT, help="where mink is installed")
    args = parser.parse_args()
    mink = Mink(args.environment)
    low, high = np.array(mink.ask("robot", urdf=str(URDF))["ranges"]).T
    states = np.random.default_rng(0).uniform(low, high, (args.poses, len(low)))
    folder = args.environment
    targets = mink.poses(states, folder)
    scene = tl.Scene()
    scene.add_urdf(URDF, name="arm")
    solver = tl.ik(scene, tl.Reach(FRAME))
    sides = {"mink, daqp": Side(), "tightloop f64": Side(), "tightloop f32": Side()}
    for part in np.array_split(np.arange(args.poses), args.rounds):
        answer = mink.ask(
            "solve", poses=targets[part].tolist(), start=HOME, restarts=RESTARTS, tolerance=list(TOLERANCE)
        )
        side = sides["mink, daqp"]
        side.rates.append(len(part) / answer["seconds"])
        add(side, mink.poses(np.array(answer["solutions"]), folder), targets[part], answer)
        for precision in ("f64", "f32"):
            side = sides[f"tightloop {precision}"]
            begin = time.perf_counter()
            result = solver.solve(
                targets[:, :3],
                targets[:, 3:],
                joint_q=HOME,
                restarts=RESTARTS,
                tolerance=TOLERANCE,
                precision=precision,
                threads=1,
            )
            side.rates.append(args.poses / (time.perf_counter() - begin))
            counts = {"iterations": int(result.iterations.sum()), "restarts": int(result.restarts.sum())}
            add(side, mink.poses(result.joint_q, folder), targets, counts)
    mink.close()
    rows = [row(name, side, sides["mink, daqp"]) for name, side in sides.items()]
    print_table(rows)
    facts = mink.versions | {"command": " ".join(["python -m benches ik", *sys.argv[1:]]), "threads": 1}
    facts |= {"poses": args.poses, "tolerance": "1 mm, 0.1°", "restarts": RESTARTS}
    write_results("ik", rows, facts)
    few = [name for name, side in sides.items() if side.reached < REACHED * side.solved and "tightloop" in name]
    for name in few:
        print(f"{name} reaches {sides[name].reached} of {sides[name].solved} poses, asked {REACHED:.1%}")
    sys.exit(1 if print_slow(rows, "side") or few else 0)


def add(side: Side, found: Poses, targets: Poses, counts: dict[str, Any]) -> None:
    """Count the solutions of a round."""
    side.reached += reached(found, targets)
    side.solved += len(targets)
    side.iterations += counts["iterations"]
    side.restarts += counts["restarts"]


def row(name: str, side: Side, peer: Side) -> dict[str, str | int]:
    """A row of the table; ratios are taken within a round."""
    ratio = float(np.median(np.array(side.rates) / np.array(peer.rates)))
    return {
        "side": name,
        "median_solves_per_s": f"{np.median(side.rates):.0f}",
        "best_solves_per_s": f"{max(side.rates):.0f}",
        "reached_percent": f"{100 * side.reached / side.solved:.2f}",
        "iterations": f"{side.iterations / side.solved:.1f}",
        "restarts": f"{side.restarts / side.solved:.2f}",
        "median_ratio": f"{ratio:.1f}",
        "asked_ratio": f"{ASKED[name]:.0f}" if name in ASKED else "–",
    }


if __name__ == "__main__":
    main()
