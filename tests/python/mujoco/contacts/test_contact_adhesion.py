"""Geoms and pairs with ``adhesion``, beside MuJoCo: forces, motions, what breaks, and what is refused."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from live_model import Live, live, relative

import tightloop as tl
from tightloop.errors import SceneError

STEPS = 200
FIELDS = ("cfrc_ext", "sensordata", "contact_count", "qfrc_passive", "qfrc_constraint", "smooth_force")
#: Bodies under a ceiling, on a wall, in each other's gap and on a belt; one of two decides by its priority.
XML = """<mujoco><option cone="{cone}" integrator="{integrator}" timestep=".002" impratio="{impratio}" {option}/>
<default><geom condim="{condim}" friction=".5 .02 .004"/></default>
<worldbody>
  <geom name="floor" type="plane" size="9 9 1" euler="0 0 10" adhesion=".5" surfacevel=".2 .1 0 0 0 0"/>
  <geom name="ceiling" type="box" size="1 1 .1" pos="-3 0 1.1" adhesion="9" gap=".01"/>
  <geom name="wall" type="box" size=".1 1 1" pos="3 0 1" euler="0 6 0" adhesion="20"/>
  <body name="ball" pos="0 0 .0995"><freejoint/><geom name="ball" size=".1" mass=".4" adhesion="1.5" margin=".002"/>
    <site name="skin" size=".15"/></body>
  <body name="top" pos="0 .02 .2985"><freejoint/>
    <geom name="top" size=".1" mass=".3" adhesion="2" solref=".03 .8"/></body>
  <body name="hung" pos="-3 .1 .9002" euler="0 0 15"><freejoint/>
    <geom name="hung" type="box" size=".1 .08 .1" mass=".6" gap=".005"/></body>
  <body name="slab" pos="2.80159 .02 1.02085" euler="0 6 0"><freejoint/>
    <geom name="slab" type="box" size=".1 .1 .12" mass="1" adhesion="5" priority="0"/></body>
  <body name="rod" pos="1 1 .0795" euler="90 20 0"><freejoint/>
    <geom name="rod" type="capsule" size=".08 .1" mass=".5" adhesion="3" priority="1"/></body>
  <body name="near" pos="0 -2 .0995"><freejoint/><geom name="near" size=".1" mass="1"/></body>
  <body name="magnet" pos=".04 -2 .325"><freejoint/>
    <geom name="magnet" size=".1" mass=".2" adhesion="1" gap=".1"/></body>
  <body name="arm" pos="0 3 .2"><joint name="swing" axis="0 1 0" damping=".1" stiffness="1"/>
    <geom name="arm" type="capsule" size=".03" fromto="0 0 0 .4 0 -.1705" mass=".3" adhesion="1"/></body>
</worldbody>
<contact>
  <pair geom1="floor" geom2="near" condim="{condim}" adhesion="4" friction=".9 .3 .02 .01 .003"/>
</contact>
<actuator><motor joint="swing"/><adhesion body="rod" ctrlrange="0 1" gain="2"/></actuator>
<sensor>
  <touch site="skin"/>
  <contact geom1="floor" geom2="ball" data="found force torque dist"/>
  <contact body1="hung" data="force torque" reduce="netforce"/>
  <contact geom1="near" geom2="magnet" data="found force" reduce="maxforce"/>
</sensor></mujoco>"""


def model(
    *, cone: str = "elliptic", condim: int = 3, integrator: str = "Euler", impratio: float = 1.0, option: str = ""
) -> mujoco.MjModel:
    parts = {"cone": cone, "condim": condim, "integrator": integrator, "impratio": impratio, "option": option}
    return mujoco.MjModel.from_xml_string(XML.format(**parts))


def compare_forces(case: Live, tolerance: float, *, speed: float = 0.2) -> None:
    """Compare accelerations and forces where the bodies are at first."""
    states = case.states(3, spread=0.0, speed=speed)
    frame = case.place(states)
    for world, data in enumerate(case.data(states)):
        mujoco.mj_forward(case.model, data)
        mujoco.mj_rnePostConstraint(case.model, data)
        assert frame.contact_count[world] == data.ncon > 8
        assert relative(frame.qacc[world], data.qacc) < tolerance
        assert relative(frame.qfrc_passive[world], data.qfrc_passive) < tolerance
        assert relative(frame.qfrc_constraint[world], data.qfrc_constraint) < tolerance
        assert relative(frame.cfrc_ext[world].ravel(), data.cfrc_ext.ravel()) < tolerance
        assert relative(frame.sensordata[world], data.sensordata) < tolerance


@pytest.mark.parametrize("condim", [1, 3, 4, 6])
@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
def test_contacts_pull_as_in_mujoco(cone, condim):
    with live(model(cone=cone, condim=condim), worlds=3, fields=FIELDS) as case:
        compare_forces(case, 1e-8)
        case.assert_steps_are_mujocos(case.states(3, spread=0.0, speed=0.05), STEPS, 1e-6)


@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
def test_contacts_in_the_gap_stop_what_is_fast(cone):
    with live(model(cone=cone, condim=4, impratio=5.0), worlds=8, fields=FIELDS) as case:
        compare_forces(case, 1e-8, speed=3.0)


@pytest.mark.parametrize("integrator", ["implicitfast", "implicit", "RK4"])
def test_integrators_take_it(integrator):
    with live(model(integrator=integrator), worlds=2, fields=FIELDS) as case:
        compare_forces(case, 1e-8)
        case.assert_steps_are_mujocos(case.states(3, spread=0.0, speed=0.05), STEPS, 1e-6)


@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
def test_sweeps_of_noslip_take_it(cone):
    with live(model(cone=cone, condim=4, option='noslip_iterations="5"'), worlds=2, fields=FIELDS) as case:
        compare_forces(case, 1e-8)


#: A ball that hangs from a sphere, one in its gap, and one that rests.
HUNG = """<mujoco><option cone="{cone}" timestep=".002"/>
<default><geom condim="{condim}" friction=".6 .02 .004"/></default><worldbody>
  <geom type="plane" size="9 9 1" adhesion="2"/>
  <geom size=".2" pos="0 0 1" adhesion="6" gap=".03"/>
  <body pos="0 0 .7005"><freejoint/><geom size=".1" mass=".4"/></body>
  <body pos=".3 0 .9"><freejoint/><geom size=".1" mass=".4"/></body>
  <body pos="2 .3 .0995"><freejoint/><geom size=".1" mass=".4" adhesion="1"/></body>
</worldbody></mujoco>"""


@pytest.mark.parametrize("condim", [1, 3, 6])
@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
def test_single_precision_is_near(cone, condim):
    with live(HUNG.format(cone=cone, condim=condim), worlds=8, precision="f32", fields=("cfrc_ext",)) as case:
        states = case.states(3, spread=0.0, speed=0.2)
        frame = case.place(states)
        for world, data in enumerate(case.data(states)):
            mujoco.mj_forward(case.model, data)
            mujoco.mj_rnePostConstraint(case.model, data)
            assert relative(frame.qacc[world], data.qacc) < 1e-3
            assert relative(frame.cfrc_ext[world].ravel(), data.cfrc_ext.ravel()) < 1e-3


def test_a_contact_force_is_what_shapes_exert_on_each_other():
    xml = """<mujoco><option timestep=".002"/><worldbody>
      <geom type="box" size="1 1 .1" pos="0 0 1.1" adhesion="9" gap=".02"/>
      <body pos="0 0 .9001"><freejoint/><geom size=".1" mass=".5"/></body></worldbody></mujoco>"""
    with live(xml, worlds=2, fields=("contact_force", "body_contact_force", "contact_distance")) as case:
        for _ in range(500):
            frame = case.sim.step()
        # the weight hangs on the contact, and is less than what would break it
        np.testing.assert_allclose(np.abs(frame.contact_force[:, 0, 2]), 0.5 * 9.81, rtol=1e-6)
        np.testing.assert_allclose(frame.body_contact_force[:, -1, 2], 0.5 * 9.81, rtol=1e-6)
        assert (np.abs(frame.qvel[:, 2]) < 1e-6).all()


def test_weights_and_softness_that_vary_keep_the_force():
    robot = model(condim=4)
    with live(robot, worlds=3, params=("shape_mu", "shape_solref")) as case:
        scales = np.array([0.5, 1.0, 2.0])
        case.sim.params.write(shape_mu=robot.geom_friction[:, 0] * scales[:, None])
        states = case.states(2, spread=0.0, speed=0.2)
        frame, kept = case.place(states), robot.geom_friction.copy()
        for world, data in enumerate(case.data(states)):
            # sliding friction that varies scales the others with it
            robot.geom_friction[:] = kept * scales[world]
            mujoco.mj_forward(robot, data)
            assert relative(frame.qacc[world], data.qacc) < 1e-8
        robot.geom_friction[:] = kept


@pytest.mark.parametrize(
    ("option", "geom", "pair", "reason"),
    [
        ("", 'adhesion="-1"', "", "geom `g`: no support for a negative adhesion"),
        ("", "", 'adhesion="-1"', "pair `p`: no support for a negative adhesion"),
        ('<flag spring="disable" damper="disable"/>', 'adhesion="1"', "", "geom `g`: no support for adhesion where"),
    ],
)
def test_what_is_refused_has_a_name(option, geom, pair, reason):
    xml = f"""<mujoco><option>{option}</option><worldbody><geom name="f" type="plane" size="1 1 1"/>
      <body><freejoint/><geom name="g" size=".1" {geom}/></body></worldbody>
      <contact><pair name="p" geom1="f" geom2="g" {pair}/></contact></mujoco>"""
    with pytest.raises(SceneError, match=reason):
        tl.Scene.from_mujoco(mujoco.MjModel.from_xml_string(xml))


def test_adhesion_that_is_set_later_needs_its_flag():
    xml = """<mujoco><worldbody><geom type="plane" size="1 1 1"/>
      <body pos="0 0 .0999"><freejoint/><geom name="g" size=".1"/></body></worldbody></mujoco>"""
    robot = mujoco.MjModel.from_xml_string(xml)
    robot.geom_adhesion[1] = 2.0
    with pytest.raises(SceneError, match="geom `g`: no support for adhesion while the model's flg_adhesion is off"):
        tl.Scene.from_mujoco(robot)
    robot.flg_adhesion = 1
    with live(robot, worlds=1, fields=("qfrc_passive",)) as case:
        np.testing.assert_allclose(case.sim.forward().qfrc_passive[0, 2], -2.0)
