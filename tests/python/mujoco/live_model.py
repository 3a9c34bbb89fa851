"""A MuJoCo model and tightloop's reading of it, at the same states and controls."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

import tightloop as tl

Array = NDArray[np.float64]

mujoco.set_mju_user_warning(lambda _: None)


# What a world holds besides positions and velocities.
HELD = ("ctrl", "act", "mocap_pos", "mocap_quat", "eq_active")


@dataclass
class States:
    """States and controls; worlds first, in MuJoCo's conventions."""

    qpos: Array
    qvel: Array
    ctrl: Array
    act: Array
    mocap_pos: Array
    mocap_quat: Array
    eq_active: Array


@dataclass
class Live:
    """A running simulation beside the model."""

    model: mujoco.MjModel
    sim: tl.Sim

    def states(self, seed: int, *, spread: float = 0.4, speed: float = 0.5) -> States:
        """Draw a state per world around the model's start, and controls that reach beyond their ranges."""
        rng, m, worlds = np.random.default_rng(seed), self.model, self.sim.worlds
        qpos = np.tile(m.qpos0, (worlds, 1))
        for row in qpos:
            mujoco.mj_integratePos(m, row, rng.normal(0, spread, m.nv), 1.0)
        qvel, ctrl = rng.normal(0, speed, (worlds, m.nv)), rng.normal(0, 1, (worlds, m.nu))
        act = rng.normal(0, 0.5, (worlds, m.na))
        pos, quat = rng.normal(0, 0.5, (worlds, m.nmocap, 3)), rng.normal(0, 1, (worlds, m.nmocap, 4))
        active = (rng.random((worlds, m.neq)) < 0.7).astype(float)
        return States(qpos, qvel, ctrl, act, pos, quat, active)

    def place(self, states: States) -> tl.Frame:
        """Hold the controls and put the worlds into the states."""
        joint_q, joint_qd = to_joints(self.model, states.qpos, states.qvel)
        more = {name: getattr(states, name) for name in HELD if getattr(states, name).size}
        return self.sim.write(joint_q=joint_q, joint_qd=joint_qd, **more)

    def data(self, states: States) -> Iterator[mujoco.MjData]:
        """MuJoCo's data of each world, in its state."""
        for world in range(len(states.qpos)):
            data = mujoco.MjData(self.model)
            for name in ("qpos", "qvel", *HELD):
                getattr(data, name)[:] = getattr(states, name)[world]
            yield data

    def assert_steps_are_mujocos(self, states: States, steps: int, tolerance: float) -> None:
        """Step both sides from these states, and compare where the bodies are."""
        self.place(states)
        worlds = list(self.data(states))
        for _ in range(steps):
            frame = self.sim.step()
            for data in worlds:
                mujoco.mj_step(self.model, data)
        for world, data in enumerate(worlds):
            assert relative(frame.qpos[world], data.qpos) < tolerance
            assert relative(frame.qvel[world], data.qvel) < 10 * tolerance


@contextmanager
def live(
    model: str | mujoco.MjModel,
    *,
    worlds: int = 8,
    precision: str = "f64",
    device: str = "cpu",
    fields: tuple[str, ...] = (),
    params: tuple[str, ...] = (),
    substeps: int = 1,
    outputs_at: str = "frame",
    solved: bool = True,
) -> Iterator[Live]:
    """Run a model, or that of an XML text; both sides solve to the end if ``solved``, or as its options say."""
    model = mujoco.MjModel.from_xml_string(model) if isinstance(model, str) else model
    if solved:
        model.opt.tolerance = model.opt.ls_tolerance = 0.0
        model.opt.iterations = model.opt.ls_iterations = 100
    model.opt.solver = mujoco.mjtSolver.mjSOL_NEWTON
    scene = tl.Scene.from_mujoco(model, name="m")
    fields = ("qpos", "qvel", "qacc", "joint_q", "joint_qd", *(("act",) if model.na else ()), *fields)
    scene.substeps = substeps
    options = {"device": device, "params": params, "outputs_at": outputs_at}
    with tl.launch(scene, worlds=worlds, precision=precision, fields=fields, **options) as sim:
        yield Live(model, sim)


def relative(found: Array, expected: Array) -> float:
    """Largest difference over the largest value of each row."""
    scale = np.abs(expected).max(axis=-1, keepdims=True, initial=1e-3)
    return float((np.abs(found - expected) / scale).max(initial=0.0))


def has_closed_form(model: mujoco.MjModel, contact: mujoco.MjContact) -> bool:
    """Whether both sides find the same points: of two boxes they may differ in number."""
    return any(model.geom_type[geom] != mujoco.mjtGeom.mjGEOM_BOX for geom in contact.geom)


def to_joints(model: mujoco.MjModel, qpos: Array, qvel: Array) -> tuple[Array, Array]:
    """Convert MuJoCo's positions and velocities to ``joint_q`` and ``joint_qd``."""
    joint_q, joint_qd = qpos.copy(), qvel.copy()
    for joint in range(model.njnt):
        kind, body = model.jnt_type[joint], model.jnt_bodyid[joint]
        q, d = model.jnt_qposadr[joint], model.jnt_dofadr[joint]
        if kind == mujoco.mjtJoint.mjJNT_BALL:
            joint_q[:, q : q + 4] = np.roll(qpos[:, q : q + 4], -1, axis=1)
        elif kind == mujoco.mjtJoint.mjJNT_FREE:
            joint_q[:, q + 3 : q + 7] = np.roll(qpos[:, q + 3 : q + 7], -1, axis=1)
            for world in range(len(qpos)):
                center, rotation = _center(model, qpos[world], body)
                spin = rotation @ qvel[world, d + 3 : d + 6]
                joint_qd[world, d : d + 3] += np.cross(spin, center - qpos[world, q : q + 3])
                joint_qd[world, d + 3 : d + 6] = spin
    return joint_q, joint_qd


def _center(model: mujoco.MjModel, qpos: Array, body: int) -> tuple[Array, Array]:
    """Centre of mass of a free body with all that is fixed to it, and its rotation."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    parts = np.flatnonzero(model.body_weldid == body)
    mass = model.body_mass[parts]
    return mass @ data.xipos[parts] / mass.sum(), data.xmat[body].reshape(3, 3)
