"""Steps per second of floating robots beside MuJoCo C, on one thread each, in one run.

    python -m benches legged

A quadruped and a humanoid of the project's own (benches/robots) without contacts: MuJoCo's `rollout`, and tightloop
through its daemon and Python. Each joint's drive follows a target that swings about the middle of its range, with
frequencies and phases of each world's own. The sides take turns, so that a machine that changes its speed meanwhile
changes both; ratios are taken within a round. Writes benches/results/MACHINE/legged.csv, and ends with 1 when a robot
is slower than asked.

Like with like: one URDF file, time step, integrator, solver, joint limits, drives, start and kind of commands on both
sides. Not the same: MuJoCo computes in double precision, tightloop in single; MuJoCo's worlds are fewer, which its
steps do not notice. The humanoid has 29 dofs with 23 joints, when wrists and waist turn about one axis, and 35 with all
29. Without dry friction no constraint acts, unless a joint meets its limit; with it, both solvers run in every step.
"""

from __future__ import annotations

import argparse
import re
import sys
import tempfile
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
from record import REPOSITORY, print_slow, print_table, write_results

ROBOTS = REPOSITORY / "benches/robots"
WORLDS = 4096
MUJOCO_WORLDS = 16
FRAMES, SUBSTEPS, DT = 100, 8, 1 / 400
# As benches/robots/mod.rs has them: stiffness [N·m/rad], damping [N·m·s/rad], armature [kg·m²], share of half the range
STIFFNESS, DAMPING, ARMATURE, SWING = 60.0, 2.0, 0.01, 0.5
FRICTION = 0.1  # [N·m], where joints rub
LOCKED = r'(name="(?:\w+_)?(?:waist_roll|waist_pitch|wrist_pitch|wrist_yaw)" type=)"revolute"'
# Joint limits in force space: limit_ke, limit_kd, and the largest impedance of the default solimp
LIMIT_KE, LIMIT_KD, IMPEDANCE_MAX = 1e4, 10.0, 0.95


@dataclass(frozen=True)
class Case:
    """A robot, and how many times as fast as MuJoCo it is asked to be."""

    name: str
    file: str
    locked: bool
    friction: float
    asked: float | None

    def urdf(self) -> str:
        """The robot's text."""
        text = (ROBOTS / self.file).read_text()
        if self.locked:
            text = re.sub(LOCKED, r'\1"fixed"', text)
        return text.replace("<dynamics ", f'<dynamics friction="{self.friction}" ')


CASES = [
    Case("quadruped", "quadruped.urdf", False, 0.0, 40.0),
    Case("humanoid_23", "humanoid.urdf", True, 0.0, 25.0),
    Case("humanoid_29", "humanoid.urdf", False, 0.0, 25.0),
    Case("quadruped_friction", "quadruped.urdf", False, FRICTION, None),
    Case("humanoid_23_friction", "humanoid.urdf", True, FRICTION, None),
    Case("humanoid_29_friction", "humanoid.urdf", False, FRICTION, None),
]


def scene_of(case: Case, folder: Path) -> tl.Scene:
    """The robot, floating, in the middle of its joints' ranges, at 400 steps and 50 control frames a second."""
    file = folder / f"{case.name}.urdf"
    file.write_text(case.urdf())
    scene = tl.Scene(dt=DT, substeps=SUBSTEPS)
    robot = scene.add_urdf(file, name="r", floating=True)
    model = rival_of(case)
    robot.joint_q = np.r_[[0, 0, 0, 0, 0, 0, 1], model.jnt_range[1:].mean(axis=1)]
    robot.joint_target_ke, robot.joint_target_kd, robot.joint_armature = STIFFNESS, DAMPING, ARMATURE
    return scene


def rival_of(case: Case) -> mujoco.MjModel:
    """MuJoCo's model of the robot's file; its free joint comes first, the others in the file's order."""
    text = case.urdf()
    head = text.index(">", text.index("<robot")) + 1
    compiler = '<mujoco><compiler fusestatic="true" discardvisual="true"/></mujoco>'
    spec = mujoco.MjSpec.from_string(text[:head] + compiler + text[head:])
    for joint in spec.joints:
        joint.name, joint.armature = f"r/{joint.name}", ARMATURE
        actuator = spec.add_actuator(trntype=mujoco.mjtTrn.mjTRN_JOINT, target=joint.name)
        actuator.gaintype, actuator.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
        actuator.gainprm[0], actuator.biasprm[:3] = STIFFNESS, (0, -STIFFNESS, -DAMPING)
    spec.worldbody.first_body().add_freejoint(name="r/floating_base")
    option = spec.option
    option.timestep, option.integrator = DT, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.solver, option.cone, option.impratio = mujoco.mjtSolver.mjSOL_NEWTON, mujoco.mjtCone.mjCONE_ELLIPTIC, 1000.0
    option.iterations, option.tolerance = 20, 1e-8
    option.disableflags = mujoco.mjtDisableBit.mjDSBL_CONTACT
    model = spec.compile()
    f = model.dof_invweight0[model.jnt_dofadr] * (1 - IMPEDANCE_MAX)
    limited = model.jnt_limited.astype(bool)
    model.jnt_solref[limited, 0] = (2 / (LIMIT_KD * f))[limited]
    model.jnt_solref[limited, 1] = (LIMIT_KD * f / 2 * np.sqrt(1 / (LIMIT_KE * f)))[limited]
    return model


def targets(model: mujoco.MjModel, worlds: int) -> NDArray[np.float64]:
    """Random smooth targets [rad], shape ``(frames, worlds, joints)``: sines of 0.3 to 1.3 Hz about the middle."""
    rng = np.random.default_rng(0)
    lower, upper = model.jnt_range[1:].T
    frequency, phase = rng.uniform(0.3, 1.3, (worlds, len(lower))), rng.uniform(0, 1, (worlds, len(lower)))
    seconds = np.arange(FRAMES)[:, None, None] * SUBSTEPS * DT
    swing = np.sin(2 * np.pi * (frequency * seconds + phase))
    return (lower + upper) / 2 + SWING * (upper - lower) / 2 * swing


def mujoco_rate(model: mujoco.MjModel, data: mujoco.MjData, commands: NDArray[np.float64]) -> float:
    """Steps per second of MuJoCo's rollout."""
    control = commands.swapaxes(0, 1).repeat(SUBSTEPS, axis=1)
    size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    start = np.zeros((len(control), size))
    start[:, 1 : 1 + model.nq] = np.r_[[0, 0, 0, 1, 0, 0, 0], model.jnt_range[1:].mean(axis=1)]
    state = np.empty((*control.shape[:2], size))
    spec = int(mujoco.mjtState.mjSTATE_CTRL)
    begin = time.perf_counter()
    mujoco.rollout.rollout(model, data, start, control, control_spec=spec, state=state)
    return control.shape[0] * control.shape[1] / (time.perf_counter() - begin)


def daemon_rate(sim: tl.Sim, commands: NDArray[np.float32]) -> float:
    """Steps per second through the daemon."""
    sim.reset()
    begin = time.perf_counter()
    for goal in commands:
        sim.step(joint_target_q=goal)
    return len(commands) * sim.worlds * sim.substeps / (time.perf_counter() - begin)


@dataclass
class Bench:
    """A case at work, and its rates [steps/s], one a round."""

    case: Case
    sim: tl.Sim
    model: mujoco.MjModel
    ours: list[float] = field(default_factory=list)
    theirs: list[float] = field(default_factory=list)

    def round(self, data: mujoco.MjData) -> None:
        """Both sides, one after the other."""
        self.theirs.append(mujoco_rate(self.model, data, targets(self.model, MUJOCO_WORLDS)))
        joints = targets(self.model, WORLDS).astype(np.float32)
        # the free base has no drive
        goals = np.concatenate([np.zeros((FRAMES, WORLDS, 6), np.float32), joints], axis=2)
        self.ours.append(daemon_rate(self.sim, goals))

    def row(self) -> dict[str, str | int]:
        """For people and files; the first round warmed caches and clocks, and is dropped."""
        ours, theirs = np.array(self.ours[1:]), np.array(self.theirs[1:])
        return {
            "robot": self.case.name,
            "dofs": self.model.nv,
            "worlds": WORLDS,
            "mujoco_steps_per_s": f"{np.median(theirs):.0f}",
            "tightloop_steps_per_s": f"{np.median(ours):.0f}",
            "median_ratio": f"{np.median(ours / theirs):.2f}",
            "best_ratio": f"{ours.max() / theirs.max():.2f}",
            "asked_ratio": f"{self.case.asked:.0f}" if self.case.asked else "–",
        }


def main() -> int:
    """Measure in turns, print and write the results; 0 when every robot is as fast as asked."""
    parser = argparse.ArgumentParser(description="Steps per second of floating robots beside MuJoCo C, a thread each.")
    parser.add_argument("--rounds", type=int, default=5, help="rounds that count (default 5)")
    rounds = parser.parse_args().rounds
    benches = []
    with tempfile.TemporaryDirectory() as folder:
        for case in CASES:
            sim = tl.launch(scene_of(case, Path(folder)), worlds=WORLDS, threads=1)
            benches.append(Bench(case, sim, rival_of(case)))
    print(f"MuJoCo {mujoco.__version__}, tightloop {tl.__version__}: {benches[0].sim.device}")
    try:
        for _ in tqdm(range(1 + rounds), desc="rounds", disable=None):
            for bench in benches:
                bench.round(mujoco.MjData(bench.model))
    finally:
        for bench in benches:
            bench.sim.close()
    rows = [bench.row() for bench in benches]
    print_table(rows)
    facts = {"command": f"python -m benches legged --rounds {rounds}", "mujoco": mujoco.__version__, "threads": 1}
    write_results("legged", rows, facts)
    return int(print_slow(rows, "robot"))


if __name__ == "__main__":
    sys.exit(main())
