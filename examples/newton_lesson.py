"""Newton's lesson "Controlling a Robot", step by step: a Franka arm driven by torques, then by position targets.

    python examples/newton_lesson.py --worlds 4096        # --view shows it in the browser

The lesson: https://docs.nvidia.com/learning/physical-ai/getting-started-with-newton/latest/newton-fundamentals/robot-control.html
docs/pages/start/lesson.md has its calls and ours side by side.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import tightloop as tl

URDF = Path(__file__).parent / "assets/fr3/fr3_franka_hand.urdf"
FRAMES = 180  # 3 s at 60 frames a second
# The fingers start outside their limit, and settle.
HOME = [-3.6802115e-3, 2.3901723e-2, 3.6804110e-3, -2.3683236, -1.2918962e-4, 2.3922248, 7.8549200e-1, 0.05, 0.05]


def build_franka_scene(include_table: bool = True, include_cube: bool = True, use_targets: bool = True) -> tl.Scene:
    """The arm on its stand beside a table; without targets only torques move it."""
    scene = tl.Scene(dt=1 / 480, substeps=8)
    arm = scene.add_urdf(URDF, name="arm", pos=(-0.5, -0.5, 0.1))
    arm.joint_q = HOME
    gains = np.array([4500, 4500, 3500, 3500, 2000, 2000, 2000, 100, 100])
    arm.joint_target_ke = gains if use_targets else 0
    arm.joint_target_kd = gains / 10 if use_targets else 0
    arm.joint_effort_limit = [87] * 4 + [12] * 3 + [100] * 2
    arm.joint_armature = [0.195] * 4 + [0.074] * 3 + [0.1] * 2
    if include_table:
        scene.add_table()
    if include_cube:
        scene.add_cube()
    return scene


def torque_demo(worlds: int, view: bool) -> NDArray[np.float32]:
    """Push the third joint one way, then the other; ``joint_q`` of world 0 in each frame."""
    positions = []
    with tl.launch(build_franka_scene(include_cube=False, use_targets=False), worlds=worlds) as sim:
        pace = Pace(sim, view)
        for frame in range(FRAMES):
            tau = np.zeros(9)
            tau[2] = 35 * np.sin(2 * np.pi * frame / FRAMES)
            positions.append(sim.step(joint_f=tau).joint_q[0].copy())
            pace.keep()
    return np.array(positions)


def target_demo(worlds: int, view: bool) -> NDArray[np.float32]:
    """Swing the elbow around its home, and close the fingers to their limit."""
    positions = []
    with tl.launch(build_franka_scene(include_cube=False), worlds=worlds) as sim:
        pace = Pace(sim, view)
        for frame in range(FRAMES):
            goal = np.array(HOME, np.float32)
            goal[3] += 0.4 * np.sin(2 * np.pi * frame / FRAMES)
            goal[7:] = 0.04
            positions.append(sim.step(joint_target_q=goal).joint_q[0].copy())
            pace.keep()
    return np.array(positions)


class Pace:
    """As fast as it goes, or, where somebody watches, as fast as time goes."""

    def __init__(self, sim: tl.Sim, view: bool) -> None:
        self.frame, self.next = sim.dt * sim.substeps, time.perf_counter()
        self.viewer = sim.view() if view else None
        if self.viewer is not None:
            print(f"watch at {self.viewer.url}")
            input("press Enter to begin ")

    def keep(self) -> None:
        """Wait until the frame is over."""
        self.next = max(self.next + self.frame, time.perf_counter() - self.frame)
        if self.viewer is not None:
            time.sleep(max(0.0, self.next - time.perf_counter()))


def main() -> None:
    """Run both demos and say where the joints went."""
    parser = argparse.ArgumentParser(description="Newton's lesson on controlling a robot, in tightloop.")
    parser.add_argument("--worlds", type=int, default=1, help="number of worlds (default 1)")
    parser.add_argument("--view", action="store_true", help="show it in the browser, in real time")
    args = parser.parse_args()
    for name, demo, joint in (("torque", torque_demo, 2), ("target", target_demo, 3)):
        start = time.perf_counter()
        moved = demo(args.worlds, args.view)[:, joint]
        print(f"{name} demo: joint {joint + 1} from {moved.min():.3f} to {moved.max():.3f} rad, ", end="")
        print(f"{FRAMES} frames of {args.worlds} worlds in {time.perf_counter() - start:.2f} s")


if __name__ == "__main__":
    main()
