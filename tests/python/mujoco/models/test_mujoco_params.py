"""Masses, inertias and laws of actuators that differ between worlds, against a MuJoCo model for each world."""

from __future__ import annotations

import copy
import os
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from live_model import HELD, live, relative
from random_mjcf import ACTUATED, EVERYTHING, random_mjcf

import tightloop as tl

PARAMS = ("body_mass", "body_inertia", "actuator_gain", "actuator_bias")
FIELDS = ("actuator_force", "cfrc_int", "subtree_angmom", "subtree_com", "kinetic_energy", "qfrc_bias")
TREES = int(os.environ.get("TIGHTLOOP_LIVE_TREES", "48")) // 16
# welds of bodies that cannot turn have a torque in MuJoCo, which only `cfrc_int` shows
# that muscles have is fixed, and forces of spatial tendons are not in `cfrc_int`
LOOSE = replace(EVERYTHING, connections=False, mocap=False, muscles=False, spatial=False)
FEATURES = {
    "everything": replace(LOOSE, option=""),
    "implicit": replace(LOOSE, option='integrator="implicitfast"'),
    "actuators by Runge-Kutta": replace(ACTUATED, compensation=True, option='integrator="RK4"'),
}


def separate(model: mujoco.MjModel, worlds: int, seed: int) -> list[mujoco.MjModel]:
    """Models with masses, inertias, gains and biases of their own; what is soft stays as it is."""
    rng, models = np.random.default_rng(seed), []
    for _ in range(worlds):
        own = copy.copy(model)
        own.body_mass[1:] *= rng.uniform(0.5, 2, model.nbody - 1)
        own.body_inertia[1:] *= rng.uniform(0.8, 1.2, (model.nbody - 1, 1))
        own.body_inertia[1:] *= rng.uniform(0.95, 1.05, (model.nbody - 1, 3))
        affine = own.actuator_gaintype == mujoco.mjtGain.mjGAIN_AFFINE
        own.actuator_gainprm[:, 0] *= rng.uniform(0.5, 2, model.nu)
        own.actuator_gainprm[affine, 1:3] += rng.normal(0, 0.3, (affine.sum(), 2))
        biased = own.actuator_biastype == mujoco.mjtBias.mjBIAS_AFFINE
        own.actuator_biasprm[biased, :3] += rng.normal(0, 0.3, (biased.sum(), 3))
        data = mujoco.MjData(own)
        mujoco.mj_setConst(own, data)  # simple bodies have their inertia twice
        for name in ("body_invweight0", "dof_invweight0", "tendon_invweight0"):
            getattr(own, name)[:] = getattr(model, name)
        models.append(own)
    return models


def parameters(model: mujoco.MjModel, models: list[mujoco.MjModel]) -> dict[str, np.ndarray]:
    """The parameters of a simulation that make its worlds these models."""
    tensors = np.zeros((len(models), model.nbody, 6))
    for world, own in enumerate(models):
        for body in range(model.nbody):
            turn = np.zeros(9)
            mujoco.mju_quat2Mat(turn, own.body_iquat[body])
            axes = turn.reshape(3, 3)
            tensor = axes @ np.diag(own.body_inertia[body]) @ axes.T
            tensors[world, body] = tensor[(0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)]
    read = np.ones((model.nu, 3))
    read[model.actuator_gaintype == mujoco.mjtGain.mjGAIN_FIXED, 1:] = 0
    biased = model.actuator_biastype == mujoco.mjtBias.mjBIAS_AFFINE
    return {
        "body_mass": np.array([own.body_mass for own in models]),
        "body_inertia": tensors,
        "actuator_gain": np.array([own.actuator_gainprm[:, :3] * read for own in models]),
        "actuator_bias": np.array([own.actuator_biasprm[:, :3] * biased[:, None] for own in models]),
    }


@pytest.mark.parametrize(
    ("device", "precision", "tolerance"), [("cpu", "f64", 1e-8), ("cpu", "f32", 1e-3), ("gpu", "f32", 1e-3)]
)
@pytest.mark.parametrize("feature", FEATURES)
@pytest.mark.parametrize("seed", range(TREES))
def test_worlds_are_models_of_their_own(feature: str, seed: int, device: str, precision: str, tolerance: float) -> None:
    xml = random_mjcf(seed, 1 + seed % 6, FEATURES[feature])
    with live(xml, worlds=20, precision=precision, device=device, fields=FIELDS, params=PARAMS) as case:
        models = separate(case.model, case.sim.worlds, seed)
        given = {name: values for name, values in parameters(case.model, models).items() if values.size}
        case.sim.params.write(**given)
        states = case.states(seed)
        frame = case.place(states)
        found = {name: np.array(getattr(frame, name), float) for name in ("qacc", *FIELDS)}
        moved = case.sim.step()
        for world, (own, other) in enumerate(zip(models, case.data(states), strict=True)):
            data = mujoco.MjData(own)
            for name in ("qpos", "qvel", *HELD):
                getattr(data, name)[:] = getattr(other, name)
            mujoco.mj_forward(own, data)
            mujoco.mj_rnePostConstraint(own, data)
            mujoco.mj_subtreeVel(own, data)
            mujoco.mj_energyVel(own, data)
            assert relative(found["qacc"][world], data.qacc) < tolerance, "qacc"
            for name in FIELDS:
                expected = data.energy[1] if name == "kinetic_energy" else getattr(data, name)
                values, wanted = np.ravel(found[name][world]), np.ravel(expected)
                assert relative(values, wanted) < 10 * tolerance, name
            mujoco.mj_step(own, data)
            assert relative(moved.qvel[world], data.qvel) < tolerance, "qvel"


def test_masses_in_a_medium_do_not_vary() -> None:
    xml = random_mjcf(0, 3, EVERYTHING)
    with pytest.raises(tl.SceneError, match="body_mass cannot vary: density and viscosity"):
        tl.launch(tl.Scene.from_mujoco(mujoco.MjModel.from_xml_string(xml)), worlds=1, params=("body_mass",))


def test_bodies_without_mass_are_given_one() -> None:
    """A payload beside its frame that is held against gravity, and a static body that is weighed."""
    model = mujoco.MjModel.from_xml_string("""
<mujoco>
  <worldbody>
    <body name="still" pos=".1 .2 1"><geom size=".1" mass="1" contype="0" conaffinity="0"/></body>
    <body pos="0 0 1">
      <joint axis="0 1 0"/><geom type="capsule" size=".05" fromto="0 0 0 .5 0 0" mass="1"/>
      <body name="payload" pos=".5 0 0" gravcomp=".5"><inertial pos=".3 0 -.2" mass="0" diaginertia="0 0 0"/></body>
    </body>
  </worldbody>
  <sensor><e_potential/></sensor>
</mujoco>""")
    with live(model, worlds=2, fields=("sensordata", "subtree_com"), params=("body_mass",)) as case:
        mass = np.array([model.body_mass, model.body_mass])
        mass[1, [1, 3]] = 3.0, 2.0
        case.sim.params.write(body_mass=mass)
        frame = case.sim.write(joint_q=[0.3], joint_qd=[0.2])
        for world in range(2):
            own = copy.copy(model)
            own.body_mass[:] = mass[world]
            mujoco.mj_setConst(own, mujoco.MjData(own))
            data = mujoco.MjData(own)
            data.qpos[:], data.qvel[:] = 0.3, 0.2
            mujoco.mj_forward(own, data)
            np.testing.assert_allclose(frame.qacc[world], data.qacc, rtol=1e-9)
            np.testing.assert_allclose(frame.sensordata[world], data.sensordata, rtol=1e-9)
            np.testing.assert_allclose(frame.subtree_com[world], data.subtree_com, atol=1e-9)
