"""Damping and armature of actuators, which add to their joint or tendon: forces and motion are MuJoCo's."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from live_model import live, relative

import tightloop as tl
from tightloop.mujoco import Batch
from tightloop.scene.options import Solver
from tightloop.tasks.legged_models import mjcf

WORLDS = 8
FIELDS = ("qfrc_passive", "qfrc_actuator", "actuator_force")
XML = """<mujoco><option integrator="{integrator}" timestep=".001"><flag {flags}/></option>
<default><geom contype="0" conaffinity="0" density="3000"/><joint armature=".01"/></default>
<worldbody>
  <site name="anchor" pos=".9 .2 1.2"/>
  <body name="upper" pos="0 0 1">
    <joint name="a" axis="0 1 0" damping=".1 .05 .02"/><geom type="capsule" size=".03" fromto="0 0 0 .3 0 0"/>
    <body name="lower" pos=".3 0 0">
      <joint name="b" type="slide" axis="1 0 .3"/><geom size=".05"/><site name="tip" pos=".1 0 .05"/></body></body>
  <body name="swing" pos="-.3 0 1"><joint name="ball" type="ball" damping=".02"/>
    <geom type="box" size=".1 .05 .03" pos=".1 0 0"/></body>
  <body name="loose" pos="0 .5 1.1"><joint name="free" type="free"/>
    <geom type="box" size=".08 .05 .04" pos=".02 .01 0"/><site name="loose" pos=".05 -.02 .06"/></body>
</worldbody>
<tendon>
  <fixed name="sum" damping=".2 .1 .05"><joint joint="a" coef=".5"/><joint joint="b" coef="-1.2"/></fixed>
  <spatial name="rope" armature=".02"><site site="anchor"/><site site="tip"/></spatial>
  <spatial name="line"><site site="anchor"/><site site="loose"/></spatial>
</tendon>
<actuator>
  <position joint="a" gear="3" kp="2" kv=".1" damping=".05 .02 .01" armature=".004"/>
  <motor joint="a" gear="-2" damping="0 .03 .02" armature=".01"/>
  <motor name="slide" joint="b" gear=".5" damping=".4" group="2"/>
  <motor jointinparent="ball" gear="1.5 2 1" damping=".03 .01 .02" armature=".006"/>
  <motor joint="free" gear=".8 .2 1 0 0 .5" damping=".3 .1 .02" armature=".05"/>
  <motor tendon="sum" gear="2" damping=".1 .03 0" armature=".02"/>
  <general tendon="rope" gear="1.5" gainprm="2" biastype="affine" biasprm="0 0 -.2" damping=".2 0 .1" armature=".05"/>
  <motor tendon="line" gear="2" damping="0 .2 0"/>
</actuator></mujoco>"""


def model(integrator: str = "implicitfast", flags: str = "", off: int = 0) -> mujoco.MjModel:
    robot = mujoco.MjModel.from_xml_string(XML.format(integrator=integrator, flags=flags))
    robot.opt.disableactuator = off
    return robot


@pytest.mark.parametrize(
    ("flags", "off"),
    [("", 0), ('damper="disable"', 0), ('actuation="disable"', 0), ('eulerdamp="disable"', 0), ("", 1 << 2)],
)
@pytest.mark.parametrize("integrator", ["Euler", "implicitfast", "implicit", "RK4"])
def test_forces_and_steps_are_mujocos(integrator, flags, off):
    with live(model(integrator, flags, off), worlds=WORLDS, fields=FIELDS) as case:
        states = case.states(3, spread=0.3, speed=1.0)
        frame = case.place(states)
        worlds = list(case.data(states))
        for world, data in enumerate(worlds):
            mujoco.mj_forward(case.model, data)
            for name in (*FIELDS, "qacc"):
                assert relative(getattr(frame, name)[world], getattr(data, name)) < 1e-8, name
        # the first step has the derivatives of dampers in it, and 199 more let errors grow
        for steps, tolerance in ((1, 1e-8), (199, 1e-6)):
            for _ in range(steps):
                frame = case.sim.step()
                for data in worlds:
                    mujoco.mj_step(case.model, data)
            for world, data in enumerate(worlds):
                assert relative(frame.qpos[world], data.qpos) < tolerance
                assert relative(frame.qvel[world], data.qvel) < tolerance


def test_numbers_that_the_compiler_did_not_see_do_not_act():
    robot = mujoco.MjModel.from_xml_string(
        XML.format(integrator="Euler", flags="").replace(' damping=".3 .1 .02" armature=".05"', "")
    )
    assert robot.jnt_actuatorid.tolist() == [-2, 2, 3, -1]
    # of joint `a` and of the free one
    robot.actuator_damping[[0, 4]] = 0.3
    with live(robot, worlds=4, fields=FIELDS) as case:
        states = case.states(4, spread=0.3, speed=1.0)
        frame = case.place(states)
        for world, data in enumerate(case.data(states)):
            mujoco.mj_forward(case.model, data)
            assert relative(frame.qfrc_passive[world], data.qfrc_passive) < 1e-8


def test_single_precision_is_near():
    with live(model(), worlds=WORLDS, precision="f32", fields=FIELDS) as case:
        states = case.states(5, spread=0.3, speed=1.0)
        frame = case.place(states)
        for world, data in enumerate(case.data(states)):
            mujoco.mj_forward(case.model, data)
            assert relative(frame.qfrc_passive[world], data.qfrc_passive) < 1e-4
            assert relative(frame.qacc[world], data.qacc) < 2e-3


def test_parameters_of_joints_have_the_share_of_actuators():
    robot = model()
    with live(robot, worlds=1, params=("joint_armature", "joint_damping")) as case:
        # the hinge: 9 · 0.004 + 4 · 0.01, and 9 · 0.05; the slide: 0.25 · 0.4
        np.testing.assert_allclose(case.sim.params.joint_armature[0, :2], [0.086, 0.01], rtol=1e-12)
        np.testing.assert_allclose(case.sim.params.joint_damping[0, :2], [0.55, 0.1], rtol=1e-12)


@pytest.mark.parametrize("field", ["dof_armature", "dof_damping"])
def test_expanded_fields_of_dofs_leave_the_share_of_actuators(field):
    robot = model()
    data = [mujoco.MjData(robot) for _ in range(3)]
    with Batch(robot, 3, precision="f64") as batch:
        values, qpos, qvel = batch.expand(field), batch.bind("qpos"), batch.bind("qvel")
        values[:, :2] *= np.array([0.5, 1.0, 3.0])[:, None]
        values[:, 1] += 0.02
        qvel[:] = 0.7
        batch.step(nstep=20)
        before = getattr(robot, field).copy()
        for sim, each in enumerate(data):
            getattr(robot, field)[:] = values[sim]
            each.qvel[:] = 0.7
            mujoco.mj_step(robot, each, nstep=20)
            assert relative(qpos[sim], each.qpos) < 1e-8
            getattr(robot, field)[:] = before


def test_an_actuator_that_is_left_out_damps_nothing():
    robot = model()
    scene = tl.Scene.from_mujoco(robot, without=("slide",))
    robot.actuator_damping[robot.actuator("slide").id] = 0.0
    data = mujoco.MjData(robot)
    data.qvel[:2] = 0.5
    mujoco.mj_forward(robot, data)
    with tl.launch(scene, worlds=1, precision="f64", fields=("qfrc_passive",)) as sim:
        frame = sim.write(joint_qd=data.qvel[None])
        np.testing.assert_allclose(frame.qfrc_passive[0], data.qfrc_passive, rtol=1e-9, atol=1e-9)


def test_robots_keep_what_their_actuators_add_when_these_go():
    xml = """<mujoco><worldbody><body name="base" pos="0 0 1"><freejoint/><geom size=".1"/>
      <body name="leg"><joint name="knee" axis="0 1 0" damping=".1" armature=".01"/>
        <geom type="capsule" size=".02" fromto="0 0 0 0 0 -.3"/></body></body></worldbody>
      <actuator><position joint="knee" gear="2" kp="5" damping=".3" armature=".02"/></actuator></mujoco>"""
    for robot in (mujoco.MjSpec.from_string(xml), mujoco.MjModel.from_xml_string(xml)):
        spec, source = mjcf.prepare(robot, "robot", 0.002, Solver())
        compiled = mjcf.compile_spec(spec, "robot")
        np.testing.assert_allclose([compiled.dof_armature[6], compiled.dof_damping[6]], [0.09, 1.3])
        (hinge,) = source.hinges
        np.testing.assert_allclose([hinge.armature, hinge.damping], [0.09, 1.3])
