"""The first lesson: a Franka FR3 with its hand, driven from Python by position targets and by torques.

    python examples/franka_lesson.py --worlds 4096

Every world gets its own amplitude; world 0 gets that of the recorded reference (MuJoCo C in float64, tests/data) and
is compared with it. The Rust twin, examples/franka_lesson.rs, does the same in process.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from learning.places import OUT
from numpy.typing import NDArray
from tqdm import tqdm

import tightloop as tl

matplotlib.use("Agg")
from matplotlib import pyplot as plt

HERE = Path(__file__).parent
REFERENCE = HERE / "assets/reference"
URDF = HERE / "assets/fr3/fr3_franka_hand.urdf"

FRAMES = 180  # 3 s at 60 Hz
# float32 values, as the reference has them. The fingers start outside their limit, and settle.
START = np.array(
    [-3.6802115e-3, 2.3901723e-2, 3.6804110e-3, -2.3683236, -1.2918962e-4, 2.3922248, 7.8549200e-1, 0.05, 0.05],
    dtype=np.float32,
)
STIFFNESS = np.array([4500.0, 4500, 3500, 3500, 2000, 2000, 2000, 100, 100])  # [N·m/rad, N/m]


def scene(*, driven: bool, urdf: Path = URDF) -> tl.Scene:
    """The arm on its stand; ``driven`` says whether its drives hold targets or only torques move it."""
    scene = tl.Scene(dt=1 / 480, substeps=8)
    arm = scene.add_urdf(urdf, name="arm", pos=(-0.5, -0.5, 0.1))
    arm.joint_q = START
    arm.joint_target_ke = STIFFNESS if driven else 0.0
    arm.joint_target_kd = STIFFNESS / 10 if driven else 0.0
    arm.joint_effort_limit = [87] * 4 + [12] * 3 + [100] * 2
    arm.joint_armature = [0.195] * 4 + [0.074] * 3 + [0.1] * 2
    return scene


def targets(frame: int, amplitudes: NDArray[np.float64]) -> NDArray[np.float32]:
    """Drive targets [rad or m], shape ``(worlds, 9)``: the elbow swings, the fingers close to their limit."""
    goal = np.tile(START, (len(amplitudes), 1))
    goal[:, 3] += amplitudes * (0.4 * np.sin(2 * np.pi * frame / FRAMES))
    goal[:, 7:] = 0.04
    return goal


def torques(frame: int, amplitudes: NDArray[np.float64]) -> NDArray[np.float32]:
    """Joint torques [N·m], shape ``(worlds, 9)``: the third joint is pushed one way, then the other."""
    tau = np.zeros((len(amplitudes), 9), np.float32)
    tau[:, 2] = amplitudes * (35.0 * np.sin(2 * np.pi * frame / FRAMES))
    return tau


@dataclass
class Run:
    """What a demo measured. Positions are of frames 0 (the start) to 180."""

    joint_q: NDArray[np.float64]  # (frames + 1, shown worlds, 9) [rad or m]
    command: NDArray[np.float64]  # (frames, 9), of world 0
    trips: NDArray[np.float64]  # (frames,) [s]
    substeps: int

    def print(self, title: str, worlds: int, reference: NDArray[np.float64], until: int) -> None:
        """Say how fast it was, and how far world 0 is from the recorded reference."""
        p50, p99 = np.percentile(self.trips * 1e3, [50, 99])
        distance = np.abs(self.joint_q[:, 0] - reference[:, 1:10])[: until + 1].max()
        rows = {
            "worlds": f"{worlds}",
            "physics steps/s": f"{worlds * self.substeps * len(self.trips) / self.trips.sum():,.0f}",
            "round trip p50 / p99": f"{p50:.2f} / {p99:.2f} ms",
            "distance from MuJoCo C": f"{distance:.1e} rad or m, the largest of frames 0 to {until}",
        }
        print(f"\n{title}")
        for what, value in rows.items():
            print(f"  {what:<24}{value}")
        print(flush=True)


def run(title: str, sim: tl.Sim, command: str, values: Callable[[int, NDArray[np.float64]], NDArray]) -> Run:
    """Step through a demo and measure every round trip."""
    amplitudes = np.linspace(1.0, -1.0, sim.worlds)
    shown = np.unique(np.linspace(0, sim.worlds - 1, 9, dtype=int))
    joint_q = [sim.reset().joint_q[shown]]
    commands, trips = [], []
    for frame in tqdm(range(FRAMES), desc=title, unit="frame", disable=None):
        action = values(frame, amplitudes)
        given: dict[str, Any] = {command: {"arm": action}}
        start = time.perf_counter()
        observed = sim.step(**given)
        trips.append(time.perf_counter() - start)
        joint_q.append(observed.joint_q[shown])
        commands.append(action[0])
    return Run(np.array(joint_q, float), np.array(commands, float), np.array(trips), sim.substeps)


def plot(path: Path, target: Run, torque: Run, reference: dict[str, NDArray[np.float64]]) -> None:
    """Draw commanded and actual positions of both demos over time."""
    seconds = np.arange(FRAMES + 1) / 60
    figure, axes = plt.subplots(2, 2, figsize=(10, 6), sharex=True, constrained_layout=True)
    elbow, fingers, push, moved = axes.flat

    for demo, axis, dof in ((target, elbow, 3), (target, fingers, 7), (torque, moved, 2)):
        axis.plot(seconds, demo.joint_q[:, 1:, dof], color="0.8", lw=1, zorder=1)
        axis.plot(seconds, demo.joint_q[:, 0, dof], color="C0", lw=2, label="actual, world 0")
    for name, axis, dof in (("target", elbow, 3), ("target", fingers, 7), ("torque_free", moved, 2)):
        axis.plot(*reference[name][::6, [0, 1 + dof]].T, ".", color="k", ms=4, label="MuJoCo C, float64")
    for axis, dof in ((elbow, 3), (fingers, 7)):
        axis.step(seconds[1:], target.command[:, dof], color="C3", lw=1.2, ls="--", label="commanded")
    push.step(seconds[1:], torque.command[:, 2], color="C3", lw=1.2, ls="--", label="commanded torque")

    elbow.set(title="Target demo: elbow (joint 4)", ylabel="position [rad]")
    fingers.set(title="Target demo: finger, from outside its limit", ylabel="position [m]")
    push.set(title="Torque demo: torque on joint 3", ylabel="torque [N·m]", xlabel="time [s]")
    moved.set(title="Torque demo: joint 3", ylabel="position [rad]", xlabel="time [s]")
    for axis in axes.flat:
        axis.grid(alpha=0.3)
        axis.legend(fontsize=8, loc="best")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=100)


def main() -> None:
    """Run both demos, say what was measured, and draw the plot."""
    parser = argparse.ArgumentParser(description="The first lesson: a Franka arm in thousands of worlds.")
    parser.add_argument("--worlds", type=int, default=4096, help="number of worlds (default 4096)")
    parser.add_argument("--precision", default="f32", choices=["f32", "f64"], help="precision of the run (default f32)")
    parser.add_argument("--threads", type=int, default=None, help="most threads a step may use (default: all cores)")
    parser.add_argument("--out", type=Path, default=OUT, help="folder of the plot (default out/)")
    args = parser.parse_args()

    reference = {
        name: np.loadtxt(REFERENCE / f"mujoco_{name}.csv", delimiter=",") for name in ("target", "torque_free")
    }
    options = {"worlds": args.worlds, "precision": args.precision, "threads": args.threads}
    with tl.launch(scene(driven=True), **options) as sim:
        print(f"{sim.worlds} worlds on {sim.device}, {sim.precision}, daemon {sim.name} (pid {sim.pid})")
        target = run("target demo", sim, "joint_target_q", targets)
    target.print("target demo: position targets", args.worlds, reference["target"], FRAMES)

    with tl.launch(scene(driven=False), **options) as sim:
        torque = run("torque demo", sim, "joint_f", torques)
    # Chaos amplifies rounding: past frame 60 two correct simulators part (in double precision, past frame 120)
    until = 60 if args.precision == "f32" else 120
    torque.print("torque demo: torques only", args.worlds, reference["torque_free"], until)

    picture = args.out / "franka_lesson.png"
    plot(picture, target, torque, reference)
    print(f"plot: {picture}")


if __name__ == "__main__":
    main()
