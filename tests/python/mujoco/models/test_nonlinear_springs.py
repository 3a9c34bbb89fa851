"""Nonlinear springs and dampers of joints and tendons: forces, energies and motion are MuJoCo's."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from live_model import live, relative

WORLDS = 16
INTEGRATORS = ("Euler", "implicit", "implicitfast", "RK4")
XML = """<mujoco><compiler angle="radian"/><option integrator="{integrator}" timestep=".001">
  <flag energy="enable" {flags}/></option>
<default><geom contype="0" conaffinity="0" density="5000"/><joint armature=".02"/></default>
<worldbody>
  <site name="anchor" pos=".3 .2 1.2"/>
  <body name="upper" pos="0 0 1">
    <joint name="a" axis="0 1 0" stiffness="3 2 5" springref=".2" damping=".1 .05 .02"/>
    <geom type="capsule" size=".03" fromto="0 0 0 .3 0 0"/><site name="upper" pos=".25 0 .05"/>
    <body name="lower" pos=".3 0 0">
      <joint name="b" axis="0 1 .3" stiffness="0 -1 4" damping="0 .03 0"/>
      <joint name="c" axis="1 0 0" stiffness="2" damping=".05"/>
      <geom type="capsule" size=".02" fromto="0 0 0 .2 0 .1"/><site name="lower" pos=".2 0 .1"/></body>
    <body name="side" pos=".1 0 0">
      <joint name="d" type="slide" axis="0 .2 1" stiffness="40 20 60" damping=".3 0 .2"/><geom size=".04"/>
      <site name="side" pos="0 .1 0"/></body>
  </body>
  <body name="swing" pos="-.3 0 1"><joint name="ball" type="ball" stiffness="2 1 .5" damping=".1 .02 .01"/>
    <geom type="box" size=".1 .05 .03" pos=".1 0 0"/><site name="swing" pos=".2 .02 .04"/></body>
  <body name="loose" pos="0 .5 1.1"><joint name="free" type="free" stiffness="8 3 2" damping=".2 .1 .05"/>
    <geom type="box" size=".08 .05 .04" pos=".02 .01 0"/><site name="loose" pos=".05 -.02 .06"/></body>
</worldbody>
<tendon>
  <fixed name="sum" stiffness="3 1 2" damping=".2 .1 .05" springlength="-.1 .2">
    <joint joint="a" coef=".5"/><joint joint="b" coef="-1.2"/><joint joint="d" coef="2"/></fixed>
  <spatial name="rope" stiffness="5 4 9" damping="0 .2 .1" springlength=".4 .5">
    <site site="anchor"/><site site="upper"/><site site="lower"/></spatial>
  <spatial name="long" stiffness="0 2 0" damping=".1 0 .1">
    <site site="swing"/><site site="loose"/></spatial>
</tendon>
</mujoco>"""


def springs(integrator: str, flags: str = "") -> str:
    return XML.format(integrator=integrator, flags=flags)


@pytest.mark.parametrize("flags", ["", 'spring="disable"', 'damper="disable"', 'eulerdamp="disable"'])
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_forces_energies_and_steps_are_mujocos(integrator, flags):
    with live(springs(integrator, flags), worlds=WORLDS, fields=("qfrc_passive", "potential_energy")) as case:
        states = case.states(3, spread=0.4, speed=1.0)
        frame = case.place(states)
        worlds = list(case.data(states))
        for world, data in enumerate(worlds):
            mujoco.mj_forward(case.model, data)
            assert relative(frame.qfrc_passive[world], data.qfrc_passive) < 1e-8
            assert relative(frame.qacc[world], data.qacc) < 1e-8
            np.testing.assert_allclose(frame.potential_energy[world], data.energy[0], rtol=1e-9, atol=1e-9)
        # the first step has the derivatives of dampers in it, and 199 more let errors grow
        for steps, tolerance in ((1, 1e-8), (199, 1e-6)):
            for _ in range(steps):
                frame = case.sim.step()
                for data in worlds:
                    mujoco.mj_step(case.model, data)
            for world, data in enumerate(worlds):
                assert relative(frame.qpos[world], data.qpos) < tolerance
                assert relative(frame.qvel[world], data.qvel) < tolerance


@pytest.mark.parametrize("part", ["jnt_stiffnesspoly", "dof_dampingpoly", "tendon_stiffnesspoly", "tendon_dampingpoly"])
def test_each_polynomial_acts_where_nothing_is_linear(part):
    model = mujoco.MjModel.from_xml_string(springs("implicitfast"))
    for linear in ("jnt_stiffness", "dof_damping", "tendon_stiffness", "tendon_damping"):
        getattr(model, linear)[:] = 0.0
        if (polynomial := f"{linear}poly") != part:
            getattr(model, polynomial)[:] = 0.0
    with live(model, worlds=4) as case:
        states = case.states(5, spread=0.4, speed=1.0)
        case.place(states)
        frame = case.sim.step()
        for world, data in enumerate(case.data(states)):
            mujoco.mj_step(model, data)
            assert relative(frame.qvel[world], data.qvel) < 1e-8


def test_linear_damping_per_world_adds_to_the_polynomial():
    with live(springs("Euler"), worlds=4, params=("joint_damping",)) as case:
        damping = np.tile(case.model.dof_damping, (4, 1)) * np.linspace(0.5, 3.0, 4)[:, None]
        case.sim.params.joint_damping = damping
        states = case.states(7, spread=0.4, speed=1.0)
        case.place(states)
        for _ in range(20):
            frame = case.sim.step()
        for world, data in enumerate(case.data(states)):
            case.model.dof_damping[:] = damping[world]
            for _ in range(20):
                mujoco.mj_step(case.model, data)
            assert relative(frame.qpos[world], data.qpos) < 1e-8


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_single_precision_is_double_s(integrator):
    runs = []
    for precision in ("f32", "f64"):
        with live(springs(integrator), worlds=WORLDS, precision=precision) as case:
            frame = case.place(case.states(3, spread=0.4, speed=1.0))
            runs.append([frame.qacc.copy()])
            for _ in range(50):
                frame = case.sim.step()
            runs[-1].append(frame.qpos.copy())
    for single, double in zip(*runs, strict=True):
        assert relative(single, double) < 1e-3


def test_a_world_alone_moves_as_among_others():
    with live(springs("implicitfast"), worlds=5, precision="f32") as case:
        frame = case.place(case.states(3, spread=0.4, speed=1.0))
        start = frame.joint_q.copy(), frame.joint_qd.copy()
        for _ in range(50):
            frame = case.sim.step()
        among = frame.qpos[4].copy()
    with live(springs("implicitfast"), worlds=1, precision="f32") as case:
        case.sim.write(joint_q=start[0][4:], joint_qd=start[1][4:])
        for _ in range(50):
            frame = case.sim.step()
        np.testing.assert_array_equal(frame.qpos[0], among)
