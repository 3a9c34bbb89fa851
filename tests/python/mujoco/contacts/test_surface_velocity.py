"""Geoms with ``surfacevel``, as of conveyor belts, beside MuJoCo: forces, motions and what comes of them."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from live_model import Live, live, relative

import tightloop as tl

STEPS = 200
FIELDS = ("cfrc_ext", "sensordata", "contact_count")
#: Belts, a turntable, a mesh that drives itself, a capsule on rough ground, and a box on a belt that a body carries.
XML = """<mujoco><option cone="{cone}" integrator="{integrator}" timestep=".002" {option}/>
<default><geom condim="{condim}" friction=".6 .02 .004"/></default>
<asset>
  <mesh name="wedge" vertex="0 0 0 .3 0 0 0 .2 0 0 0 .2"/>
  <hfield name="hills" nrow="3" ncol="3" size="1 1 .1 .1" elevation="0 0 0 0 .3 0 0 .1 0"/>
</asset>
<worldbody>
  <geom name="belt" type="plane" size="9 9 1" euler="3 2 30" surfacevel=".8 -.3 2 0 0 0"/>
  <geom name="table" type="cylinder" size=".5 .1" pos="0 3 .5" euler="0 3 0" surfacevel="0 0 0 .2 -.1 2"/>
  <geom name="ground" type="hfield" hfield="hills" pos="4 0 .5" euler="0 0 30" surfacevel=".3 .2 0 0 0 .5"/>
  <body name="ball" pos="0 0 .0995"><freejoint/><geom name="ball" size=".1" mass=".4"/></body>
  <body name="log" pos="0 3.2 .655" euler="90 0 20"><freejoint/>
    <geom name="log" type="capsule" size=".06 .1" mass=".5" pos=".01 0 .02" euler="0 30 0"/></body>
  <body name="wedge" pos="-1 0 .06" euler="10 20 30"><freejoint/>
    <geom name="wedge" type="mesh" mesh="wedge" pos=".02 0 -.05" mass=".6" surfacevel=".3 -.4 .1 .5 .3 -.2"/></body>
  <body name="can" pos="4 .1 .72" euler="20 10 0"><freejoint/>
    <geom name="can" type="capsule" size=".08 .06" mass=".3" surfacevel="0 0 0 0 1 .5"/></body>
  <body name="cart" pos="0 -3 .3"><joint type="slide" axis="1 .2 0" damping=".5"/><joint axis="0 1 .1" damping="3"
    stiffness="40"/>
    <geom name="tray" type="box" size=".4 .3 .05" mass="2" surfacevel="-.5 .2 0 0 0 .3"/></body>
  <body name="box" pos=".05 -3 .3995" euler="0 0 15"><freejoint/>
    <geom name="box" type="box" size=".05 .06 .05" mass=".2"/></body>
</worldbody>
<contact><pair geom1="belt" geom2="ball" condim="{condim}" friction=".9 .3 .02 .01 .003"/></contact>
<sensor>
  <contact geom1="belt" geom2="ball" data="found force torque linvel angvel"/>
  <contact body1="box" data="force torque" reduce="netforce"/>
</sensor></mujoco>"""


def model(*, cone: str = "elliptic", condim: int = 3, integrator: str = "Euler", option: str = "") -> mujoco.MjModel:
    parts = {"cone": cone, "condim": condim, "integrator": integrator, "option": option}
    return mujoco.MjModel.from_xml_string(XML.format(**parts))


def compare_forces(case: Live, tolerance: float) -> None:
    """Compare accelerations and forces where the bodies are at first."""
    states = case.states(3, spread=0.0, speed=0.3)
    frame, touched = case.place(states), set()
    for world, data in enumerate(case.data(states)):
        mujoco.mj_forward(case.model, data)
        mujoco.mj_rnePostConstraint(case.model, data)
        touched |= set(data.contact.geom.ravel().tolist())
        assert frame.contact_count[world] == data.ncon
        assert relative(frame.qacc[world], data.qacc) < tolerance
        assert relative(frame.cfrc_ext[world].ravel(), data.cfrc_ext.ravel()) < tolerance
        assert relative(frame.sensordata[world], data.sensordata) < tolerance
    assert touched == set(range(case.model.ngeom))


@pytest.mark.parametrize("condim", [1, 3, 4, 6])
@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
def test_surfaces_drive_what_touches_them_as_in_mujoco(cone, condim):
    with live(model(cone=cone, condim=condim), worlds=3, fields=FIELDS) as case:
        compare_forces(case, 1e-8)
        case.assert_steps_are_mujocos(case.states(3, spread=0.0, speed=0.3), STEPS, 1e-6)


@pytest.mark.parametrize("integrator", ["implicitfast", "implicit", "RK4"])
def test_integrators_take_them(integrator):
    with live(model(integrator=integrator), worlds=2, fields=FIELDS) as case:
        compare_forces(case, 1e-8)
        case.assert_steps_are_mujocos(case.states(3, spread=0.0, speed=0.3), STEPS, 1e-6)


@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
def test_sweeps_of_noslip_take_them(cone):
    with live(model(cone=cone, condim=4, option='noslip_iterations="5"'), worlds=2, fields=FIELDS) as case:
        compare_forces(case, 1e-8)


@pytest.mark.parametrize("condim", [3, 6])
@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
def test_single_precision_is_near(cone, condim):
    robot = mujoco.MjModel.from_xml_string(BELT.format(cone=cone, condim=condim))
    with live(robot, worlds=8, precision="f32") as case:
        states = case.states(3, spread=0.0, speed=0.2)
        frame = case.place(states)
        for world, data in enumerate(case.data(states)):
            mujoco.mj_forward(case.model, data)
            assert relative(frame.qacc[world], data.qacc) < 1e-3


#: A ball on a plane that turns, and another one that drives itself.
BELT = """<mujoco><option cone="{cone}" timestep=".002"/><worldbody>
  <geom type="plane" size="9 9 1" condim="{condim}" friction=".6 .02 .004" surfacevel=".5 -.2 0 .1 0 1"/>
  <body pos="0 .3 .0995"><freejoint/><geom size=".1" mass=".4" condim="{condim}"/></body>
  <body pos="2 .3 .0995"><freejoint/><geom size=".1" mass=".4" condim="{condim}" surfacevel="0 0 0 .4 -2 .3"/></body>
</worldbody></mujoco>"""


def test_a_box_ends_with_the_velocity_of_its_belt():
    xml = """<mujoco><option timestep=".002"/><worldbody>
      <geom name="belt" type="box" size="5 .5 .1" pos="0 0 -.1" surfacevel=".5 0 0 0 0 0"/>
      <body pos="0 0 .0999"><freejoint/><geom type="box" size=".1 .1 .1" mass="1"/></body></worldbody></mujoco>"""
    with live(xml, worlds=2, precision="f32") as case:
        for _ in range(500):
            frame = case.sim.step()
    np.testing.assert_allclose(frame.qvel[:, 0], 0.5, atol=1e-2)


def test_friction_that_varies_drives_with_its_own_limit():
    robot = model(condim=4)
    with live(robot, worlds=3, params=("shape_mu",)) as case:
        kept = robot.geom_friction.copy()
        scales = np.array([0.5, 1.0, 2.0])
        case.sim.params.write(shape_mu=kept[:, 0] * scales[:, None])
        states = case.states(2, spread=0.0, speed=0.3)
        frame = case.place(states)
        for world, data in enumerate(case.data(states)):
            # sliding friction that varies scales the others with it
            robot.geom_friction[:] = kept * scales[world]
            mujoco.mj_forward(robot, data)
            assert relative(frame.qacc[world], data.qacc) < 1e-8
            robot.geom_friction[:] = kept


def test_velocities_that_mujoco_ignores_are_ignored():
    plain = mujoco.MjModel.from_xml_string(XML.format(cone="elliptic", condim=3, integrator="Euler", option=""))
    plain.geom_surfacevel[:] = 0
    moved = model()
    moved.flg_surfacevel = 0
    found = []
    for robot in (plain, moved):
        with tl.launch(tl.Scene.from_mujoco(robot), worlds=1, precision="f64", fields=("qpos",)) as sim:
            found.append(sim.step().qpos.copy())
    np.testing.assert_array_equal(*found)
