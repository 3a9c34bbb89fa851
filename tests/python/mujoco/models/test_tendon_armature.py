"""Armature of tendons, fixed and from site to site: mass matrix, bias and motion are MuJoCo's."""

from __future__ import annotations

import mujoco
import pytest
from live_model import live, relative

import tightloop as tl
from tightloop.errors import SceneError

WORLDS = 16
XML = """<mujoco><option integrator="{integrator}" timestep=".002"/>
<default><geom contype="0" conaffinity="0"/><joint damping="{damping}"/></default>
<worldbody>
  <site name="anchor" pos=".3 .2 1.2"/>
  <body name="upper" pos="0 0 1"><joint name="a" axis="0 1 0"/><geom type="capsule" size=".03" fromto="0 0 0 .3 0 0"/>
    <site name="upper" pos=".25 0 .05"/>
    <body name="lower" pos=".3 0 0"><joint name="b" axis="0 1 .3"/><joint name="c" axis="1 0 0"/>
      <geom type="capsule" size=".02" fromto="0 0 0 .2 0 .1"/><site name="lower" pos=".2 0 .1"/></body>
    <body name="side" pos=".1 0 0"><joint name="d" type="slide" axis="0 .2 1"/><geom size=".04"/>
      <site name="side" pos="0 .1 0"/></body>
  </body>
  <body name="swing" pos="-.3 0 1"><joint type="ball"/><geom type="box" size=".1 .05 .03" pos=".1 0 0"/>
    <site name="swing" pos=".2 .02 .04"/></body>
  <body name="loose" pos="0 .5 1.1"><freejoint/><geom type="box" size=".08 .05 .04" pos=".02 .01 0"/>
    <site name="loose" pos=".05 -.02 .06"/></body>
</worldbody>
<tendon>
  <fixed name="sum" armature=".3">
    <joint joint="a" coef=".5"/><joint joint="b" coef="-1.2"/><joint joint="d" coef="2"/></fixed>
  <spatial name="rope" armature=".7" stiffness="5" damping="{damping}">
    <site site="anchor"/><site site="upper"/><site site="lower"/></spatial>
  <spatial name="pulleys" armature="{armature}"><site site="anchor"/><site site="loose"/><pulley divisor="2"/>
    <site site="swing"/><site site="side"/></spatial>
</tendon>
<actuator><motor tendon="rope" ctrlrange="-1 1"/></actuator>
</mujoco>"""


@pytest.mark.parametrize("integrator", ["Euler", "implicit", "implicitfast", "RK4"])
@pytest.mark.parametrize(("armature", "damping"), [(0.0, 0.2), (0.4, 0.2), (0.4, 0.0)])
def test_accelerations_and_steps_are_mujocos(integrator, armature, damping):
    xml = XML.format(integrator=integrator, armature=armature, damping=damping)
    with live(xml, worlds=WORLDS, fields=("qfrc_bias",)) as case:
        states = case.states(3, spread=0.5, speed=2.0)
        frame = case.place(states)
        own = list(case.data(states))
        for world, data in enumerate(own):
            mujoco.mj_forward(case.model, data)
            assert relative(frame.qacc[world], data.qacc) < 1e-9
            assert relative(frame.qfrc_bias[world], data.qfrc_bias) < 1e-9
        for _ in range(200):
            frame = case.sim.step()
            for data in own:
                mujoco.mj_step(case.model, data)
        for world, data in enumerate(own):
            assert relative(frame.qpos[world], data.qpos) < 1e-6


def test_single_precision_is_double_s():
    xml = XML.format(integrator="implicitfast", armature=4.0, damping=0.0)
    found = []
    for precision in ("f32", "f64"):
        with live(xml, worlds=WORLDS, precision=precision) as case:
            frame = case.place(case.states(3, spread=0.5, speed=2.0))
            found.append(frame.qacc.copy())
            for _ in range(50):
                frame = case.sim.step()
            found.append(frame.qpos.copy())
    assert relative(found[0], found[2]) < 1e-3
    assert relative(found[1], found[3]) < 1e-3


def test_armature_of_a_tendon_that_bends_is_refused():
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><geom name="pole" type="cylinder" size=".1 .2"/><site name="a" pos="-1 .2 0"/>
        <body><joint axis="0 0 1"/><geom size=".1"/><site name="b" pos="1 0 0"/></body></worldbody>
        <tendon><spatial name="rope" stiffness="1">
          <site site="a"/><geom geom="pole"/><site site="b"/></spatial></tendon></mujoco>"""
    )
    model.tendon_armature[:] = 0.5
    with pytest.raises(SceneError, match="tendon `rope`: no support for armature where it bends"):
        tl.Scene.from_mujoco(model)
