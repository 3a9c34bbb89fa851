"""A box on a ground is pushed for a moment: how far it slides, over friction and mass, in thousands of worlds.

    python examples/randomized_push.py --worlds 4096

One launch, one program: in each world the ground has a friction of its own, the box a mass and a start, all drawn from
the seed. While a force F acts for T seconds, a box of mass m is accelerated by F/m - μ g, and then slowed down by μ g;
a box that F cannot move stays. The plot has the worlds, and that law.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np
from learning.places import OUT
from numpy.typing import NDArray

import tightloop as tl

matplotlib.use("Agg")
from matplotlib import pyplot as plt

HERE = Path(__file__).resolve().parent
HALF, DENSITY, GRAVITY = (0.1, 0.1, 0.02), 250.0, 9.81  # half edges [m], [kg/m³], [m/s²]
MASS = DENSITY * float(np.prod(2 * np.array(HALF)))  # of the scene's box, which is flat and does not tumble [kg]
FORCE, PUSHED, FRAMES = 2.0, 0.5, 180  # [N], [s]; 60 frames a second
FRICTIONS, SCALES = (0.05, 0.8), (0.5, 2.0)
STARTS = 0.5  # the box starts off by at most so much in x and y [m]
CLOSE = 0.02  # of the law, beside 1 cm [–]


def scene() -> tl.Scene:
    """A ground, and a box on it that starts somewhere near the origin, turned anyhow about z."""
    scene = tl.Scene(dt=1 / 480, substeps=8)
    # of two that touch the larger friction counts: the ground's
    scene.add_ground(mu=FRICTIONS[0])
    scene.add_body(name="box", pos=(0.0, 0.0, HALF[2]))
    scene.add_box(body="box", half_extents=HALF, density=DENSITY, mu=0.0)
    around = tl.Uniform(-STARTS, STARTS)
    scene.randomize(
        body_q={"box": {"x": around, "y": around, "yaw": tl.Uniform(-np.pi, np.pi)}},
        params={"shape_mu": {"ground": tl.Uniform(*FRICTIONS)}, "body_mass_scale": {"box": tl.Uniform(*SCALES)}},
    )
    return scene


def law(mu: NDArray[np.float64], mass: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far a box slides [m]: ½ a T² while it is pushed, then v t - ½ μ g t² until it stands or the time is over."""
    pushed, slowed = np.maximum(FORCE / mass - mu * GRAVITY, 0.0), mu * GRAVITY
    speed = pushed * PUSHED
    after = np.minimum(speed / slowed, FRAMES / 60 - PUSHED)
    return 0.5 * pushed * PUSHED**2 + speed * after - 0.5 * slowed * after**2


@dataclass
class Run:
    """What the worlds did, each of shape ``(worlds,)``."""

    mu: NDArray[np.float64]  # [–]
    mass: NDArray[np.float64]  # [kg]
    slid: NDArray[np.float64]  # [m]
    status: NDArray[np.uint32]  # every bit that was ever set
    seconds: float

    @property
    def off(self) -> NDArray[np.float64]:
        """Distance from the law [m]."""
        return np.abs(self.slid - law(self.mu, self.mass))


def run(*, worlds: int, seed: int, precision: str, threads: int | None) -> Run:
    """Launch the scene, draw each world's friction and mass, and push."""
    with tl.launch(
        scene(), worlds=worlds, precision=precision, threads=threads, params=("body_f",), fields=("joint_q",)
    ) as sim:
        start = sim.reset(seed=seed).joint_q.copy()
        mu = sim.params.shape_mu[:, sim.shape_names.index("ground")].astype(float)
        scale = sim.params.body_mass_scale[:, 0].astype(float)
        push = np.zeros((worlds, len(sim.body_names), 6))
        push[:, 0, 0] = FORCE
        status, seconds = np.zeros(worlds, np.uint32), 0.0
        frame = sim.forward()
        for number in range(FRAMES):
            begin = time.perf_counter()
            # a load holds until another is given
            load = {0: push, round(60 * PUSHED): 0 * push}.get(number)
            frame = sim.step(body_f=load)
            seconds += time.perf_counter() - begin
            np.bitwise_or(status, frame.status, out=status)
        slid = (frame.joint_q - start)[:, 0].astype(float)
    return Run(mu=mu, mass=MASS * scale, slid=slid, status=status, seconds=seconds)


def plot(path: Path, run: Run) -> None:
    """Draw how far the boxes slid over friction and mass, and how far that is from the law."""
    figure, (slid, off) = plt.subplots(1, 2, figsize=(10, 4), constrained_layout=True)
    dots = slid.scatter(run.mu, run.slid, c=run.mass, s=4, cmap="viridis")
    figure.colorbar(dots, ax=slid, label="mass [kg]")
    mu = np.linspace(*FRICTIONS, 200)
    for scale in (SCALES[0], 1.0, SCALES[1]):
        slid.plot(mu, law(mu, np.full_like(mu, MASS * scale)), color="k", lw=1)
    slid.set(title=f"Pushed by {FORCE:g} N for {PUSHED:g} s", xlabel="friction [–]", ylabel="way [m]", yscale="symlog")
    off.scatter(law(run.mu, run.mass), 1e3 * run.off, c=run.mass, s=4, cmap="viridis")
    off.set(title="Distance from the law (lines on the left)", xlabel="way by the law [m]", ylabel="[mm]")
    for axis in (slid, off):
        axis.grid(alpha=0.3)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=100)


def main() -> None:
    """Push in every world, compare with the law, and draw the plot."""
    parser = argparse.ArgumentParser(description="Boxes of many masses are pushed over grounds of many frictions.")
    parser.add_argument("--worlds", type=int, default=4096, help="worlds (default 4096)")
    parser.add_argument("--seed", type=int, default=0, help="of frictions, masses and starts (default 0)")
    parser.add_argument("--precision", default="f32", choices=["f32", "f64"], help="precision of the run (default f32)")
    parser.add_argument("--threads", type=int, default=None, help="most threads a step may use (default: all cores)")
    parser.add_argument("--out", type=Path, default=OUT, help="folder of the plot (default out/)")
    args = parser.parse_args()

    done = run(worlds=args.worlds, seed=args.seed, precision=args.precision, threads=args.threads)
    close = (done.off <= 0.01 + CLOSE * law(done.mu, done.mass)).sum()
    print(f"{(done.slid > 0.01).sum()} of {args.worlds} boxes slid, by up to {done.slid.max():.2f} m")
    print(
        f"{close} of {args.worlds} within 1 cm and {CLOSE:.0%} of the law; median distance {np.median(done.off):.1e} m"
    )
    rate = args.worlds * 8 * FRAMES / done.seconds
    print(f"{rate:,.0f} physics steps/s; status set in {(done.status > 0).sum()} worlds")
    picture = args.out / "randomized_push.png"
    plot(picture, done)
    print(f"plot: {picture}")


if __name__ == "__main__":
    main()
