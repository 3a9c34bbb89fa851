"""Runs a scene through its daemon and beside MuJoCo, and says where they part."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from trees import states
from twin import ITERATIONS, Array, Commands, Evaluation, Twin

import tightloop as tl

FIELDS = "joint_q joint_qd joint_qdd body_q mass_matrix bias_force efc_J efc_D efc_aref efc_force status".split()
FRAMES = 200

# f64: the project asks for 1e-8 of the largest entry of a vector; rounding alone is a million times smaller.
# f32: what 24 bits leave after the recursions over a dozen links (2^-24 = 6e-8), and after a solve in mass matrices of
# condition 1e3 or so.
DOUBLE = {"dynamics": 1e-8, "acceleration": 1e-8, "pose": 1e-12, "motion": 1e-7}
SINGLE = {"dynamics": 1e-5, "acceleration": 1e-4, "pose": 1e-5}


@dataclass
class Case:
    """A running scene, its twin, and states and commands for every world."""

    sim: tl.Sim
    twin: Twin
    q: Array
    qd: Array
    commands: Commands

    def evaluate(self) -> tuple[tl.Frame, Evaluation]:
        """Both sides at the states, under the commands of frame 0."""
        held = self.commands.at(0)
        self.sim.step(**held)
        frame = self.sim.write(joint_q=self.q, joint_qd=self.qd)
        # in f32 the states are those that it holds
        q, qd = frame.joint_q.astype(float), frame.joint_qd.astype(float)
        rounded = [values.astype(frame.joint_q.dtype).astype(float) for values in held.values()]
        return frame, self.twin.evaluate(q, qd, *rounded)


@contextmanager
def running(
    scene: tl.Scene, *, worlds: int = 16, frames: int = FRAMES, seed: int = 0, precision: str = "f64"
) -> Iterator[Case]:
    """Launches a scene with random states, and commands that are zero but for the targets, which are the states."""
    scene.solver(iterations=ITERATIONS, tolerance=0.0)
    twin = Twin(scene)
    q, qd = states(seed, worlds, twin.slides)
    still = np.zeros((worlds, frames, twin.dofs))
    targets = q[:, None].repeat(frames, axis=1)
    with tl.launch(scene, worlds=worlds, precision=precision, threads=1, fields=FIELDS) as sim:
        assert sim.dof_names == twin.dof_names
        assert sim.body_names == twin.body_names
        yield Case(sim, twin, q, qd, Commands(still, targets, still.copy()))


def scene_of(path: Path, *texts: str, **options: object) -> tl.Scene:
    """A scene of robots ``r0``, ``r1``, … that are written to a folder; no gravity but the default."""
    scene = tl.Scene(**{"dt": 1 / 480, "substeps": 1, **options})
    for number, text in enumerate(texts):
        file = path / f"r{number}.urdf"
        file.write_text(text)
        scene.add_urdf(file, name=f"r{number}")
    return scene


def assert_close(what: str, ours: Array, theirs: Array, tolerance: float) -> None:
    """Every world's array within a tolerance of its largest entry."""
    ours = ours.astype(float).reshape(len(ours), -1)
    theirs = theirs.reshape(len(theirs), -1)
    if not theirs.size:
        return
    scale = np.abs(theirs).max(axis=1)
    error = np.abs(ours - theirs).max(axis=1) / np.where(scale > 0, scale, 1.0)
    worst = int(np.where(np.isnan(error), np.inf, error).argmax())
    assert error[worst] <= tolerance, (
        f"{what} of world {worst} is off by {error[worst]:.2e} of its largest entry (at most {tolerance:.0e}):\n"
        f"ours   {ours[worst]}\nMuJoCo {theirs[worst]}"
    )


def assert_dynamics(case: Case, tolerances: dict[str, float] = DOUBLE) -> tuple[tl.Frame, Evaluation]:
    """Mass matrix, bias, poses, constraint rows and accelerations are MuJoCo's."""
    frame, judge = case.evaluate()
    assert not frame.status.any()
    assert_close("mass_matrix", frame.mass_matrix, judge.mass_matrix, tolerances["dynamics"])
    assert_close("bias_force", frame.bias_force, judge.bias_force, tolerances["dynamics"])
    assert_poses(frame.body_q, judge.body_q, tolerances["pose"])
    assert_rows(frame, judge, tolerances)
    assert_close("joint_qdd", frame.joint_qdd, judge.joint_qdd, tolerances["acceleration"])
    return frame, judge


def assert_poses(ours: Array, theirs: Array, tolerance: float) -> None:
    """Positions [m], and quaternions (x, y, z, w) but for their sign."""
    ours = ours.astype(float)
    sign = np.sign(np.sum(ours[..., 3:] * theirs[..., 3:], axis=-1, keepdims=True))
    aligned = np.concatenate([ours[..., :3], ours[..., 3:] * sign], axis=-1)
    error = np.abs(aligned - theirs).max(axis=(1, 2))
    assert error.max() <= tolerance, f"a link of world {error.argmax()} is off by {error.max():.2e} m or 1"


def assert_rows(frame: tl.Frame, judge: Evaluation, tolerances: dict[str, float]) -> None:
    """Active rows stand in MuJoCo's order; idle ones are zero."""
    for world, rows in enumerate(judge.rows):
        active = frame.efc_D[world] != 0
        for name in ("efc_J", "efc_aref", "efc_force"):
            assert not getattr(frame, name)[world][~active].any(), f"an idle row of world {world} has {name}"
        assert active.sum() == len(rows.D), f"world {world} has {active.sum()} active rows, MuJoCo {len(rows.D)}"
        for name, bound in (("J", "dynamics"), ("D", "dynamics"), ("aref", "dynamics"), ("force", "acceleration")):
            ours, theirs = getattr(frame, f"efc_{name}")[world][active], getattr(rows, name)
            assert_close(f"efc_{name}", ours.reshape(1, -1), theirs.reshape(1, -1), tolerances[bound])


def assert_motion(case: Case) -> Array:
    """Positions and velocities follow MuJoCo's, frame by frame, until the motion is chaotic.

    Returns our positions after each frame, ``(worlds, frames, dofs)``.
    """
    sim, twin, commands = case.sim, case.twin, case.commands
    sim.reset()
    sim.write(joint_q=case.q, joint_qd=case.qd)
    frames = [sim.step(**commands.at(frame)) for frame in ()] or []
    ours_q, ours_qd = [], []
    for number in range(commands.joint_f.shape[1]):
        frame = sim.step(**commands.at(number))
        ours_q.append(frame.joint_q.copy())
        ours_qd.append(frame.joint_qd.copy())
        assert not frame.status.any(), f"status in frame {number}"
    del frames
    ours = np.stack(ours_q, axis=1), np.stack(ours_qd, axis=1)
    theirs = twin.trajectory(case.q, case.qd, commands, sim.substeps)
    calm = twin.calm_frames(case.q, case.qd, commands, sim.substeps)
    assert calm.mean() >= 0.5 * ours[0].shape[1], "most of what is compared must be calm"
    for world, until in enumerate(calm):
        error = np.abs(ours[0][world] - theirs[0][world])[:until].max(initial=0.0)
        assert error <= DOUBLE["motion"], f"world {world} is off by {error:.2e} rad or m within {until} frames"
        speed = np.abs(theirs[1][world])[:until].max(initial=1.0)
        error = np.abs(ours[1][world] - theirs[1][world])[:until].max(initial=0.0) / speed
        assert error <= DOUBLE["motion"], f"world {world}: velocities are off by {error:.2e} of {speed:.1f}"
    return ours[0]
