"""A Franka FR3 closes its hand on a cube and lifts it, in thousands of worlds.

    python examples/franka_grasp.py --worlds 4096

The arm follows recorded targets, the same in every world. What differs is the cube: where it stands, by a few
millimetres, how it is turned, and how everything rubs. It is one launch, in which each coefficient of friction has its
share of the worlds; the smallest is too slippery to be lifted. The first world of each share has the cube where the
record has it, and that with the lesson's friction is compared with the recorded run (MuJoCo C in float64), if there is
one.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np
from franka_lesson import FRAMES, REFERENCE, URDF
from franka_lesson import scene as arm_on_its_stand
from learning.places import OUT
from numpy.typing import NDArray
from tqdm import tqdm

import tightloop as tl

matplotlib.use("Agg")
from matplotlib import pyplot as plt

FRICTIONS = [0.1, 0.4, 0.7, 1.0]  # [–]; the last is the lesson's
LIFTED = 0.2  # height of the cube's centre at the end [m]: it starts at 0.125, and the arm takes it to 0.275
PLACE, TURN = 0.005, 0.2  # the cube is off by at most so much in x and y [m], and about z [rad]
RECORD = REFERENCE / "mujoco_grasp.csv"
FINGER = "arm/fr3_leftfinger"


def scene(*, urdf: Path = URDF) -> tl.Scene:
    """The arm, a table and a cube on it, all of friction 1: of two that touch the larger counts."""
    scene = arm_on_its_stand(driven=True, urdf=urdf)
    scene.add_table()
    scene.add_cube()
    return scene


def targets() -> NDArray[np.float32]:
    """Drive targets of the arm [rad or m], shape ``(frames, 9)``: down, fingers closed, up."""
    return np.loadtxt(REFERENCE / "grasp_targets.csv", delimiter=",", dtype=np.float32)


def cubes(worlds: int, seed: int = 0) -> NDArray[np.float64]:
    """Where the cube starts: position [m], quaternion (x, y, z, w), shape ``(worlds, 7)``; in world 0 as recorded."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-PLACE, PLACE, (2, worlds))
    turn = rng.uniform(-TURN, TURN, worlds)
    x[0] = y[0] = turn[0] = 0.0
    zero = np.zeros(worlds)
    return np.stack([x, y - 0.35, zero + 0.125, zero, zero, np.sin(turn / 2), np.cos(turn / 2)], axis=1)


@dataclass
class Run:
    """What was measured of the worlds of a friction. Heights and forces are of frames 0 (the start) to 180."""

    mu: float
    height: NDArray[np.float64]  # of the cube's centre, (frames + 1, worlds) [m]
    grip: NDArray[np.float64]  # contact force on a finger, (frames + 1, worlds) [N]
    first: NDArray[np.float64]  # joint_q of the first world, (frames + 1, 16) [rad or m]
    status: NDArray[np.uint32]  # every bit that was ever set, (worlds,)

    @property
    def lifted(self) -> NDArray[np.bool_]:
        """In which worlds the cube is up at the end."""
        return self.height[-1] > LIFTED

    def print(self) -> None:
        """Say how many worlds lifted the cube, and what the worlds complained of."""
        worlds = len(self.lifted)
        bits = {1: "not finite", 4: "contacts left out", 2: "solver out of iterations"}
        trouble = ", ".join(f"{what} in {(self.status & bit > 0).sum()}" for bit, what in bits.items())
        rows = {
            "lifted": f"{self.lifted.sum()} of {worlds} worlds",
            "status": f"{trouble} of {worlds} worlds",
        }
        print(f"\nfriction {self.mu:g}")
        for what, value in rows.items():
            print(f"  {what:<24}{value}")


def run(
    mus: list[float], goals: NDArray[np.float32], *, share: int, precision: str, threads: int | None
) -> tuple[list[Run], float]:
    """Grasp with every friction in so many worlds each; also how many physics steps a second all worlds made."""
    fields, worlds = ("joint_q", "body_contact_force"), share * len(mus)
    with tl.launch(
        scene(), worlds=worlds, precision=precision, threads=threads, fields=fields, params=("shape_mu",)
    ) as sim:
        cube, finger = sim.coords["cube"], sim.body_names.index(FINGER)
        sim.params.shape_mu = np.repeat(mus, share)[:, None] * np.ones(len(sim.shape_names))
        # the first of each share keeps the scene's start to the last bit
        others = np.arange(worlds) % share > 0
        frame = sim.write(joint_q={"cube": np.tile(cubes(share), (len(mus), 1))}, mask=others)
        height, grip, firsts, seconds = [], [], [], 0.0
        status = np.zeros(worlds, np.uint32)

        def note(frame: tl.Frame) -> None:
            height.append(frame.joint_q[:, cube.start + 2].copy())
            grip.append(np.linalg.norm(frame.body_contact_force[:, finger], axis=1))
            firsts.append(frame.joint_q[::share].copy())
            np.bitwise_or(status, frame.status, out=status)

        note(frame)
        for goal in tqdm(goals, desc="grasp", unit="frame", disable=None):
            start = time.perf_counter()
            frame = sim.step(joint_target_q={"arm": goal})
            seconds += time.perf_counter() - start
            note(frame)
        of_share = [slice(place * share, (place + 1) * share) for place in range(len(mus))]
        runs = [
            Run(
                mu=mu,
                height=np.array(height, float)[:, own],
                grip=np.array(grip, float)[:, own],
                first=np.array(firsts, float)[:, place],
                status=status[own],
            )
            for place, (mu, own) in enumerate(zip(mus, of_share, strict=True))
        ]
        return runs, worlds * sim.substeps * len(goals) / seconds


def recorded() -> NDArray[np.float64] | None:
    """The recorded run: joint positions and the cube's pose, quaternion (x, y, z, w), shape ``(frames + 1, 16)``."""
    if not RECORD.exists():
        return None
    rows = np.loadtxt(RECORD, delimiter=",")[:, 1:17]
    rows[:, 12:] = np.roll(rows[:, 12:], -1, axis=1)
    return rows


def compare(run: Run, record: NDArray[np.float64]) -> None:
    """Say how far the first world is from the recorded run, before and after it holds the cube."""
    off = np.abs(run.first - record)
    joints, cube = off[:, :9], off[:, 9:12]
    print(f"\ndistance from MuJoCo C of the first world, friction {run.mu:g}, the largest of frames")
    print(f"  {'0 to 90':<24}{joints[:91].max():.1e} rad or m, cube {cube[:91].max():.1e} m")
    print(f"  {f'91 to {FRAMES}':<24}{joints[91:].max():.1e} rad or m, cube {cube[91:].max():.1e} m")


def plot(path: Path, runs: list[Run], record: NDArray[np.float64] | None) -> None:
    """Draw the cube's height and the grip of a few worlds over time."""
    seconds = np.arange(FRAMES + 1) / 60
    figure, (height, grip) = plt.subplots(1, 2, figsize=(10, 4), constrained_layout=True)
    for place, run in enumerate(runs):
        label = f"friction {run.mu:g}: {run.lifted.sum()} of {len(run.lifted)} lifted"
        shown = np.unique(np.linspace(0, len(run.lifted) - 1, 25, dtype=int))
        for axis, values in ((height, run.height), (grip, run.grip)):
            axis.plot(seconds, values[:, shown], color=f"C{place}", lw=1, alpha=0.3)
            axis.plot(seconds, values[:, 0], color=f"C{place}", lw=1.5, label=label)
    if record is not None:
        height.plot(seconds[::6], record[::6, 11], ".", color="k", ms=4, label="MuJoCo C, float64, friction 1")
    height.axhline(LIFTED, color="0.5", lw=1, ls=":")
    height.set(title="Height of the cube", ylabel="height [m]", xlabel="time [s]")
    grip.set(title="Contact force on the left finger", ylabel="force [N]", xlabel="time [s]")
    height.legend(fontsize=8, loc="upper left")
    for axis in (height, grip):
        axis.grid(alpha=0.3)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=100)


def main() -> None:
    """Grasp with every friction, say how many worlds lifted the cube, and draw the plot."""
    parser = argparse.ArgumentParser(description="A Franka arm lifts a cube in thousands of worlds.")
    parser.add_argument("--worlds", type=int, default=4096, help="worlds, shared among the frictions (default 4096)")
    parser.add_argument("--mu", type=float, nargs="+", default=FRICTIONS, help="coefficients of friction")
    parser.add_argument("--precision", default="f32", choices=["f32", "f64"], help="precision of the run (default f32)")
    parser.add_argument("--threads", type=int, default=None, help="most threads a step may use (default: all cores)")
    parser.add_argument("--out", type=Path, default=OUT, help="folder of the plot (default out/)")
    args = parser.parse_args()

    share = max(1, args.worlds // len(args.mu))
    runs, rate = run(args.mu, targets(), share=share, precision=args.precision, threads=args.threads)
    for alike in runs:
        alike.print()
    lifted = sum(int(run.lifted.sum()) for run in runs)
    print(f"\n{lifted} of {share * len(runs)} worlds lifted the cube, at {rate:,.0f} physics steps a second")

    record = recorded()
    for alike in runs:
        if record is not None and alike.mu == 1.0:
            compare(alike, record)
    picture = args.out / "franka_grasp.png"
    plot(picture, runs, record)
    print(f"plot: {picture}")


if __name__ == "__main__":
    main()
