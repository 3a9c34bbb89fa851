"""Published robots load, and agree with MuJoCo, which reads their files by itself.

Every URDF file in the wheels of `fetch.py`, and every robot that their xacro files make, is tried on a fixed and on a
floating base. `unsupported_files.py` lists those that do not load, each with its reason. `make published` runs this:
the wheels are too large for `make test`; robots of your own: `TIGHTLOOP_URDF=/path/robot.urdf make published`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import mujoco
import mujoco.rollout
import numpy as np
import pytest
from comparison import DOUBLE, MOTION, NOTHING, assert_link_frames
from fetch import PUBLISHED
from mujoco_model import CHAOS, ITERATIONS, PERTURBATION, Array
from numpy.random import Generator
from numpy.typing import NDArray
from options import ROWS
from random_robots import Coordinates
from unsupported_files import REFUSALS, Refusal, refusal
from urdf_to_mujoco import FLOATING_BASE, PREFIX, model_of, root_bodies

import tightloop as tl

# What is mended and noted in these files is not the matter here
pytestmark = pytest.mark.filterwarnings("ignore:robot `:UserWarning")

STATES = 20
FRAMES, SUBSTEPS, DT = 100, 4, 1 / 480
# Frames that motions are compared on average, until they are chaotic; with fewer a comparison says little
FRAMES_MIN = 20
# What a joint's torque alone would make of it, at most [rad/s² or m/s²]
ACCELERATION = 4.0
# Beyond this condition of the mass matrix nobody's accelerations have eight digits
SINGULAR = 1e8
FIELDS = "joint_q joint_qd joint_qdd body_q body_qd mass_matrix bias_force".split()
# A thousand blobs of one link, whose inertia is zero: nobody can move them
BLOBS = "random_urdfs"
# What the paths in the wheels have in common is left out of names
FOLDERS = {"pybullet_data", "rtbdata", "xacro"}
FIXED, FLOATING = "fixed", "floating"


@dataclass(frozen=True)
class File:
    """A robot's file, with the folders of its packages."""

    path: Path
    name: str
    package_dirs: tuple[Path, ...]
    refusal: Refusal | None
    """What is expected of it, if it is not to load."""


def files(config: pytest.Config) -> list[File]:
    """Those that were asked for, or all that were fetched."""
    given, packages = config.getoption("--urdf"), tuple(map(Path, config.getoption("--package-dir")))
    if given:
        return [File(Path(path), Path(path).name, packages, None) for path in given]
    found = sorted(path for path in PUBLISHED.rglob("*.urdf") if not {"packages", BLOBS} & set(path.parts))
    assert found, f"there are no robots in {PUBLISHED}; run `make published`"
    out = []
    for path in found:
        wheel, *rest = path.relative_to(PUBLISHED).parts
        name = "/".join([wheel, *(part for part in rest if part not in FOLDERS)])
        # one of the wheels has no packages
        packages = tuple(folder for folder in (PUBLISHED / wheel / "packages",) if folder.is_dir())
        out.append(File(path, name, packages, refusal(name)))
    return out


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    every = files(metafunc.config)
    if "case" in metafunc.fixturenames:
        some = [(file, base) for file in every if not file.refusal for base in (FIXED, FLOATING)]
        ids = [f"{file.name}-{base}" for file, base in some]
        metafunc.parametrize("case", some, ids=ids, indirect=True, scope="module")
    if "refused" in metafunc.fixturenames:
        some = [file for file in every if file.refusal]
        metafunc.parametrize("refused", some, ids=[file.name for file in some])


@dataclass
class Case:
    """A running robot and the MuJoCo model it is compared with."""

    sim: tl.Sim
    model: mujoco.MjModel
    coordinates: Coordinates
    row: dict[str, str]

    def joint(self, coord: str) -> mujoco._structs._MjModelJointViews | None:
        """MuJoCo's joint of one of our coordinates, if it turns or slides."""
        single = {self.model.joint(number).name for number in np.flatnonzero(self.model.jnt_type >= 2)}
        return self.model.joint(coord) if coord in single else None

    def states(self, rng: Generator, share: float, reach: float, turn: float) -> Array:
        """Positions in a share of each joint's range about its middle; those without range within reach of 0."""
        q = np.zeros((STATES, len(self.sim.coord_names)))
        for number, name in enumerate(self.sim.coord_names):
            joint = self.joint(name)
            if joint is not None:
                low, high = joint.range if joint.limited else (-reach, reach)
                # ranges of many turns, or kilometres, are as good as none
                low, high = max(low, min(high, 0) - np.pi), min(high, max(low, 0) + np.pi)
                q[:, number] = (low + high) / 2 + share * (high - low) * rng.uniform(-0.5, 0.5, STATES)
            elif name.endswith(".qx"):
                quat = [0, 0, 0, 1] + turn * rng.normal(size=(STATES, 4))
                q[:, number : number + 4] = quat / np.linalg.norm(quat, axis=1, keepdims=True)
            elif not name.endswith((".qy", ".qz", ".qw")):
                q[:, number] = rng.uniform(-0.3, 0.3, STATES)
        return q


@pytest.fixture(scope="module")
def case(request: pytest.FixtureRequest) -> Iterator[Case]:
    """A robot on its base; what has no dofs there, or no mass, is checked to be so, and skipped."""
    file, base = request.param
    floating = base == FLOATING
    scene = tl.Scene(dt=DT, substeps=SUBSTEPS)
    scene.solver(iterations=ITERATIONS, tolerance=0.0)
    add = {"name": PREFIX.rstrip("/"), "floating": floating, "package_dirs": file.package_dirs}
    fixed = model_of(file.path, floating=False, dt=DT, package_dirs=file.package_dirs)
    if floating and not fixed.body_mass[root_bodies(fixed)].sum() > 0:
        with pytest.raises(tl.UrdfError, match="moved by joint `floating_base` but has no mass"):
            scene.add_urdf(file.path, **add)
        pytest.skip("its root link weighs nothing, and cannot float")
    robot = scene.add_urdf(file.path, **add)
    model = model_of(file.path, floating=True, dt=DT, package_dirs=file.package_dirs) if floating else fixed
    assert robot.dofs == model.nv
    if not model.nv:
        pytest.skip("nothing moves on a fixed base")
    row = request.config.stash[ROWS].setdefault(f"{file.name} {base}", {"dofs": str(robot.dofs)})
    with tl.launch(scene, worlds=STATES, precision="f64", threads=1, fields=FIELDS) as sim:
        yield Case(sim, model, Coordinates(model, sim), row)


def off(ours: Array, theirs: Array, floor: float = 0.0) -> float:
    """Largest difference, relative to the largest entry, or to a floor where all are smaller."""
    return float(np.nan_to_num(np.abs(ours - theirs).max() / max(np.abs(theirs).max(), floor), nan=np.inf))


def test_names_dofs_and_mass_are_mujocos(case):
    sim, model = case.sim, case.model
    bodies = [model.body(number) for number in range(1, model.nbody)]
    assert sorted(sim.body_names) == sorted(body.name for body in bodies)
    # each of our dofs was found once, by the name of one of their joints
    assert sorted(dof for *_, dofs, _ in case.coordinates.joints for dof in dofs) == list(range(model.nv))
    if model.joint(0).name == FLOATING_BASE:
        mass_matrix = sim.reset().mass_matrix[0]
        np.testing.assert_allclose(mass_matrix[:3, :3], model.body_mass.sum() * np.eye(3), rtol=1e-12, atol=1e-12)


def test_dynamics_at_random_states_are_mujocos(case):
    sim, model, to = case.sim, case.model, case.coordinates
    rng = np.random.default_rng(1)
    # a tenth of the range lies outside of the limits
    q, qd = case.states(rng, 1.1, np.pi, 10.0), rng.uniform(-2, 2, (STATES, model.nv))
    frame = sim.write(joint_q=q, joint_qd=qd)
    assert not frame.status.any()
    data, mass_matrix = mujoco.MjData(model), np.zeros((model.nv, model.nv))
    order = [sim.body_names.index(model.body(number).name) for number in range(1, model.nbody)]
    errors, condition = np.zeros((STATES, 3)), 0.0
    for world in range(STATES):
        convert, drift = to.to_qvel(q[world]), to.drift(q[world], qd[world])
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = to.positions(q[world]), convert @ qd[world]
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, mass_matrix)
        bias = convert.T @ (data.qfrc_bias + mass_matrix @ drift)
        inertia = np.abs(mass_matrix).max()
        errors[world] = (
            off(frame.mass_matrix[world], convert.T @ mass_matrix @ convert),
            # where nothing pulls, forces of that size are those of a unit acceleration
            off(frame.bias_force[world], bias, inertia),
            off(convert @ frame.joint_qdd[world] + drift, data.qacc, NOTHING),
        )
        condition = max(condition, float(np.linalg.cond(mass_matrix)))
        theirs = np.hstack([data.xpos[1:], np.roll(data.xquat[1:], -1, axis=1)])
        assert_link_frames(frame.body_q[world : world + 1, order], theirs[None], DOUBLE.pose)
        jacobian = np.zeros((len(order), 6, model.nv))
        for body, rows in enumerate(jacobian, 1):
            mujoco.mj_jacBodyCom(model, data, rows[:3], rows[3:], body)
        assert off(frame.body_qd[world, order], jacobian @ data.qvel) <= DOUBLE.dynamics, f"body_qd of state {world}"
    case.row |= dict(zip(("M", "bias", "qacc"), (f"{error:.0e}" for error in errors.max(axis=0)), strict=True))
    assert errors[:, 0].max() <= DOUBLE.dynamics, f"mass matrix of state {errors[:, 0].argmax()}"
    assert errors[:, 1].max() <= DOUBLE.dynamics, f"bias force of state {errors[:, 1].argmax()}"
    if condition < SINGULAR:
        assert errors[:, 2].max() <= DOUBLE.acceleration, f"acceleration of state {errors[:, 2].argmax()}"


def test_hundred_frames_of_smooth_torques_follow_mujoco(case):
    sim, model, to = case.sim, case.model, case.coordinates
    rng = np.random.default_rng(2)
    q = case.states(rng, 0.4, 0.5, 0.1)
    frame = sim.write(joint_q=q, joint_qd=np.zeros((STATES, model.nv)))
    # a base that floats moves by what its limbs do
    driven = np.array([not name.startswith(FLOATING_BASE) for name in sim.dof_names])
    amplitude = driven * ACCELERATION / np.diagonal(np.linalg.inv(frame.mass_matrix), axis1=1, axis2=2)
    # what falls as a whole has no weight to hold
    held = driven * frame.bias_force * (0.0 if not driven.all() else 1.0)
    hertz, phase = rng.uniform(0.3, 2.0, (2, STATES, model.nv)), rng.uniform(0, 2 * np.pi, (2, STATES, model.nv))
    waves = np.sin(2 * np.pi * hertz * np.arange(FRAMES)[:, None, None, None] * SUBSTEPS * DT + phase).mean(axis=1)
    torques = held + amplitude * waves
    theirs, calm = reference_motion(case, q, torques, rng)
    error = np.zeros(STATES)
    for number in range(FRAMES):
        frame = sim.step(joint_f=torques[number])
        for world in np.flatnonzero(number < calm):
            assert not frame.status[world], f"status {frame.status[world]} of world {world} in frame {number}"
            error[world] = max(error[world], to.distance(frame.joint_q[world], theirs[world, number]))
    case.row |= {"frames": f"{calm.min()}..{calm.max()}", "motion": f"{error.max():.0e}"}
    assert error.max() <= MOTION, f"world {error.argmax()} within {calm[error.argmax()]} frames"
    assert calm.mean() >= FRAMES_MIN, f"chaotic after {calm} frames"


def reference_motion(case: Case, q: Array, torques: Array, rng: Generator) -> tuple[Array, NDArray[np.int64]]:
    """MuJoCo's positions after each frame of torques ``(frames, worlds, dofs)``, from rest at our positions q.

    Returns qpos ``(worlds, frames, nq)``, and for how many frames each world is not chaotic.
    """
    model, to = case.model, case.coordinates
    applied = np.zeros((STATES, FRAMES, model.nv))
    for _, _, at, _, dofs, _ in to.joints:
        applied[:, :, at : at + len(dofs)] = torques[:, :, dofs].transpose(1, 0, 2)
    start = np.zeros((2, STATES, 1 + model.nq + model.nv))
    start[:, :, 1 : 1 + model.nq] = [to.positions(own) for own in q]
    start[1, :, 1 : 1 + model.nq] += PERTURBATION * rng.choice([-1.0, 1.0], (STATES, model.nq))
    held = np.tile(applied.repeat(SUBSTEPS, axis=1), (2, 1, 1))
    spec = int(mujoco.mjtState.mjSTATE_QFRC_APPLIED)
    data = mujoco.MjData(model)
    state, _ = mujoco.rollout.rollout(model, data, start.reshape(2 * STATES, -1), held, control_spec=spec)
    ends = state[:, SUBSTEPS - 1 :: SUBSTEPS, 1 : 1 + model.nq].reshape(2, STATES, FRAMES, -1)
    # what is not a number is far away, too
    chaotic = ~(np.abs(ends[0] - ends[1]).max(axis=2) <= CHAOS)
    return ends[0], np.where(chaotic.any(axis=1), chaotic.argmax(axis=1), FRAMES)


def test_what_does_not_load_is_refused_for_its_reason(refused):
    with pytest.raises(tl.UrdfError, match=refused.refusal.message):
        tl.Scene().add_urdf(refused.path, name="r", package_dirs=refused.package_dirs)


def test_every_refusal_is_of_a_file(request):
    if request.config.getoption("--urdf"):
        pytest.skip("robots were given")
    names = [file.name for file in files(request.config)]
    assert not [entry.files for entry in REFUSALS if not any(re.search(entry.files, name) for name in names)]
