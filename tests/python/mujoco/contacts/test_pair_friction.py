"""Pairs of geoms whose friction differs between the tangents, beside MuJoCo: motions, forces and parameters."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from live_model import Live, live, relative

from tightloop.mujoco import Batch

STEPS = 100
FIELDS = ("cfrc_ext", "sensordata")
#: A ball, a capsule, a box and a can that slide and roll on tilted ground, and a ball on the first one.
XML = """<mujoco><option cone="{cone}" integrator="{integrator}" timestep=".002" impratio="{impratio}" {option}/>
<worldbody>
  <geom name="floor" type="plane" size="9 9 1" euler="8 -6 20"/>
  <geom name="shelf" type="box" size=".4 .4 .1" pos="2 0 .9" euler="12 7 30"/>
  <body name="ball" pos="0 0 .0995"><freejoint/><geom name="ball" size=".1" mass=".4" pos=".01 0 0"/></body>
  <body name="log" pos="-1 0 .05" euler="85 30 0"><freejoint/>
    <geom name="log" type="capsule" size=".08 .15" mass=".5"/></body>
  <body name="box" pos="2.02 .03 1.08" euler="12 7 10"><freejoint/>
    <geom name="box" type="box" size=".1 .07 .08" mass="1"/></body>
  <body name="can" pos="1 1 .15" euler="8 -6 0"><freejoint/>
    <geom name="can" type="cylinder" size=".08 .1" mass=".7"/></body>
  <body name="top" pos="0 .03 .27"><freejoint/><geom name="top" size=".08" mass=".2"/></body>
</worldbody>
<contact>
  <pair geom1="floor" geom2="ball" condim="{condim}" friction=".8 .3 .02 .01 .003"/>
  <pair geom1="log" geom2="floor" condim="{condim}" friction=".2 .9 .02 .004 .02"/>
  <pair geom1="box" geom2="shelf" condim="{condim}" friction=".1 .5 .005 .0001 .02" solreffriction=".05 1"/>
  <pair geom1="can" geom2="floor" condim="{condim}" friction=".6 .6 .02 .01 .01"/>
  <pair geom1="top" geom2="ball" condim="{condim}" friction="1 .2 .02 .02 .001"/>
</contact>
<sensor>
  <contact geom1="ball" geom2="floor" data="found force torque normal tangent"/>
  <contact geom1="log" geom2="floor" data="force torque" reduce="mindist"/>
  <contact body1="box" data="force torque" reduce="netforce"/>
</sensor></mujoco>"""


def model(
    *, cone: str = "elliptic", condim: int = 6, integrator: str = "Euler", impratio: float = 3.0, option: str = ""
) -> mujoco.MjModel:
    parts = {"cone": cone, "condim": condim, "integrator": integrator, "impratio": impratio, "option": option}
    return mujoco.MjModel.from_xml_string(XML.format(**parts))


def compare(case: Live, tolerance: float) -> None:
    """Compare forces where the bodies rest and slide at first, then their motion."""
    states = case.states(2, spread=0.0, speed=0.3)
    frame = case.place(states)
    worlds = list(case.data(states))
    for world, data in enumerate(worlds):
        mujoco.mj_forward(case.model, data)
        mujoco.mj_rnePostConstraint(case.model, data)
        assert data.ncon > 4
        assert relative(frame.qacc[world], data.qacc) < tolerance
        assert relative(frame.cfrc_ext[world].ravel(), data.cfrc_ext.ravel()) < tolerance
        assert relative(frame.sensordata[world], data.sensordata) < tolerance
    for _ in range(STEPS):
        frame = case.sim.step()
        for data in worlds:
            mujoco.mj_step(case.model, data)
    for world, data in enumerate(worlds):
        assert relative(frame.qpos[world], data.qpos) < tolerance
        assert relative(frame.qvel[world], data.qvel) < 10 * tolerance


@pytest.mark.parametrize("impratio", [1.0, 10.0])
@pytest.mark.parametrize("condim", [1, 3, 4, 6])
@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
def test_forces_and_motion_are_mujocos(cone, condim, impratio):
    with live(model(cone=cone, condim=condim, impratio=impratio), worlds=4, fields=FIELDS) as case:
        compare(case, 1e-8)


@pytest.mark.parametrize("integrator", ["implicitfast", "implicit", "RK4"])
@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
def test_integrators_take_them(cone, integrator):
    with live(model(cone=cone, integrator=integrator), worlds=2, fields=FIELDS) as case:
        compare(case, 1e-8)


@pytest.mark.parametrize("condim", [3, 6])
@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
def test_sweeps_of_noslip_take_them(cone, condim):
    robot = model(cone=cone, condim=condim, option='noslip_iterations="5"')
    with live(robot, worlds=2, fields=FIELDS) as case:
        compare(case, 1e-8)


def test_single_precision_is_near():
    with live(model(), worlds=4, precision="f32", fields=FIELDS) as case:
        states = case.states(2, spread=0.0, speed=0.3)
        frame = case.place(states)
        for world, data in enumerate(case.data(states)):
            mujoco.mj_forward(case.model, data)
            assert relative(frame.qacc[world], data.qacc) < 1e-2


def test_friction_that_varies_scales_both_tangents():
    robot = model()
    # of sliding, torsion and rolling
    scales = np.array([[0.5, 1.0, 1.7], [1.0, 3.0, 0.4], [1.7, 0.5, 1.0]])
    with live(robot, worlds=3, params=("pair_friction",)) as case:
        first = robot.pair_friction[:, [0, 2, 3]].copy()
        case.sim.params.write(pair_friction=first * scales[:, None])
        states = case.states(2, spread=0.0, speed=0.3)
        frame, before = case.place(states), robot.pair_friction.copy()
        for world, data in enumerate(case.data(states)):
            robot.pair_friction[:] = before * scales[world, [0, 0, 1, 2, 2]]
            mujoco.mj_forward(robot, data)
            assert relative(frame.qacc[world], data.qacc) < 1e-8


def test_a_batch_takes_other_ratios_as_models_of_their_own():
    robot = model(condim=4)
    data = [mujoco.MjData(robot) for _ in range(4)]
    with Batch(robot, 4, precision="f64") as batch:
        friction, qpos = batch.expand("pair_friction"), batch.bind("qpos")
        friction *= np.array([1.0, 0.5, 1.0, 2.0])[:, None, None]
        friction[2, :, 1] = 0.4
        friction[3, 0, 1] = friction[3, 0, 0]
        batch.step(nstep=20)
        before = robot.pair_friction.copy()
        for sim, each in enumerate(data):
            robot.pair_friction[:] = friction[sim]
            mujoco.mj_step(robot, each, nstep=20)
            robot.pair_friction[:] = before
            assert relative(qpos[sim], each.qpos) < 1e-7
