"""Inverse kinematics: the hand of a Franka arm follows a square, by position targets from `tl.ik`.

    python examples/newton_ik_lesson.py --worlds 16        # --view shows it in the browser

Newton's lesson after "Controlling a Robot" does this with its IKSolver. Here the joint positions of the whole path are
found first, then a simulation with drives follows them.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from newton_lesson import Pace, build_franka_scene
from numpy.typing import NDArray

import tightloop as tl

HAND = "arm/fr3_hand_tcp"
DOWN = (1.0, 0.0, 0.0, 0.0)  # the hand's z axis points to the ground
CENTER, SIDE = (-0.05, -0.5, 0.45), 0.3  # of the square, in the plane of y and z [m]
SECONDS = 6.0  # for the square
SETTLE = 60  # frames to the first corner, and frames of rest there

Array = NDArray[np.float64]


def square(points: int) -> Array:
    """Positions along a square from its lower right corner, ``(points, 3)``."""
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)]) * SIDE / 2
    along = np.linspace(0, 4, points)
    y, z = (np.interp(along, range(5), corners[:, axis]) for axis in range(2))
    return np.stack([np.zeros(points), y, z], axis=1) + CENTER


def joint_path(scene: tl.Scene, path: Array) -> Array:
    """Joint positions along the path, each solved from the one before, ``(points, coords)``."""
    solver = tl.ik(scene, tl.Reach(HAND))
    q, found = None, []
    for number, position in enumerate(path):
        # later points stay with the arm's present bend: no restarts
        result = solver.solve(position, DOWN, joint_q=q, restarts=0 if number else 100)
        if not result.success:
            raise SystemExit(f"point {number} of the path is {1e3 * result.position_error:.1f} mm out of reach")
        q = result.joint_q
        found.append(q)
    return np.array(found)


def follow(worlds: int, view: bool) -> tuple[Array, Array]:
    """Follow the square with the drives of a simulation; targets and positions of the hand, ``(frames, 3)`` [m]."""
    scene = build_franka_scene(include_table=False, include_cube=False)
    scene.robots["arm"].joint_target_mode = "both"  # the drives follow velocities, too
    path = square(round(SECONDS / (scene.dt * scene.substeps)))
    goals = joint_path(scene, path)
    # along a line in joint space to the first corner, and a moment there
    lead = np.linspace(scene.robots["arm"].joint_q, goals[0], SETTLE)
    goals = np.concatenate([lead, np.repeat(goals[:1], SETTLE, axis=0), goals])
    rates = np.gradient(goals, scene.dt * scene.substeps, axis=0)
    reached = []
    with tl.launch(scene, worlds=worlds, fields=("body_q",)) as sim:
        hand, pace = sim.body_names.index(HAND), Pace(sim, view)
        # these forces carry the arm's weight, so that the drives need not
        weights = sim.inverse_dynamics(goals)
        for goal, rate, weight in zip(goals, rates, weights, strict=True):
            frame = sim.step(joint_target_q=goal, joint_target_qd=rate, joint_f=weight)
            reached.append(frame.body_q[0, hand, :3].astype(float))
            pace.keep()
    return path, np.array(reached[-len(path) :])


def main() -> None:
    """Follow the square, and say how near the hand stayed to it."""
    parser = argparse.ArgumentParser(description="A Franka hand along a square, by inverse kinematics.")
    parser.add_argument("--worlds", type=int, default=1, help="number of worlds (default 1)")
    parser.add_argument("--view", action="store_true", help="show it in the browser, in real time")
    args = parser.parse_args()
    start = time.perf_counter()
    path, reached = follow(args.worlds, args.view)
    error = 1e3 * np.linalg.norm(reached - path, axis=1)
    print(
        f"square of {100 * SIDE:.0f} cm in {SECONDS:.0f} s: the hand is {error.mean():.1f} mm off its target in the ",
        end="",
    )
    print(f"mean, {error.max():.1f} mm at most; {time.perf_counter() - start:.1f} s with {args.worlds} worlds")


if __name__ == "__main__":
    main()
