"""Delays of actuators beside MuJoCo: every interpolation and integrator, resets, snapshots, and what is refused."""

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np
import pytest
from live_model import Live, live, relative

import tightloop as tl
from tightloop.mujoco import Batch

WORLDS = 3
STEPS = 200
FIELDS = ("actuator_force",)
# One actuator per joint of a row of pendulums, so that no error hides behind another one. MuJoCo rounds the time: with
# a time step of 0.01, a hold of whole steps may last a step longer from step 204 on.
ACTUATORS = {
    "one step": '<motor {at} gear="2" delay=".002" nsample="1"/>',
    "less than a step": '<motor {at} delay=".0003" nsample="3" interp="linear"/>',
    "negative": '<motor {at} delay="-1" nsample="3" interp="cubic"/>',
    "whole steps": '<motor {at} delay=".006" nsample="5"/>',
    "whole steps of a spline": '<motor {at} delay=".004" nsample="5" interp="cubic"/>',
    "a hold between steps": '<motor {at} delay=".005" nsample="4"/>',
    "a line": '<motor {at} delay=".0052" nsample="4" interp="linear" ctrlrange="-.8 .7"/>',
    "a spline": '<position {at} kp="3" kv=".1" delay=".0093" nsample="9" interp="cubic"/>',
    "a spline at the oldest": '<motor {at} delay=".0093" nsample="5" interp="cubic"/>',
    "a spline at the newest": '<motor {at} delay=".0031" nsample="6" interp="cubic"/>',
    "beyond the oldest": '<motor {at} delay=".5" nsample="3" interp="linear"/>',
    "long": '<motor {at} delay=".1007" nsample="60" interp="cubic"/>',
    "a history that is not read": '<motor {at} nsample="4" interp="linear"/>',
    "a filter": '<general {at} dyntype="filterexact" dynprm=".02" delay=".0071" nsample="5" interp="linear"/>',
    "early": '<general {at} dyntype="integrator" actearly="true" delay=".004" nsample="5"/>',
    "a gain that damps": '<general {at} gaintype="affine" gainprm="1 .2 -.3" delay=".0045" nsample="5"/>',
    "a current": '<dcmotor {at} motorconst=".1" resistance="1.3" inductance=".01" delay=".0045" nsample="5"/>',
    "off": '<motor {at} delay=".004" nsample="5" group="2"/>',
}
KEYFRAMES = '<keyframe><key name="home" qpos="{qpos}" ctrl="{ctrl}"/></keyframe>'


def model(actuators: list[str], *, integrator: str = "implicitfast", timestep: str = ".002") -> mujoco.MjModel:
    bodies, elements = [], []
    for k, actuator in enumerate(actuators):
        bodies.append(
            f'<body pos="0 {k} 1"><joint name="j{k}" axis="0 1 0" damping=".1"/><geom size=".1" pos=".3 0 0"/></body>'
        )
        elements.append(actuator.format(at=f'name="a{k}" joint="j{k}"'))
    numbers = [f"{0.1 * k}" for k in range(len(actuators))]
    keyframes = KEYFRAMES.format(qpos=" ".join(numbers), ctrl=" ".join(reversed(numbers)))
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><option integrator="{integrator}" timestep="{timestep}"/><default><geom contype="0" conaffinity="0"/>'
        f"</default><worldbody>{''.join(bodies)}</worldbody><actuator>{''.join(elements)}</actuator>{keyframes}</mujoco>"
    )


def controls(case: Live, seed: int) -> Iterator[np.ndarray]:
    rng = np.random.default_rng(seed)
    for _ in range(STEPS):
        yield rng.normal(0, 1, (case.sim.worlds, case.model.nu))


def assert_steps_are_mujocos(case: Live, worlds: list[mujoco.MjData], tolerance: float, substeps: int = 1) -> None:
    for ctrl in controls(case, 5):
        frame = case.sim.step(ctrl=ctrl)
        for world, data in enumerate(worlds):
            data.ctrl[:] = ctrl[world]
            mujoco.mj_step(case.model, data, nstep=substeps)
            assert relative(frame.qpos[world], data.qpos) < tolerance
            assert relative(frame.qvel[world], data.qvel) < tolerance
            assert relative(frame.act[world], data.act) < tolerance


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast", "implicit", "RK4"])
def test_steps_are_mujocos(integrator: str) -> None:
    robot = model(list(ACTUATORS.values()), integrator=integrator)
    robot.opt.disableactuator = 1 << 2
    with live(robot, worlds=WORLDS, fields=FIELDS) as case:
        states = case.states(3, spread=0.3, speed=1.0)
        case.place(states)
        worlds = list(case.data(states))
        assert_steps_are_mujocos(case, worlds, 1e-9)
        # forces of a state follow the controls on the way, and not those that are held
        frame = case.sim.write(ctrl=np.zeros((WORLDS, robot.nu)))
        for world, data in enumerate(worlds):
            data.ctrl[:] = 0.0
            mujoco.mj_forward(robot, data)
            assert relative(frame.actuator_force[world], data.actuator_force) < 1e-9


def test_every_substep_keeps_the_control() -> None:
    with live(model(list(ACTUATORS.values())), worlds=WORLDS, substeps=3) as case:
        states = case.states(3, spread=0.3)
        case.place(states)
        assert_steps_are_mujocos(case, list(case.data(states)), 1e-9, substeps=3)


@pytest.mark.parametrize("integrator", ["implicitfast", "RK4"])
def test_single_precision_is_near(integrator: str) -> None:
    robot = model(list(ACTUATORS.values()), integrator=integrator)
    with live(robot, worlds=WORLDS, precision="f32") as case:
        states = case.states(3, spread=0.3)
        case.place(states)
        assert_steps_are_mujocos(case, list(case.data(states)), 1e-3)


@pytest.mark.parametrize(
    ("timestep", "delay", "steps"), [(".00390625", ".0390625", 10), (".01", ".06", 6), (".01", ".07", 7)]
)
def test_a_hold_of_whole_steps_lasts_exactly_that_long(timestep: str, delay: str, steps: int) -> None:
    robot = model([f'<motor {{at}} delay="{delay}" nsample="20"/>'], timestep=timestep)
    sent = np.random.default_rng(2).normal(0, 1, 1200)
    with live(robot, worlds=1, fields=FIELDS) as case:
        for step in range(len(sent)):
            frame = case.sim.step(ctrl=sent[step : step + 1])
            # the state of the frame is a step later
            came = step + 1 - steps
            assert frame.actuator_force[0, 0] == (sent[came] if came >= 0 else 0.0)


def test_a_reset_forgets_controls_and_a_snapshot_keeps_them() -> None:
    with live(model(list(ACTUATORS.values())), worlds=WORLDS) as case:
        sim = case.sim
        all_controls = list(controls(case, 7))[:30]
        sim.reset()
        first = [sim.step(ctrl=ctrl).copy() for ctrl in all_controls]
        # the same run again, and in the world that is left alone another
        sim.reset(mask=[True, False, True])
        again = [sim.step(ctrl=ctrl).copy() for ctrl in all_controls]
        for one, other in zip(first, again, strict=True):
            assert np.array_equal(one.qpos[[0, 2]], other.qpos[[0, 2]])
            assert not np.array_equal(one.qpos[1], other.qpos[1])
        # what is on its way is part of a snapshot, and evaluating in between changes nothing
        snapshot = sim.snapshot()
        on = [sim.step(ctrl=ctrl).copy().qpos for ctrl in all_controls]
        sim.restore(snapshot)
        for ctrl, expected in zip(all_controls, on, strict=True):
            sim.forward()
            assert np.array_equal(sim.step(ctrl=ctrl).qpos, expected)


def test_after_a_keyframe_no_control_is_on_its_way() -> None:
    robot = model(list(ACTUATORS.values()))
    with live(robot, worlds=WORLDS) as case:
        for ctrl in list(controls(case, 7))[:20]:
            case.sim.step(ctrl=ctrl)
        case.sim.reset(keyframe="home")
        worlds = [mujoco.MjData(robot) for _ in range(WORLDS)]
        for data in worlds:
            mujoco.mj_resetDataKeyframe(robot, data, 0)
        assert_steps_are_mujocos(case, worlds, 1e-9)


def test_a_saved_scene_keeps_its_delays(tmp_path) -> None:
    robot = model([ACTUATORS["a line"], ACTUATORS["a spline"]])
    scene = tl.Scene.from_mujoco(robot, name="m")
    scene.save(tmp_path / "scene.toml")
    ends = []
    for each in (scene, tl.Scene.load(tmp_path / "scene.toml")):
        rng = np.random.default_rng(1)
        with tl.launch(each, worlds=1, fields=("qpos",)) as sim:
            ends.append([sim.step(ctrl=rng.normal(0, 1, robot.nu)).qpos.copy() for _ in range(20)])
    assert np.array_equal(*ends)


def test_delays_of_many_steps_are_refused_by_name() -> None:
    robot = model(['<motor {at} delay=".52" nsample="300"/>'])
    with pytest.raises(tl.SceneError, match=r"actuator `a0`: number of steps of its delay is 260; give at most 256"):
        tl.Scene.from_mujoco(robot)
    # the oldest control that is kept stands for those before it
    tl.Scene.from_mujoco(model(['<motor {at} delay=".52" nsample="256"/>']))
    # without its delay, or without the actuator
    tl.Scene.from_mujoco(robot, without=("a0",))
    robot.actuator_delay[:] = 0.0
    tl.Scene.from_mujoco(robot)


@pytest.mark.parametrize("delay", [np.nan, np.inf])
def test_a_delay_that_is_not_finite_is_refused(delay: float) -> None:
    robot = model([ACTUATORS["a line"]])
    robot.actuator_delay[:] = delay
    with pytest.raises(tl.SceneError, match=r"a delay .* not finite|`actuator_delay` has a NaN"):
        tl.Scene.from_mujoco(robot)


def test_a_batch_refuses_delays_by_name() -> None:
    with pytest.raises(tl.ArgumentError, match="Batch: no support for the delay of actuator `a0`"):
        Batch(model([ACTUATORS["a line"]]), 2)
    with Batch(model([ACTUATORS["a history that is not read"]]), 2) as batch:
        batch.step()
        batch.expand("actuator_delay")[1] = 0.003
        with pytest.raises(RuntimeError, match="sim 1: Batch: no support for the delay of actuator `a0`"):
            batch.step()
