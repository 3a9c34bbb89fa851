"""Keyframes, mocap bodies and activations of MuJoCo models through the daemon."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from live_model import Live, live

import tightloop as tl

XML = """
<mujoco>
  <worldbody>
    <body name="placed" mocap="true" pos="0 0 2"><geom size=".1" contype="0" conaffinity="0"/></body>
    <body name="free" pos="0 0 1"><freejoint/><inertial pos=".1 .02 -.05" mass="1" diaginertia=".02 .03 .04"/></body>
    <body name="arm" pos="1 0 1">
      <joint name="ball" type="ball"/><geom size=".1"/>
      <body name="finger" pos="0 0 .3"><joint name="hinge"/><geom size=".05" pos=".1 0 0"/></body>
    </body>
  </worldbody>
  <equality><weld body1="placed" body2="free"/></equality>
  <actuator>
    <motor joint="hinge"/>
    <general joint="hinge" dyntype="filter" dynprm=".1" gainprm="2"/>
  </actuator>
  <keyframe>
    <key name="home" qpos="0 0 1 1 0 0 0  1 0 0 0  0"/>
    <key name="thrown" qpos=".1 .2 1.5 .5 .5 .5 .5  .6 .8 0 0  .3" qvel="1 2 3 .4 .5 .6  .7 .8 .9  1"
         ctrl=".2 -.3" act=".4" mpos="0 .1 1.9" mquat=".6 0 .8 0"/>
  </keyframe>
</mujoco>
"""


@pytest.fixture(scope="module")
def case():
    with live(XML, worlds=3) as case:
        yield case


@pytest.mark.parametrize("keyframe", ["thrown", "m/thrown", 1])
def test_a_keyframe_is_mujocos(case: Live, keyframe: str | int) -> None:
    frame = case.sim.reset(keyframe=keyframe)
    moved = case.sim.step()
    data = mujoco.MjData(case.model)
    mujoco.mj_resetDataKeyframe(case.model, data, 1)
    mujoco.mj_forward(case.model, data)
    for name in ("qpos", "qvel", "qacc", "act"):
        np.testing.assert_allclose(getattr(frame, name), [getattr(data, name)] * 3, rtol=1e-9, atol=1e-9)
    mujoco.mj_step(case.model, data)
    for name in ("qpos", "qvel", "act"):
        np.testing.assert_allclose(getattr(moved, name), [getattr(data, name)] * 3, rtol=1e-9, atol=1e-9)


def test_a_keyframe_of_some_worlds_leaves_the_others(case: Live) -> None:
    before = case.sim.reset()
    mask = np.array([False, True, False])
    frame = case.sim.reset(keyframe="thrown", mask=mask)
    assert (frame.qpos[~mask] == before.qpos[~mask]).all()
    assert (frame.qpos[mask] != before.qpos[mask]).any()
    np.testing.assert_allclose(frame.act[:, 0], [0, 0.4, 0])


def test_names_are_listed_and_wrong_ones_reported(case: Live) -> None:
    assert case.sim.keyframe_names == ["m/home", "m/thrown"]
    assert case.sim.mocap_names == ["m/placed"]
    assert case.sim.activation_names == ["m/actuator1"]
    for wrong in ("nowhere", 2, -1):
        with pytest.raises(tl.ArgumentError, match="there are: m/home, m/thrown"):
            case.sim.reset(keyframe=wrong)
    with pytest.raises(tl.ArgumentError, match="give a name or a place"):
        case.sim.reset(keyframe=1.5)  # pyright: ignore[reportArgumentType]


def test_a_mocap_body_is_placed_by_a_step_and_by_a_write(case: Live) -> None:
    case.sim.reset()
    data = mujoco.MjData(case.model)
    rng = np.random.default_rng(0)
    for _ in range(5):
        pos, quat = rng.normal([0, 0, 2], 0.2), rng.normal(0, 1, 4)
        frame = case.sim.step(mocap_pos=pos[None], mocap_quat=quat[None])
        data.mocap_pos[:], data.mocap_quat[:] = pos, quat
        mujoco.mj_step(case.model, data)
        np.testing.assert_allclose(frame.qpos, [data.qpos] * 3, rtol=1e-7, atol=1e-9)
    held = case.sim.step().qpos
    mujoco.mj_step(case.model, data)
    np.testing.assert_allclose(held, [data.qpos] * 3, rtol=1e-7, atol=1e-9)
    frame = case.sim.write(mocap_pos=np.zeros((3, 1, 3)))
    data.mocap_pos[:] = 0
    mujoco.mj_forward(case.model, data)
    np.testing.assert_allclose(frame.qacc, [data.qacc] * 3, rtol=1e-7, atol=1e-7)


def test_an_equality_is_switched_by_a_step_and_by_a_write_in_each_world(case: Live) -> None:
    case.sim.reset()
    assert case.sim.equality_names == ["m/equality0"]
    on = np.array([[1.0], [0.0], [1.0]])
    data = [mujoco.MjData(case.model) for _ in on]
    for own, is_on in zip(data, on, strict=True):
        own.eq_active[:] = is_on
        own.qvel[:3] = 0.5
    joint_qd = np.zeros((3, case.model.nv))
    joint_qd[:, :3] = 0.5
    case.sim.write(joint_qd=joint_qd)
    for _ in range(5):
        frame = case.sim.step(eq_active=on)
        for own in data:
            mujoco.mj_step(case.model, own)
        np.testing.assert_allclose(frame.qpos, [own.qpos for own in data], rtol=1e-7, atol=1e-9)
    assert not np.allclose(frame.qpos[0], frame.qpos[1])
    # what was sent holds, and a snapshot has it
    snapshot = case.sim.snapshot()
    held = case.sim.step().qpos
    frame = case.sim.write(eq_active=on[::-1] == 0)  # bool
    for own, is_on in zip(data, on, strict=True):
        mujoco.mj_step(case.model, own)
        own.eq_active[:] = 1 - is_on
        mujoco.mj_forward(case.model, own)
    np.testing.assert_allclose(frame.qacc, [own.qacc for own in data], rtol=1e-6, atol=1e-6)
    case.sim.restore(snapshot)
    assert (case.sim.step().qpos == held).all()
    case.sim.reset()
    start = case.sim.step().qpos
    assert (start == start[0]).all(), "a reset lets it act as the model says"
    for wrong in (0.5, np.nan):
        with pytest.raises(tl.CommandRefused, match="equality0"):
            case.sim.step(eq_active=[[1.0], [wrong], [0.0]])


def test_an_equality_that_is_off_at_the_start_can_be_switched_on() -> None:
    with live(XML.replace('<weld body1="placed"', '<weld active="false" body1="placed"'), worlds=2) as case:
        data = mujoco.MjData(case.model)
        off = case.sim.step()
        on = case.sim.step(eq_active=[1.0])
        for frame, is_on in ((off, 0), (on, 1)):
            data.eq_active[:] = is_on
            mujoco.mj_step(case.model, data)
            np.testing.assert_allclose(frame.qpos, [data.qpos] * 2, rtol=1e-7, atol=1e-9)


def test_wrong_shapes_are_refused(case: Live) -> None:
    for more in ({"mocap_pos": np.zeros((2, 3))}, {"act": np.zeros(2)}, {"mocap_quat": np.full((1, 4), np.nan)}):
        with pytest.raises(tl.CommandRefused):
            case.sim.write(**more)


def test_a_snapshot_holds_activations_and_mocap_bodies(case: Live) -> None:
    case.sim.reset(keyframe="thrown")
    snapshot = case.sim.snapshot()
    after = case.sim.step()
    case.sim.reset()
    case.sim.restore(snapshot)
    again = case.sim.step()
    assert (again.qpos == after.qpos).all() and (again.act == after.act).all()
