"""The robots of benches/physics/legged.py are the same in MuJoCo: what is compared there is the same work."""

from __future__ import annotations

import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest
from comparison import DOUBLE
from mujoco_model import ITERATIONS
from random_robots import Coordinates
from test_every_joint import off

import tightloop as tl

sys.path.append(str(Path(__file__).parents[4] / "benches/physics"))
from legged import CASES, Case, rival_of, scene_of

WORLDS = 32
# What the project asks for in single precision, relative to the largest entry
TOLERANCES = {"f64": DOUBLE.acceleration, "f32": 1e-4}


@pytest.mark.parametrize("precision", TOLERANCES)
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_dynamics_are_mujocos(tmp_path, case: Case, precision):
    scene, model = scene_of(case, tmp_path), rival_of(case)
    scene.solver(iterations=ITERATIONS, tolerance=0.0)
    model.opt.iterations, model.opt.tolerance = ITERATIONS, 0.0
    data, mass_matrix = mujoco.MjData(model), np.zeros((model.nv, model.nv))
    rng = np.random.default_rng(3)
    # every second world stays within its limits
    reach = np.where(np.arange(WORLDS) % 2, 1.05, 0.95)[:, None]
    lower, upper = model.jnt_range[1:].T
    joints = (lower + upper) / 2 + reach * rng.uniform(-1, 1, (WORLDS, len(lower))) * (upper - lower) / 2
    turn = rng.normal(size=(WORLDS, 4))
    q = np.hstack([rng.normal(size=(WORLDS, 3)), turn / np.linalg.norm(turn, axis=1, keepdims=True), joints])
    fields = "joint_q joint_qd joint_qdd mass_matrix bias_force efc_D".split()
    with tl.launch(scene, worlds=WORLDS, precision=precision, threads=1, fields=fields) as sim:
        to = Coordinates(model, sim)
        frame = sim.write(joint_q=q, joint_qd=rng.normal(size=(WORLDS, model.nv)))
        limited = frame.efc_D[:, -len(lower) :].any(axis=1)
        assert limited.any() and not limited.all()
        for world in range(WORLDS):
            # what the run's precision made of the state
            q, qd = frame.joint_q[world].astype(float), frame.joint_qd[world].astype(float)
            convert, drift = to.to_qvel(q), to.drift(q, qd)
            mujoco.mj_resetData(model, data)
            data.qpos[:], data.qvel[:], data.ctrl[:] = to.positions(q), convert @ qd, (lower + upper) / 2
            mujoco.mj_forward(model, data)
            mujoco.mj_fullM(model, data, mass_matrix)
            bias = convert.T @ (data.qfrc_bias + mass_matrix @ drift)
            assert off(frame.mass_matrix[world], convert.T @ mass_matrix @ convert) < TOLERANCES[precision]
            assert off(frame.bias_force[world], bias) < TOLERANCES[precision]
            assert off(convert @ frame.joint_qdd[world] + drift, data.qacc) < TOLERANCES[precision]
