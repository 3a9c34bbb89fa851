"""The arm of the lesson: scenes and commands of the demo."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import tightloop as tl
from tightloop.assets import FR3

FRAMES = 180  # 3 s at 60 Hz
URDF = FR3
#: Runs of MuJoCo C 3.17 in float64, ``target``, ``torque`` and ``grasp``: coordinates of frames 0 to 180 [rad, m; the
#: cube's quaternion w first]; and ``goals``, targets of the grasp's 180 frames. `tests/data/demo.py` makes the file.
RECORD = Path(__file__).with_name("record.npz")
# float32 values, as the record has them. The fingers start outside their limit, and settle.
START = np.array(
    [-3.6802115e-3, 2.3901723e-2, 3.6804110e-3, -2.3683236, -1.2918962e-4, 2.3922248, 7.8549200e-1, 0.05, 0.05],
    dtype=np.float32,
)
STIFFNESS = np.array([4500.0, 4500, 3500, 3500, 2000, 2000, 2000, 100, 100])  # [N·m/rad, N/m]


def arm(*, driven: bool) -> tl.Scene:
    """The arm on its stand; ``driven`` says whether its drives hold targets or only torques move it."""
    scene = tl.Scene(dt=1 / 480, substeps=8)
    robot = scene.add_urdf(URDF, name="arm", pos=(-0.5, -0.5, 0.1))
    robot.joint_q = START
    robot.joint_target_ke = STIFFNESS if driven else 0.0
    robot.joint_target_kd = STIFFNESS / 10 if driven else 0.0
    robot.joint_effort_limit = [87] * 4 + [12] * 3 + [100] * 2
    robot.joint_armature = [0.195] * 4 + [0.074] * 3 + [0.1] * 2
    return scene


def grasp() -> tl.Scene:
    """The arm, a table and a cube on it."""
    scene = arm(driven=True)
    scene.add_table()
    scene.add_cube()
    return scene


def record(name: str) -> NDArray[np.float64]:
    """A recorded run, or the grasp's targets."""
    with np.load(RECORD) as arrays:
        return arrays[name]


def amplitudes(worlds: int) -> NDArray[np.float64]:
    """Return a factor per world, from 1, the record's, to -1."""
    return np.linspace(1.0, -1.0, worlds)


def torques(frame: int, worlds: int) -> NDArray[np.float32]:
    """Joint torques [N·m], shape ``(worlds, 9)``: the third joint is pushed one way, then the other."""
    tau = np.zeros((worlds, 9), np.float32)
    tau[:, 2] = amplitudes(worlds) * (35.0 * np.sin(2 * np.pi * frame / FRAMES))
    return tau


def targets(frame: int, worlds: int) -> NDArray[np.float32]:
    """Drive targets [rad or m], shape ``(worlds, 9)``: the elbow swings, the fingers close to their limit."""
    goal = np.tile(START, (worlds, 1))
    goal[:, 3] += amplitudes(worlds) * (0.4 * np.sin(2 * np.pi * frame / FRAMES))
    goal[:, 7:] = 0.04
    return goal


def wave(frame: int, worlds: int, side: int) -> NDArray[np.float32]:
    """Drive targets [rad or m], shape ``(worlds, 9)``: each arm nods a little later than its neighbours.

    Args:
        frame: Frame of the round, from 0.
        worlds: How many arms.
        side: Arms in a row of the square that is seen; those beyond it go on from its first row.
    """
    row, column = np.divmod(np.arange(worlds), side)
    phase = 2 * np.pi * (frame / 120 - row / 16 - column / 24)
    # it begins at the start
    share = min(frame / 30, 1.0)
    goal = np.tile(START, (worlds, 1))
    goal[:, 7:] = 0.04
    goal[:, 0] += share * 0.5 * np.sin(phase)
    goal[:, 1] += share * 0.35 * np.cos(phase)
    goal[:, 3] += share * 0.5 * np.sin(phase)
    goal[:, 5] += share * 0.4 * np.cos(phase)
    return goal


def cubes(worlds: int) -> NDArray[np.float64]:
    """Where the cube starts: position [m], quaternion (x, y, z, w), shape ``(worlds, 7)``; in world 0 as recorded."""
    rng = np.random.default_rng(0)
    x, y = rng.uniform(-0.005, 0.005, (2, worlds))
    turn = rng.uniform(-0.2, 0.2, worlds)
    x[0] = y[0] = turn[0] = 0.0
    zero = np.zeros(worlds)
    return np.stack([x, y - 0.35, zero + 0.125, zero, zero, np.sin(turn / 2), np.cos(turn / 2)], axis=1)
