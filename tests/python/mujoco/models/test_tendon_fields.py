"""Fields ``ten_length`` and ``ten_velocity`` beside MuJoCo's data: fixed, spatial and idle tendons."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from live_model import live

import tightloop as tl

FIELDS = ("ten_length", "ten_velocity")
WORLDS = 16
XML = """<mujoco><option timestep=".002"/><default><geom contype="0" conaffinity="0"/></default>
<worldbody>
  <site name="anchor" pos=".3 .2 1.2"/>
  <body name="upper" pos="0 0 1"><joint name="a" axis="0 1 0"/><geom type="capsule" size=".03" fromto="0 0 0 .3 0 0"/>
    <site name="upper" pos=".25 0 .05"/><site name="side" pos=".15 .1 0"/>
    <geom name="knuckle" type="cylinder" size=".04 .1" pos=".28 0 0" euler="90 0 0" mass="0"/>
    <body name="lower" pos=".3 0 0"><joint name="b" axis="0 1 .3"/><joint name="c" type="slide" axis="1 0 0"/>
      <geom type="capsule" size=".02" fromto="0 0 0 .2 0 .1"/><site name="lower" pos=".2 0 .1"/></body></body>
  <body name="loose" pos="0 .5 1.1"><freejoint/><geom type="box" size=".08 .05 .04" pos=".02 .01 0"/>
    <site name="loose" pos=".05 -.02 .06"/></body>
</worldbody>
<tendon>
  <spatial name="idle"><site site="anchor"/><site site="upper"/><site site="lower"/></spatial>
  <fixed name="sum" stiffness="3"><joint joint="a" coef=".5"/><joint joint="b" coef="-1.2"/></fixed>
  <spatial name="rope" stiffness="5" damping=".1"><site site="anchor"/><site site="loose"/></spatial>
  <fixed name="still"><joint joint="c" coef="2"/></fixed>
  <spatial name="bent"><site site="upper"/><geom geom="knuckle" sidesite="side"/><site site="lower"/>
    <pulley divisor="2"/><site site="lower"/><site site="loose"/></spatial>
  <spatial name="driven"><site site="anchor"/><site site="lower"/></spatial>
</tendon>
<actuator><motor tendon="driven" ctrlrange="-1 1"/></actuator></mujoco>"""
IDLE = XML.replace(' stiffness="5" damping=".1"', "").replace(' stiffness="3"', "").split("<actuator>")[0] + "</mujoco>"


@pytest.mark.parametrize(("precision", "tolerance"), [("f64", 1e-9), ("f32", 1e-4)])
@pytest.mark.parametrize("xml", [XML, IDLE], ids=["some act", "all idle"])
def test_lengths_and_rates_are_mujocos(xml, precision, tolerance):
    with live(xml, worlds=WORLDS, fields=FIELDS, precision=precision) as case:
        states = case.states(3, spread=0.4, speed=1.0)
        frame = case.place(states)
        for world, data in enumerate(case.data(states)):
            mujoco.mj_forward(case.model, data)
            for name in FIELDS:
                found, expected = getattr(frame, name)[world], getattr(data, name)
                assert found.shape == expected.shape
                assert np.abs(found - expected).max() < tolerance * max(1.0, np.abs(expected).max()), name


def test_fields_follow_a_motion_and_change_nothing():
    """A run with the fields is that of a run without, and its lengths are those of the frame's state."""
    model = mujoco.MjModel.from_xml_string(XML)
    runs = []
    for fields in ((), FIELDS):
        with live(model, worlds=2, fields=fields) as case:
            for _ in range(50):
                frame = case.sim.step(ctrl=[0.5])
            runs.append(frame.qpos.copy())
            if fields:
                data = mujoco.MjData(model)
                data.qpos[:], data.qvel[:] = frame.qpos[0], frame.qvel[0]
                mujoco.mj_forward(model, data)
                np.testing.assert_allclose(frame.ten_length[0], data.ten_length, rtol=0, atol=1e-9)
                np.testing.assert_allclose(frame.ten_velocity[0], data.ten_velocity, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(*runs)


def test_models_follow_each_other_and_name_their_tendons():
    first, second = (mujoco.MjModel.from_xml_string(xml) for xml in (XML, IDLE))
    scene = tl.Scene.from_mujoco(first, name="first")
    scene.add_mujoco(second, name="second", pos=(1, 2, 3))
    names = ["idle", "sum", "rope", "still", "bent", "driven"]
    assert [scene.models[name].tendon_names for name in ("first", "second")] == [names, names]
    with tl.launch(scene, worlds=2, fields=FIELDS, precision="f64") as sim:
        frame = sim.forward()
        data = mujoco.MjData(first)
        mujoco.mj_forward(first, data)
        assert frame.ten_length.shape == (2, 12)
        np.testing.assert_allclose(frame.ten_length[0], np.tile(data.ten_length, 2), rtol=0, atol=1e-12)


def test_scenes_without_tendons_have_none():
    scene = tl.Scene(dt=0.01)
    scene.add_sphere(radius=0.1, body=scene.add_body(name="ball", pos=(0, 0, 3), mass=1.0))
    with tl.launch(scene, worlds=3, fields=FIELDS) as sim:
        assert sim.step().ten_length.shape == (3, 0)
