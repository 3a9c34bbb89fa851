"""Actuators that pull a body to what it touches, beside MuJoCo: forces at states, motions, and what is refused."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from live_model import Live, live, relative

import tightloop as tl

STEPS = 200
FIELDS = ("actuator_force", "actuator_length", "actuator_velocity", "qfrc_actuator", "smooth_force", "contact_count")
#: A ball under a ceiling, a log on a slope, two balls that hold each other, and an arm with a pad.
XML = """<mujoco><option cone="{cone}" integrator="{integrator}" timestep=".002"/>
<default><geom condim="{condim}" friction=".8 .01 .002" margin="{margin}" gap="{gap}"/></default>
<worldbody>
  <geom name="floor" type="plane" size="9 9 1"/>
  <geom name="ceiling" type="box" size="1 1 .1" pos="-3 0 1.1"/>
  <geom name="slope" type="box" size=".5 .5 .1" pos="3 0 1" euler="0 50 0"/>
  <body name="ball" pos="-3 0 .9005"><freejoint/><geom size=".1" mass=".4"/></body>
  <body name="log" pos="3.1452 0 1.1218" euler="90 0 0"><freejoint/>
    <geom type="capsule" size=".09 .15" mass=".5"/></body>
  <body name="held" pos="0 2 .0995"><freejoint/><geom size=".1" mass="1"/></body>
  <body name="holder" pos=".1 2 .2727"><freejoint/><geom size=".1" mass=".1"/></body>
  <body name="arm" pos="0 0 .6"><joint name="shoulder" axis="0 1 0" damping=".2" {bound}/>
    <geom type="capsule" size=".03" fromto="0 0 0 .5 0 0" contype="0" conaffinity="0" mass=".3"/>
    <body name="pad" pos=".5 0 -.45"><joint name="press" type="slide" axis="0 0 1" damping="2"/>
      <geom type="box" size=".05 .04 .03" pos="0 0 -.1205" mass=".2"/><geom size=".05" pos=".2 0 -.1005" mass=".1"/>
      <body name="toe"><geom size=".05" pos="-.2 0 -.1005" mass=".1"/></body></body></body>
</worldbody>
<actuator>
  <motor name="lift" joint="shoulder" gear="2"/>
  <adhesion name="hang" body="ball" ctrlrange="0 1" gain="12"/>
  <general name="grip" body="log" ctrllimited="true" ctrlrange="0 2" gainprm="15" biastype="affine" biasprm="2 3 0"
    forcelimited="true" forcerange="0 25" dyntype="filter" dynprm=".05"/>
  <adhesion name="hold" body="holder" ctrlrange="0 1" gain="6"/>
  <adhesion name="stick" body="pad" ctrlrange="0 1" gain="8"/>
  <adhesion name="more" body="pad" ctrlrange="0 1" gain="3"/>
  <adhesion name="tip" body="toe" ctrlrange="0 1" gain="4"/>
</actuator></mujoco>"""
CONTROLS = np.array([0.3, 1.0, 0.9, 0.8, 1.5, 0.5, 0.7])
BOUND = 'actuatorfrclimited="true" actuatorfrcrange="-.3 .4"'


def model(
    *,
    cone: str = "elliptic",
    condim: int = 3,
    integrator: str = "Euler",
    margin: float = 0.002,
    gap: float = 0.0,
    bound: str = "",
) -> str:
    parts = {"cone": cone, "condim": condim, "integrator": integrator, "margin": margin, "gap": gap, "bound": bound}
    return XML.format(**parts)


def compare_steps(case: Live, tolerance: float) -> None:
    """Step both sides, and compare forces, moments and states on the way."""
    data = mujoco.MjData(case.model)
    data.ctrl[:] = CONTROLS
    frame = case.sim.write(ctrl=CONTROLS)
    pads = {case.model.body(name).id for name in ("ball", "log", "holder", "pad", "toe")}
    touched: set[int] = set()
    for step in range(STEPS):
        if step % 20 == 0:
            mujoco.mj_forward(case.model, data)
            for name in ("actuator_force", "actuator_length", "actuator_velocity", "qfrc_actuator", "qacc"):
                found, expected = getattr(frame, name)[0], getattr(data, name)
                scale = max(1.0, float(np.abs(expected).max()))
                assert np.abs(found - expected).max() < tolerance * scale, f"{name} at {step}"
            touched |= set(case.model.geom_bodyid[data.contact.geom].ravel().tolist())
            assert frame.contact_count[0] == data.ncon
        frame = case.sim.step(ctrl=CONTROLS)
        mujoco.mj_step(case.model, data)
    assert pads <= touched
    assert relative(frame.qpos[0], data.qpos) < tolerance
    assert relative(frame.qvel[0], data.qvel) < 10 * tolerance


@pytest.mark.parametrize("condim", [1, 3, 4, 6])
@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
def test_bodies_stick_as_in_mujoco(cone, condim):
    with live(model(cone=cone, condim=condim), worlds=1, fields=FIELDS) as case:
        compare_steps(case, 1e-8)


@pytest.mark.parametrize("integrator", ["implicitfast", "RK4"])
def test_integrators_take_adhesion(integrator):
    with live(model(integrator=integrator), worlds=1, fields=FIELDS) as case:
        compare_steps(case, 1e-8)


def test_contacts_in_the_gap_count_though_they_exert_no_force():
    with live(model(margin=0.0, gap=0.01), worlds=1, fields=FIELDS) as case:
        compare_steps(case, 1e-8)


def test_the_sum_of_forces_on_a_joint_is_bounded_with_adhesion():
    with live(model(bound=BOUND), worlds=1, fields=FIELDS) as case:
        compare_steps(case, 1e-8)


def test_single_precision_is_near():
    # a margin beyond the rounding of distances keeps the number of contacts
    with live(model(margin=0.005), worlds=1, fields=FIELDS, precision="f32") as case:
        compare_steps(case, 1e-3)


def test_worlds_have_numbers_of_contacts_of_their_own():
    """A pad that touches with other points in each world, or with none."""
    with live(model(), worlds=16, fields=FIELDS) as case:
        states = case.states(5, spread=0.0, speed=0.3)
        rng = np.random.default_rng(0)
        slide = case.model.joint("press").qposadr[0]
        turn = case.model.joint("shoulder").qposadr[0]
        states.qpos[:, slide] += rng.uniform(-0.01, 0.01, len(states.qpos))
        states.qpos[:, turn] += rng.uniform(-0.02, 0.02, len(states.qpos))
        frame, counts = case.place(states), set()
        for world, data in enumerate(case.data(states)):
            mujoco.mj_forward(case.model, data)
            counts.add(data.ncon)
            assert frame.contact_count[world] == data.ncon
            np.testing.assert_allclose(frame.qfrc_actuator[world], data.qfrc_actuator, rtol=0, atol=1e-9)
            np.testing.assert_allclose(frame.actuator_velocity[world], data.actuator_velocity, rtol=0, atol=1e-9)
        assert len(counts) > 2


def test_adhesion_pulls_nothing_where_nothing_touches():
    xml = """<mujoco><worldbody><body name="b" pos="0 0 1"><freejoint/><geom size=".1"/></body></worldbody>
    <actuator><adhesion body="b" ctrlrange="0 1" gain="5"/></actuator></mujoco>"""
    with live(xml, worlds=3, fields=("qfrc_actuator", "actuator_force")) as case:
        frame = case.sim.step(ctrl=[1.0])
        assert not frame.qfrc_actuator.any()
        np.testing.assert_allclose(frame.actuator_force, 5.0)


@pytest.mark.parametrize(
    ("actuator", "reason"),
    [
        ('<adhesion name="a" body="world" ctrlrange="0 1"/>', "of the world"),
        ('<general name="a" body="b" biastype="affine" biasprm="0 0 -1"/>', "a force that depends on velocity"),
        ('<general name="a" body="b" gaintype="affine" gainprm="1 0 2"/>', "a force that depends on velocity"),
    ],
)
def test_what_is_not_supported_is_refused_by_name(actuator, reason):
    xml = f"""<mujoco><worldbody><geom type="plane" size="1 1 1"/><body name="b"><freejoint/><geom size=".1"/></body>
    </worldbody><actuator>{actuator}</actuator></mujoco>"""
    with pytest.raises(tl.SceneError, match=f"actuator `a`: no support for .*{reason}"):
        tl.Scene.from_mujoco(mujoco.MjModel.from_xml_string(xml))


def test_contacts_of_a_mocap_pad_with_what_stands_still_do_not_count():
    xml = """<mujoco><worldbody><geom type="plane" size="9 9 .1"/>
      <body name="pad" mocap="true" pos="0 0 .095"><geom type="box" size=".1 .1 .1"/></body>
      <body pos="0 0 .29"><freejoint/><geom size=".1"/></body></worldbody>
      <actuator><adhesion body="pad" ctrlrange="0 1" gain="12"/></actuator></mujoco>"""
    with live(xml, worlds=1, fields=("qfrc_actuator",)) as case:
        data = mujoco.MjData(case.model)
        data.ctrl[:] = 1.0
        mujoco.mj_forward(case.model, data)
        assert data.ncon == 1 and data.qfrc_actuator[2] == -12.0
        frame = case.sim.write(ctrl=[[1.0]])
        np.testing.assert_allclose(frame.qfrc_actuator[0], data.qfrc_actuator, rtol=0, atol=1e-9)
