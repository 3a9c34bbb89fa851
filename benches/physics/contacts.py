"""Steps per second with contacts beside MuJoCo C, on one thread each, in one run.

    python -m benches contacts

The lesson's arm over its table (recorded torques), the recorded grasp of a cube, and the grasp's scene under random
targets about its own: MuJoCo's `rollout`, and tightloop through its daemon and Python. The sides take turns, so that a
machine that changes its speed meanwhile changes both; ratios are taken within a round. Writes
benches/results/MACHINE/contacts.csv, and ends with 1 when a recorded demo is slower than asked, where there is AVX-512.

Like with like: one URDF file, time step, solver, cone and impratio, pairs of shapes and their softness, commands and
starts. With "one" all worlds get identical commands, as in the record, and the worlds of a register stay together.
With "own" the torques' amplitude, the cube's place, or the targets are each world's own. Not the same: MuJoCo
computes in double precision, tightloop in single; MuJoCo's worlds are fewer; its meshes keep all vertices of their
hulls, tightloop's at most 64, and it finds other points on those (of boxes the same). Where the published meshes and
the recorded models are not beside the repository, both sides take the project's own URDF, whose links are boxes,
cylinders and spheres.
"""

from __future__ import annotations

import argparse
import sys
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

sys.path[:0] = [str(REPOSITORY / "examples"), str(REPOSITORY / "tests/python/mujoco")]
import franka_grasp as grasp  # noqa: E402  (the examples are no package)
import franka_lesson as lesson  # noqa: E402
from mujoco_model import limits_in_force_space  # noqa: E402  (nor are the tests)

REFERENCE = REPOSITORY.parent / "shared/reference"
MODELS = REFERENCE / "models"
PUBLISHED = REFERENCE / "fr3_franka_hand/urdf/fr3_franka_hand.urdf"
WORLDS = 4096
MUJOCO_WORLDS = 32
FRAMES = lesson.FRAMES
COMPILER = '<mujoco><compiler fusestatic="false" discardvisual="true"/></mujoco>'
# Largest impedance of the default solimp; friction damping of a shape, Newton's kf; margin of the cube [m]
IMPEDANCE_MAX, FRICTION_DAMPING, CUBE_MARGIN = 0.95, 1000.0, 1e-3
# Random targets: sines about those of the grasp, of so much [rad], [Hz]; the fingers' go over their whole range [m]
SWING, FREQUENCIES, FINGERS = 0.1, (0.2, 1.0), 0.04


@dataclass(frozen=True)
class Case:
    """A demo, whether its worlds get identical commands, and how many times as fast as MuJoCo it is asked to be."""

    demo: str
    worlds: str
    asked: float | None


CASES = [
    Case("torque", "one", 40.0),
    Case("torque", "own", None),
    Case("grasp", "one", 15.0),
    Case("grasp", "own", None),
    Case("random", "own", None),
]


def is_published() -> bool:
    """Are the published robot and the models of the record there?"""
    return PUBLISHED.exists() and all((MODELS / f"{name}.mjb").exists() for name in ("torque", "grasp"))


def scene_of(demo: str) -> tl.Scene:
    """The scene of a demo."""
    urdf = PUBLISHED if is_published() else lesson.URDF
    if demo != "torque":
        return grasp.scene(urdf=urdf)
    scene = lesson.scene(driven=False, urdf=urdf)
    scene.add_table()
    return scene


def rival_of(demo: str, scene: tl.Scene) -> mujoco.MjModel:
    """MuJoCo's model of a demo: the record's where it is present, otherwise what it makes of our URDF."""
    if is_published():
        return mujoco.MjModel.from_binary_path(str(MODELS / f"{'torque' if demo == 'torque' else 'grasp'}.mjb"))
    return own_rival_of(demo, scene)


def own_rival_of(demo: str, scene: tl.Scene) -> mujoco.MjModel:
    """What MuJoCo makes of the URDF of a demo's scene."""
    spec, links = arm_of(scene, impratio=1000.0)
    add_box(spec.worldbody, "table", (0.0, -0.5, 0.05), (0.4, 0.4, 0.05))
    names = [geom.name for geom in links]
    for name in names:
        spec.add_pair(geomname1="table", geomname2=name)
    if demo != "torque":
        cube = spec.worldbody.add_body(name="cube", pos=(0.0, -0.35, 0.125))
        cube.add_freejoint()
        add_box(cube, "cube", (0.0, 0.0, 0.0), (0.025, 0.025, 0.025), density=400.0)
        for name in ["table", *names]:
            spec.add_pair(geomname1=name, geomname2="cube", margin=CUBE_MARGIN)
    for pair in spec.pairs:
        pair.condim, pair.solref = 3, (0.02, 1.0)
    model = spec.compile()
    limits_in_force_space(model)
    bodies = model.geom_bodyid[np.stack([model.pair_geom1, model.pair_geom2])]
    weight = model.body_invweight0[bodies, 0].sum(axis=0)
    softness = FRICTION_DAMPING * weight * ((1 - IMPEDANCE_MAX) / spec.option.impratio + IMPEDANCE_MAX)
    # what stands still touches nothing that does
    model.pair_solreffriction[:] = np.stack([2 / np.maximum(softness, 1e-9), np.ones_like(softness)], axis=1)
    return model


def arm_of(scene: tl.Scene, *, impratio: float) -> tuple[mujoco.MjSpec, list[mujoco.MjsGeom]]:
    """MuJoCo's options of our scenes, and the scene's driven arm; also its shapes, which touch what pairs name."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    option = spec.option
    option.timestep, option.integrator = scene.dt, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.solver, option.cone = mujoco.mjtSolver.mjSOL_NEWTON, mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio, option.tolerance = impratio, 1e-8
    option.iterations, option.ls_iterations = 20, 100
    arm = scene.robots["arm"]
    text = arm.urdf.read_text()
    head = text.index(">", text.index("<robot")) + 1
    child = mujoco.MjSpec.from_string(text[:head] + COMPILER + text[head:])
    shapes = [geom for body in child.bodies for geom in body.geoms]
    for number, geom in enumerate(shapes):
        geom.name, geom.contype, geom.conaffinity = f"{geom.parent.name}/{number}", 0, 0
    spec.attach(child, prefix="arm/", frame=spec.worldbody.add_frame(pos=arm.pos))
    for dof, name in enumerate(arm.joint_names):
        add_drive(spec, arm, dof, f"arm/{name}")
    return spec, shapes


def add_box(body: mujoco.MjsBody, name: str, pos: tl.checks.Vector, size: tl.checks.Vector, **more: float) -> None:
    """A box that touches what pairs name."""
    body.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_BOX, pos=pos, size=size, contype=0, conaffinity=0, **more)


def add_drive(spec: mujoco.MjSpec, arm: tl.Robot, dof: int, name: str) -> None:
    """Armature, effort limit and, where it is driven, the actuator of a joint."""
    joint, effort = spec.joint(name), arm.joint_effort_limit[dof]
    joint.armature, joint.actfrclimited, joint.actfrcrange = arm.joint_armature[dof], True, (-effort, effort)
    stiffness, damping = arm.joint_target_ke[dof], arm.joint_target_kd[dof]
    if stiffness > 0:
        actuator = spec.add_actuator(trntype=mujoco.mjtTrn.mjTRN_JOINT, target=name)
        actuator.gaintype, actuator.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
        actuator.gainprm[0], actuator.biasprm[:3] = stiffness, (0, -stiffness, -damping)


def commands(case: Case, worlds: int) -> NDArray[np.float32]:
    """Torques [N·m] or targets [rad or m] of a case, shape ``(frames, worlds, 9)``."""
    if case.demo == "torque":
        amplitudes = np.ones(worlds) if case.worlds == "one" else np.linspace(1.1, 0.9, worlds)
        return np.array([lesson.torques(frame, amplitudes) for frame in range(FRAMES)])
    if case.demo == "grasp":
        return np.repeat(grasp.targets()[:, None], worlds, axis=1)
    rng = np.random.default_rng(0)
    # drawn for all worlds, so that those of MuJoCo have the commands of our first
    frequency, phase = rng.uniform(*FREQUENCIES, (WORLDS, 9))[:worlds], rng.uniform(0, 1, (WORLDS, 9))[:worlds]
    seconds = np.arange(FRAMES)[:, None, None] / 60
    swing = np.sin(2 * np.pi * (frequency * seconds + phase))
    goals = grasp.targets()[:, None] + SWING * swing
    goals[:, :, 7:] = FINGERS / 2 * (1 + swing[:, :, 7:])
    return goals.astype(np.float32)


def mujoco_rate(model: mujoco.MjModel, case: Case, substeps: int) -> float:
    """Steps per second of MuJoCo's rollout."""
    control = commands(case, MUJOCO_WORLDS).astype(float).swapaxes(0, 1).repeat(substeps, axis=1)
    start = np.zeros((MUJOCO_WORLDS, mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)))
    start[:, 1:10] = lesson.START
    spec = mujoco.mjtState.mjSTATE_QFRC_APPLIED
    if case.demo != "torque":
        spec = mujoco.mjtState.mjSTATE_CTRL
        cubes = grasp.cubes(MUJOCO_WORLDS)
        cubes[:, 3:] = np.roll(cubes[:, 3:], 1, axis=1)
        start[:, 10:17] = cubes[0] if case.worlds == "one" else cubes
    state, data = np.empty((*control.shape[:2], start.shape[1])), mujoco.MjData(model)
    begin = time.perf_counter()
    mujoco.rollout.rollout(model, data, start, control, control_spec=int(spec), state=state)
    return control.shape[0] * control.shape[1] / (time.perf_counter() - begin)


def daemon_rate(sim: tl.Sim, case: Case, given: NDArray[np.float32]) -> float:
    """Steps per second through the daemon."""
    sim.reset()
    if case.demo != "torque" and case.worlds == "own":
        sim.write(joint_q={"cube": grasp.cubes(sim.worlds)})
    name = "joint_f" if case.demo == "torque" else "joint_target_q"
    begin = time.perf_counter()
    for action in given:
        sim.step(**{name: {"arm": action}})
    return len(given) * sim.worlds * sim.substeps / (time.perf_counter() - begin)


@dataclass
class Bench:
    """A case at work, and its rates [steps/s], one a round."""

    case: Case
    sim: tl.Sim
    model: mujoco.MjModel
    given: NDArray[np.float32]
    ours: list[float] = field(default_factory=list)
    theirs: list[float] = field(default_factory=list)

    def round(self) -> None:
        """Both sides, one after the other."""
        self.theirs.append(mujoco_rate(self.model, self.case, self.sim.substeps))
        self.ours.append(daemon_rate(self.sim, self.case, self.given))

    def row(self) -> dict[str, str | int]:
        """For people and files; the first round warmed caches and clocks, and is dropped."""
        ours, theirs = np.array(self.ours[1:]), np.array(self.theirs[1:])
        # what is asked is asked of 16 lanes
        asked = self.case.asked if "AVX-512" in self.sim.device else None
        return {
            "demo": self.case.demo,
            "worlds_alike": "yes" if self.case.worlds == "one" else "no",
            "worlds": WORLDS,
            "mujoco_worlds": MUJOCO_WORLDS,
            "mujoco_steps_per_s": f"{np.median(theirs):.0f}",
            "tightloop_steps_per_s": f"{np.median(ours):.0f}",
            "median_ratio": f"{np.median(ours / theirs):.2f}",
            "best_ratio": f"{ours.max() / theirs.max():.2f}",
            "asked_ratio": f"{asked:.0f}" if asked else "–",
        }


def main() -> int:
    """Measure in turns, print and write the results; 0 when the recorded demos are as fast as asked."""
    parser = argparse.ArgumentParser(description="Steps per second with contacts beside MuJoCo C, a thread each.")
    parser.add_argument("--rounds", type=int, default=5, help="rounds that count (default 5)")
    rounds = parser.parse_args().rounds
    demos = dict.fromkeys(case.demo for case in CASES)
    scenes = {demo: scene_of(demo) for demo in demos}
    models = {demo: rival_of(demo, scene) for demo, scene in scenes.items()}
    sims = {demo: tl.launch(scene, worlds=WORLDS, threads=1, fields=("joint_q",)) for demo, scene in scenes.items()}
    benches = [Bench(case, sims[case.demo], models[case.demo], commands(case, WORLDS)) for case in CASES]
    robot = "the published robot and the record's models" if is_published() else "the project's own robot"
    print(f"MuJoCo {mujoco.__version__}, tightloop {tl.__version__}: {benches[0].sim.device}; {robot}")
    try:
        for _ in tqdm(range(1 + rounds), desc="rounds", disable=None):
            for bench in benches:
                bench.round()
    finally:
        for sim in sims.values():
            sim.close()
    rows = [bench.row() for bench in benches]
    print_table(rows)
    facts = {"command": f"python -m benches contacts --rounds {rounds}", "mujoco": mujoco.__version__, "threads": 1}
    write_results("contacts", rows, facts | {"robot": robot})
    return int(print_slow(rows, "demo"))


if __name__ == "__main__":
    sys.exit(main())
