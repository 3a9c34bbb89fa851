"""Fields of joints, actuators, geoms and pairs that differ between simulations, against a MuJoCo model of each."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from batch_reference import Lockstep, N, difference, separate

from tightloop.mujoco import Batch

XML = """
<mujoco>
  <compiler autolimits="true"/>
  <option timestep="0.004" cone="{cone}" integrator="{integrator}" tolerance="0" iterations="60" ls_iterations="60"/>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 .1" friction=".7 .02 .003" condim="4" solref=".03 .9"/>
    <body name="soft" pos="0 0 .095">
      <freejoint/>
      <geom name="low" type="sphere" size=".1" mass="1" condim="4" solmix="3" solimp=".8 .9 .01 .4 2"/>
      <geom name="weight" type="sphere" size=".02" pos=".03 .02 0" mass=".2" contype="0" conaffinity="0"/>
    </body>
    <body name="rules" pos="1 0 .095">
      <freejoint/>
      <geom name="high" type="sphere" size=".1" mass="2" priority="1" solref="-300 -20" solimp=".9 .95 .002 .5 3"/>
    </body>
    <body name="paired" pos="2 0 .095">
      <freejoint/>
      <geom name="own" type="capsule" size=".1 .1" euler="90 0 0" mass="1" contype="0" conaffinity="0"/>
    </body>
    <body name="arm" pos="0 2 1" gravcomp=".5">
      <joint name="a" axis="0 1 0" range="-20 20" ref="10" margin=".02"/>
      <geom type="box" size=".05 .03 .1" mass=".5" pos=".01 0 -.1" contype="0" conaffinity="0"/>
      <body name="hand" pos="0 0 -.3" gravcomp=".2">
        <joint name="b" axis="1 0 0" range="-10 10" damping=".02" margin=".3"/>
        <geom type="box" size=".05 .03 .1" mass=".5" pos=".01 0 -.1" contype="0" conaffinity="0"/>
        <body name="slider" pos="0 0 -.2">
          <joint name="c" type="slide" axis="0 0 1" ref=".02" stiffness="50" damping="1"/>
          <geom type="sphere" size=".04" mass=".3" contype="0" conaffinity="0"/>
          <site name="tip" pos=".02 .01 0"/>
        </body>
      </body>
      <body name="follower" pos=".3 0 0">
        <joint name="d" axis="0 1 0" ref="5" damping=".1"/>
        <geom type="box" size=".05 .03 .1" mass=".5" pos=".01 0 -.1" contype="0" conaffinity="0"/>
      </body>
    </body>
  </worldbody>
  <contact>
    <pair name="rub" geom1="own" geom2="floor" condim="6" friction=".5 .5 .02 .002 .002"/>
  </contact>
  <equality>
    <joint joint1="d" joint2="b" polycoef=".1 1.5 .3 0 0"/>
  </equality>
  <sensor>
    <accelerometer site="tip"/>
    <framequat objtype="xbody" objname="slider"/>
    <jointlimitpos joint="a"/>
    <jointlimitfrc joint="b"/>
    <force site="tip"/>
  </sensor>
  <actuator>
    <position name="pa" joint="a" kp="40" kv="1" forcerange="-3 3"/>
    <position name="pb" joint="b" kp="20" forcerange="-2 1"/>
    <motor name="mc" joint="c"/>
  </actuator>
</mujoco>
"""


def model_of(cone: str = "pyramidal", integrator: str = "implicitfast") -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(XML.format(cone=cone, integrator=integrator))


def changed(model: mujoco.MjModel, field: str, rng: np.random.Generator) -> np.ndarray:
    """Values of a field that other models may have."""
    value = np.array(getattr(model, field))
    by = rng.uniform
    if field == "qpos0":
        axes = np.isin(model.jnt_type, (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE))
        value[model.jnt_qposadr[axes]] += by(-0.1, 0.1, axes.sum())
    elif field == "jnt_range":
        value *= by(0.3, 1.2, value.shape)
    elif field == "geom_solref":
        value *= by(0.6, 2.0, value.shape)
    elif field == "geom_solimp":
        value[:, :2] = np.sort(by(0.6, 0.99, value[:, :2].shape), axis=1)
        value[:, 2] *= by(0.3, 3.0, len(value))
        value[:, 3] = by(0.2, 0.8, len(value))
    elif field == "pair_friction":
        value *= by(0.3, 3.0, value.shape)
        value[:, 1], value[:, 4] = value[:, 0], value[:, 3]
    else:
        value *= by(0.3, 1.5, value.shape)
    return value


def vary(batch: Batch, models: list[mujoco.MjModel], field: str, rng: np.random.Generator) -> None:
    """Give a field other values in each simulation, and its model the same."""
    values = batch.expand(field)
    for sim, own in enumerate(models):
        values[sim] = changed(batch.model, field, rng)
        getattr(own, field)[:] = values[sim]


def start(batch: Batch, lockstep: Lockstep) -> None:
    """Let the bodies slide, spin and roll, and the arm swing into its limits."""
    lockstep.write("qpos", np.tile(batch.model.qpos0, (N, 1)))
    velocities = np.zeros((N, batch.model.nv))
    for body in range(3):
        velocities[:, 6 * body : 6 * body + 6] = (0.6, 0.2, -0.2, 1.0, -3.0, 4.0)
    velocities[:, 18:] = (2.0, -3.0, 0.3, -2.0)
    lockstep.write("qvel", velocities)
    lockstep.write("ctrl", np.tile([1.0, -1.0, 0.5], (N, 1)))


FIELDS = (
    *("qpos0", "jnt_range", "body_gravcomp", "geom_solref", "geom_solimp", "pair_friction"),
    "actuator_forcerange",
)


@pytest.mark.parametrize("field", FIELDS)
@pytest.mark.parametrize("integrator", ["implicit", "implicitfast", "Euler", "RK4"])
def test_a_field_acts_as_in_a_model_of_its_own(field: str, integrator: str) -> None:
    model = model_of("elliptic" if integrator == "Euler" else "pyramidal", integrator)
    models = separate(model)
    with Batch(model, N, 1, precision="f64") as batch:
        vary(batch, models, field, np.random.default_rng(FIELDS.index(field)))
        lockstep = Lockstep(batch, models)
        start(batch, lockstep)
        lockstep.step(nstep=30)
        lockstep.assert_equal(("qpos", "qvel"), 1e-7)
        assert np.ptp(batch.bind("qvel"), axis=0).max() > 1e-4
        arrays = {name: batch.bind(name) for name in ("xquat", "xpos", "sensordata", "qacc")}
        batch.forward()
        for own, data in zip(models, lockstep.data, strict=True):
            mujoco.mj_forward(own, data)
        for name, array in arrays.items():
            error = difference(array, [getattr(data, name) for data in lockstep.data])
            assert error < 1e-5, f"{name} differs by {error:.1e}"


@pytest.mark.parametrize("device", ["cpu", "gpu"])
def test_all_fields_act_together_in_single_precision(device: str) -> None:
    model = model_of()
    models = separate(model)
    with Batch(model, N, 1, precision="f32", device=device) as batch:
        rng = np.random.default_rng(5)
        for field in FIELDS:
            vary(batch, models, field, rng)
        lockstep = Lockstep(batch, models)
        start(batch, lockstep)
        lockstep.step(nstep=10)
        # as many roundings as the model itself has without fields of its own
        lockstep.assert_equal(("qpos",), 2e-5)


def test_a_range_within_its_margins_acts_on_both_sides() -> None:
    model = model_of()
    models = separate(model)
    with Batch(model, N, 1, precision="f64") as batch:
        values = batch.expand("jnt_range")
        for sim, own in enumerate(models):
            # joint a, from half its margin to twice
            values[sim, 3] = np.array([-0.3, 0.7]) * 0.02 * (sim + 1)
            own.jnt_range[:] = values[sim]
        lockstep = Lockstep(batch, models)
        start(batch, lockstep)
        lockstep.step(nstep=40)
        lockstep.assert_equal(("qpos", "qvel"), 1e-7)


def test_jacobians_and_rays_see_the_reference_of_each_simulation() -> None:
    model = model_of()
    models = separate(model)
    with Batch(model, N, 1) as batch:
        batch.expand("qpos0")[:, 21:23] += np.linspace(-0.3, 0.3, N)[:, None]
        body = np.full(N, model.body("slider").id, np.int32)
        point, jacobian = np.zeros((N, 3)), np.empty((N, 3, model.nv))
        batch.jac(jacobian, None, point, body)
        for sim, own in enumerate(models):
            own.qpos0[:] = batch.expand("qpos0")[sim]
            data = mujoco.MjData(own)
            data.qpos[:] = model.qpos0
            mujoco.mj_kinematics(own, data)
            mujoco.mj_comPos(own, data)
            expected = np.empty((3, model.nv))
            mujoco.mj_jac(own, data, expected, None, point[sim], int(body[sim]))
            np.testing.assert_allclose(jacobian[sim], expected, atol=1e-9)
        assert np.ptp(jacobian, axis=0).max() > 0.01


def test_a_reset_puts_each_simulation_at_its_own_reference() -> None:
    model = model_of()
    with Batch(model, N, 1) as batch:
        qpos = batch.bind("qpos")
        batch.expand("qpos0")[:, -1] = np.linspace(-0.1, 0.1, N)
        batch.reset([1, 4])
        np.testing.assert_allclose(qpos[[1, 4], -1], np.linspace(-0.1, 0.1, N)[[1, 4]], atol=1e-7)
        np.testing.assert_allclose(qpos[0, -1], model.qpos0[-1])


def test_compensation_of_a_model_without_any_starts_with_set_const() -> None:
    model = mujoco.MjModel.from_xml_string(XML.format(cone="pyramidal", integrator="Euler").replace("gravcomp", "user"))
    models = separate(model)
    with Batch(model, N, 1, precision="f64") as batch:
        batch.expand("body_gravcomp")[:] = 1.0
        lockstep = Lockstep(batch, models)
        lockstep.step(nstep=5)
        lockstep.assert_equal(("qpos", "qvel"), 1e-9)
        some = np.arange(0, N, 2)
        batch.set_const(some)
        for sim in some:
            models[sim].body_gravcomp[:] = 1.0
            mujoco.mj_setConst(models[sim], mujoco.MjData(models[sim]))
        lockstep.step(nstep=5)
        lockstep.assert_equal(("qpos", "qvel"), 1e-9)
