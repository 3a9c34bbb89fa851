"""Runs a scene through its daemon and beside MuJoCo, and says where they part."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mujoco_model import ITERATIONS, Array, Commands, Evaluation, MujocoModel
from random_trees import states

import tightloop as tl

ENERGIES = ["kinetic_energy", "potential_energy"]
FIELDS = "joint_q joint_qd joint_qdd body_q mass_matrix bias_force efc_J efc_D efc_aref efc_force".split() + ENERGIES
FRAMES = 200

# What is smaller throughout, in SI units, is zero but for rounding: the gravity force of a slide that lies level
NOTHING = 1e-2
# How far a motion may part, until it is chaotic [rad or m]
MOTION = 1e-7


@dataclass(frozen=True)
class Tolerances:
    """How far ours may be off, relative to the largest entry of a vector; poses absolutely [m or 1]."""

    dynamics: float
    acceleration: float
    pose: float
    over_worlds: bool
    """Whether the largest entry is that of all worlds; otherwise of each world by itself."""


# What the project asks for. Rounding is a million times smaller: what is near these bounds is a difference of meaning.
DOUBLE = Tolerances(dynamics=1e-8, acceleration=1e-8, pose=1e-12, over_worlds=False)
# 24 bits leave 6e-8, and the recursions over a dozen links ten times that. A solve multiplies it by as much as inertias
# of locked and of free joints differ, or is refined. Forces that cancel in one world keep the rounding of their parts.
SINGLE = Tolerances(dynamics=1e-5, acceleration=1e-4, pose=1e-5, over_worlds=True)


@dataclass
class Case:
    """A running scene, its reference, and states and commands for every world."""

    sim: tl.Sim
    reference: MujocoModel
    q: Array
    qd: Array
    commands: Commands

    def evaluate(self) -> tuple[tl.Frame, Evaluation]:
        """Both sides at the states, under the commands of frame 0."""
        held = self.commands.at(0)
        self.sim.step(**held)
        frame = self.sim.write(joint_q=self.q, joint_qd=self.qd)
        # states and commands are those that the run's precision can hold
        given = [self.q, self.qd, *held.values()]
        return frame, self.reference.evaluate(*(values.astype(frame.joint_q.dtype).astype(float) for values in given))


@contextmanager
def running(
    scene: tl.Scene,
    *,
    worlds: int = 4,
    frames: int = FRAMES,
    seed: int = 0,
    precision: str = "f64",
    balance_inertia: bool = False,
) -> Iterator[Case]:
    """Launch a scene with random states, no torques, and the states as targets."""
    scene.solver(iterations=ITERATIONS, tolerance=0.0)
    reference = MujocoModel(scene, balance_inertia=balance_inertia)
    q, qd = states(seed, worlds, reference.slides)
    still = np.zeros((worlds, frames, reference.dofs))
    targets = q[:, None].repeat(frames, axis=1)
    with tl.launch(scene, worlds=worlds, precision=precision, threads=1, fields=FIELDS) as sim:
        assert sim.dof_names == reference.dof_names
        assert sim.body_names == reference.body_names
        yield Case(sim, reference, q, qd, Commands(still, targets, still.copy()))


def scene_of(folder: Path, *texts: str, **options: object) -> tl.Scene:
    """A scene of robots ``r0``, ``r1``, … whose URDF files are written to a folder."""
    scene = tl.Scene(**{"dt": 1 / 480, "substeps": 1, **options})
    for number, text in enumerate(texts):
        file = folder / f"r{number}.urdf"
        file.write_text(text)
        scene.add_urdf(file, name=f"r{number}")
    return scene


def assert_close(what: str, ours: Array, theirs: Array, tolerance: float, *, over_worlds: bool = False) -> None:
    """Each world's array within a tolerance of its largest entry, or of that of all worlds."""
    if not theirs.size:
        return
    ours = ours.astype(float).reshape(len(ours), -1)
    theirs = theirs.reshape(len(theirs), -1)
    scale = np.maximum(np.abs(theirs).max(axis=None if over_worlds else 1), NOTHING)
    error = np.nan_to_num(np.abs(ours - theirs).max(axis=1) / scale, nan=np.inf)
    worst = int(error.argmax())
    assert error[worst] <= tolerance, (
        f"{what} of world {worst} is off by {error[worst]:.2e} of its largest entry (at most {tolerance:.0e}):\n"
        f"ours   {ours[worst]}\nMuJoCo {theirs[worst]}"
    )


def assert_dynamics(case: Case, tolerances: Tolerances = DOUBLE) -> tuple[tl.Frame, Evaluation]:
    """Mass matrix, bias, link frames, constraint rows and accelerations are MuJoCo's."""
    frame, expected = case.evaluate()
    assert not frame.status.any()
    for name, tolerance in (
        ("mass_matrix", tolerances.dynamics),
        ("bias_force", tolerances.dynamics),
        ("joint_qdd", tolerances.acceleration),
    ):
        theirs = getattr(expected, name)
        assert_close(name, getattr(frame, name), theirs, tolerance, over_worlds=tolerances.over_worlds)
    assert_link_frames(frame.body_q, expected.body_q, tolerances.pose)
    assert_rows(frame, expected, tolerances)
    return frame, expected


def assert_link_frames(ours: Array, theirs: Array, tolerance: float) -> None:
    """Positions [m], and quaternions (x, y, z, w) but for their sign."""
    sign = np.sign(np.sum(ours[..., 3:] * theirs[..., 3:], axis=-1, keepdims=True))
    aligned = np.concatenate([ours[..., :3], ours[..., 3:] * sign], axis=-1)
    error = np.nan_to_num(np.abs(aligned - theirs).max(axis=(1, 2)), nan=np.inf)
    assert error.max() <= tolerance, f"a link frame of world {error.argmax()} is off by {error.max():.2e} m or 1"


def assert_rows(frame: tl.Frame, expected: Evaluation, tolerances: Tolerances) -> None:
    """Active rows stand in MuJoCo's order; idle ones are zero."""
    for world, rows in enumerate(expected.rows):
        active = frame.efc_D[world] != 0
        for name in ("efc_J", "efc_aref", "efc_force"):
            assert not getattr(frame, name)[world][~active].any(), f"an idle row of world {world} has {name}"
        assert active.sum() == len(rows.D), f"world {world} has {active.sum()} active rows, MuJoCo {len(rows.D)}"
        for name in ("J", "D", "aref", "force"):
            ours, theirs = getattr(frame, f"efc_{name}")[world][active], getattr(rows, name)
            bound = tolerances.acceleration if name == "force" else tolerances.dynamics
            assert_close(f"world {world}: efc_{name}", ours.reshape(1, -1), theirs.reshape(1, -1), bound)


def assert_motion(case: Case) -> Array:
    """Positions and velocities follow MuJoCo's, frame by frame, until the motion is chaotic.

    Returns our positions after each frame, ``(worlds, frames, dofs)``.
    """
    sim, commands = case.sim, case.commands
    start = (case.q, case.qd)
    positions, velocities = case.reference.trajectory(*start, commands, sim.substeps)
    calm = case.reference.calm_frames(positions, *start, commands, sim.substeps)
    frames = positions.shape[1]
    assert calm.mean() >= 0.5 * frames, f"most of what is compared must be calm, but it is until {calm}"

    sim.reset()
    sim.write(joint_q=case.q, joint_qd=case.qd)
    ours = np.empty((2, *positions.shape))
    for number in range(frames):
        frame = sim.step(**commands.at(number))
        ours[:, :, number] = frame.joint_q, frame.joint_qd
        assert not frame.status[number < calm].any(), f"status in frame {number}"
    for world, until in enumerate(calm):
        error = np.abs(ours[0] - positions)[world, :until].max(initial=0.0)
        assert error <= MOTION, f"world {world} is off by {error:.2e} rad or m within {until} frames"
        speed = np.abs(velocities[world, :until]).max(initial=1.0)
        error = np.abs(ours[1] - velocities)[world, :until].max(initial=0.0) / speed
        assert error <= MOTION, f"world {world}: velocities are off by {error:.2e} of {speed:.1f} rad/s or m/s"
    return ours[0]
