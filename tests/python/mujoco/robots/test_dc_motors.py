"""DC motors beside MuJoCo: forces, currents and motion, with each kind of control, and what is refused."""

from __future__ import annotations

import mujoco
import pytest
from live_model import live, relative

import tightloop as tl
from tightloop.mujoco import Batch

WORLDS = 4
FIELDS = ("actuator_force", "qfrc_actuator")
XML = """<mujoco><option integrator="{integrator}" timestep=".002"/>
<default><geom contype="0" conaffinity="0" density="500"/><joint armature=".01"/></default>
<worldbody>
  <site name="anchor" pos=".9 .2 1.2"/>
  <body pos="0 0 1"><joint name="a" axis="0 1 0" damping=".02"/><geom type="capsule" size=".03" fromto="0 0 0 .3 0 0"/>
    <body pos=".3 0 0"><joint name="b" axis="0 1 .3"/><geom type="capsule" size=".03" fromto="0 0 0 .2 0 .1"/>
      <site name="tip" pos=".2 0 .1"/></body></body>
  <body pos="0 .5 1"><joint name="c" axis="1 0 0"/><geom type="capsule" size=".03" fromto="0 0 0 .2 0 .1"/></body>
  <body pos="0 .5 1"><joint name="d" type="slide" axis="1 0 0"/><geom size=".05"/></body>
</worldbody>
<tendon>
  <spatial name="rope"><site site="anchor"/><site site="tip"/></spatial>
  <fixed name="sum" actuatorfrclimited="true" actuatorfrcrange="-.2 .2"><joint joint="c" coef="1"/>
    <joint joint="d" coef="2"/></fixed>
</tendon>
<actuator>
  <general joint="c" dyntype="filter" dynprm=".1" gainprm=".3"/>
  <dcmotor joint="a" motorconst=".5" resistance="2" gear="3" {motor}/>
  <dcmotor tendon="rope" motorconst=".5" resistance="2" gear="1.5" {motor}/>
  <dcmotor tendon="sum" motorconst=".05" resistance="1.3" {motor}/>
  <dcmotor site="tip" motorconst=".1" resistance="1.3" gear="1 2 0 .1 0 0" {motor}/>
  <dcmotor joint="b" motorconst=".1" resistance="1.3" group="2" {motor}/>
</actuator></mujoco>"""
MOTORS = {
    "voltage": 'ctrlrange="-8 8"',
    "nominal": 'nominal="12 1.5 300"',
    "cogging": 'cogging=".3 6 .3"',
    "saturation": 'cogging=".1 6 .3" saturation=".4 0 0"',
    "position": 'input="pos" controller="7 0 .3 0 0 0"',
    "position by a bounded voltage": 'input="pos" controller="7 0 .3 0 0 3"',
    "velocity": 'input="vel" controller="1 0 .3 0 0 3" cogging=".02 8 .1"',
    "force": 'input="ff"',
    "force by a bounded voltage": 'input="ff" controller="1 0 .3 0 0 2"',
    "inductance": 'inductance=".01"',
    "current that changes slowly": 'inductance=".01" saturation="0 0 200"',
    "all": 'input="pos" controller="7 0 .3 0 0 5" inductance=".01" saturation=".5 0 300" cogging=".05 6 .3"',
}


def model(motor: str, integrator: str = "implicitfast") -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(XML.format(motor=motor, integrator=integrator))


@pytest.mark.parametrize("off", [0, 1 << 2])
@pytest.mark.parametrize("motor", MOTORS)
@pytest.mark.parametrize("integrator", ["Euler", "implicitfast", "implicit", "RK4"])
def test_forces_currents_and_steps_are_mujocos(integrator, motor, off):
    robot = model(MOTORS[motor], integrator)
    robot.opt.disableactuator = off
    with live(robot, worlds=WORLDS, fields=FIELDS) as case:
        states = case.states(3, spread=0.3, speed=1.0)
        states.ctrl *= 6.0
        frame = case.place(states)
        worlds = list(case.data(states))
        for world, data in enumerate(worlds):
            mujoco.mj_forward(robot, data)
            for name in (*FIELDS, "qacc"):
                assert relative(getattr(frame, name)[world], getattr(data, name)) < 1e-8, name
        for steps, tolerance in ((1, 1e-8), (99, 1e-7)):
            for _ in range(steps):
                frame = case.sim.step()
                for data in worlds:
                    mujoco.mj_step(robot, data)
            for world, data in enumerate(worlds):
                assert relative(frame.qpos[world], data.qpos) < tolerance
                assert relative(frame.qvel[world], data.qvel) < tolerance
                assert relative(frame.act[world], data.act) < tolerance


@pytest.mark.parametrize("motor", ["cogging", "all"])
def test_single_precision_is_near(motor):
    with live(model(MOTORS[motor]), worlds=WORLDS, precision="f32", fields=FIELDS) as case:
        states = case.states(3, spread=0.3, speed=1.0)
        frame = case.place(states)
        for world, data in enumerate(case.data(states)):
            mujoco.mj_forward(case.model, data)
            assert relative(frame.actuator_force[world], data.actuator_force) < 1e-4


def test_a_batch_varies_other_gains_beside_motors():
    robot = model(MOTORS["position"])
    data = [mujoco.MjData(robot) for _ in range(3)]
    with Batch(robot, 3, precision="f64") as batch:
        gains, biases, qpos = batch.expand("actuator_gainprm"), batch.expand("actuator_biasprm"), batch.bind("qpos")
        assert biases.shape == gains.shape
        ctrl = batch.bind("ctrl")
        ctrl[:] = 0.4
        # of the filter, which is a parameter, and of a motor, which needs a model
        gains[:, 0, 0] = (0.1, 0.3, 0.9)
        gains[2, 1, 4] = 3.0
        batch.step(nstep=20)
        before = robot.actuator_gainprm.copy()
        for sim, each in enumerate(data):
            robot.actuator_gainprm[:] = gains[sim]
            each.ctrl[:] = 0.4
            mujoco.mj_step(robot, each, nstep=20)
            robot.actuator_gainprm[:] = before
            assert relative(qpos[sim], each.qpos) < 1e-8


@pytest.mark.parametrize(
    ("motor", "reason"),
    [
        ('lugre="1 2 3 4 5"', "LuGre friction of a DC motor"),
        ('thermal="1 2 3 .004 25 20"', "the temperature of a DC motor"),
        ('input="pos" controller="1 2 3 0 5 6"', "an integral gain of a DC motor's controller"),
        ('input="pos" controller="1 0 3 4 5 6"', "a slew rate of a DC motor's controller"),
        ('input="pos vel"', "another number of controls"),
        ('input="none"', "another number of controls"),
    ],
)
def test_what_is_not_supported_is_refused_by_name(motor, reason):
    with pytest.raises(tl.SceneError, match=f"actuator `actuator1`: no support for {reason}"):
        tl.Scene.from_mujoco(model(motor))
