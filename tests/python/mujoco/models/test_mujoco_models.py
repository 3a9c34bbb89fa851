"""Random models against MuJoCo: accelerations, actuator forces and steps, feature by feature."""

from __future__ import annotations

import os
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from live_model import Live, has_closed_form, live, relative
from random_mjcf import ACTUATED, EVERYTHING, JOINTS, MEDIUM, random_mjcf

from tiers import sweep

TREES = int(os.environ.get("TIGHTLOOP_LIVE_TREES", "48")) // 8
FEATURES = {
    "joints": JOINTS,
    "springs": replace(JOINTS, springs=True),
    "armature": replace(JOINTS, armature=True),
    "free joints in Runge-Kutta": replace(JOINTS, damping=True, armature=True, springs=True, option='integrator="RK4"'),
    "damping": replace(JOINTS, damping=True),
    "explicit damping": replace(JOINTS, damping=True, flag='eulerdamp="disable"'),
    "implicit damping": replace(JOINTS, damping=True, option='integrator="implicitfast"'),
    "implicit armature": replace(JOINTS, armature=True, damping=True, option='integrator="implicitfast"'),
    "fluid": replace(JOINTS, option=MEDIUM),
    "viscosity in Runge-Kutta": replace(JOINTS, option='viscosity="0.7" integrator="RK4"'),
    "implicit fluid": replace(JOINTS, option=f'{MEDIUM} integrator="implicitfast"'),
    "implicit fluid and free joints": replace(
        JOINTS, armature=True, damping=True, option=f'{MEDIUM} integrator="implicitfast"'
    ),
    "gravity compensation": replace(JOINTS, compensation=True),
    "gravity compensation by actuators": replace(ACTUATED, compensation=True, bounds=True),
    "no springs and dampers": replace(
        ACTUATED, compensation=True, springs=True, flag='spring="disable" damper="disable"'
    ),
    "compensation without actuation": replace(ACTUATED, compensation=True, flag='actuation="disable"'),
    "limits": replace(JOINTS, limits=True),
    "friction": replace(JOINTS, friction=True),
    "equalities": replace(JOINTS, equalities=True),
    "polynomials": replace(JOINTS, polynomials=True),
    "connections": replace(JOINTS, connections=True),
    "tendons": replace(JOINTS, tendons=True, pulls=True),
    "tendons of actuators": replace(ACTUATED, pulls=True, option='integrator="implicitfast"'),
    "explicit tendons": replace(JOINTS, tendons=True, pulls=True, flag='eulerdamp="disable"'),
    "spatial tendons": replace(JOINTS, spatial=True, pulls=True),
    "implicit spatial tendons": replace(JOINTS, spatial=True, pulls=True, option='integrator="implicitfast"'),
    "spatial tendons of actuators": replace(ACTUATED, spatial=True, bounds=True, option='integrator="implicitfast"'),
    "muscles": replace(ACTUATED, spatial=True, muscles=True, bounds=True),
    "implicit muscles": replace(ACTUATED, spatial=True, muscles=True, option='integrator="implicitfast"'),
    "muscles by Runge-Kutta": replace(ACTUATED, muscles=True, option='integrator="RK4"'),
    "mocap bodies": replace(JOINTS, mocap=True),
    "actuators": ACTUATED,
    "implicit actuators": replace(ACTUATED, bounds=True, option='integrator="implicitfast"'),
    "bounds": replace(ACTUATED, bounds=True),
    "activations": replace(ACTUATED, activations=True, bounds=True),
    "implicit activations": replace(ACTUATED, activations=True, option='integrator="implicitfast"'),
    "activations by Runge-Kutta": replace(ACTUATED, activations=True, option='integrator="RK4"'),
    "transmissions": replace(ACTUATED, transmissions=True),
    "implicit transmissions": replace(ACTUATED, transmissions=True, option='integrator="implicitfast"'),
    "unclamped": replace(ACTUATED, bounds=True, flag='clampctrl="disable"'),
    "no actuation": replace(ACTUATED, activations=True, flag='actuation="disable"'),
    "no gravity": replace(JOINTS, flag='gravity="disable"'),
    "unsafe references": replace(JOINTS, limits=True, flag='refsafe="disable"', option='timestep="0.004"'),
    "everything": EVERYTHING,
    "everything in the matrix": replace(EVERYTHING, option=f'{MEDIUM} integrator="implicit"'),
    "everything implicit": replace(EVERYTHING, option=f'{MEDIUM} integrator="implicitfast"'),
}


def assert_step(case: Live, seed: int, tolerance: float) -> None:
    """Accelerations and actuator forces at random states, and the states after a step."""
    states = case.states(seed)
    frame = case.place(states)
    moved = case.sim.step()
    for world, data in enumerate(case.data(states)):
        mujoco.mj_forward(case.model, data)
        assert relative(frame.qacc[world], data.qacc) < tolerance, "qacc"
        if case.model.nu:
            assert relative(frame.actuator_force[world], data.actuator_force) < tolerance, "actuator_force"
        mujoco.mj_step(case.model, data)
        assert relative(moved.qvel[world], data.qvel) < tolerance, "qvel"
        assert relative(moved.qpos[world], data.qpos) < tolerance, "qpos"
        if case.model.na:
            assert relative(moved.act[world], data.act) < tolerance, "act"


@pytest.mark.parametrize("feature", FEATURES)
@pytest.mark.parametrize("seed", sweep(range(TREES), daily=3))
def test_accelerations_and_steps_are_mujocos(feature: str, seed: int) -> None:
    xml = random_mjcf(seed, 1 + seed % 6, FEATURES[feature])
    with live(xml, fields=("actuator_force",)) as case:
        assert_step(case, seed, 1e-8)


@pytest.mark.parametrize("integrator", ["Euler", "implicit", "implicitfast", "RK4"])
@pytest.mark.parametrize("seed", sweep(range(TREES), daily=2))
def test_runs_are_mujocos(integrator: str, seed: int) -> None:
    """200 steps under random controls, until MuJoCo disagrees with a run of its own that begins 1e-13 away."""
    medium = "" if integrator == "RK4" else MEDIUM
    features = replace(EVERYTHING, option=f'{medium} integrator="{integrator}"')
    with live(random_mjcf(seed, 1 + seed % 4, features), worlds=4) as case:
        states = case.states(seed, speed=0.1)
        own, other = list(case.data(states)), list(case.data(states))
        for data in other:
            data.qvel[:] *= 1 + 1e-13
        case.place(states)
        rng, agrees, steps = np.random.default_rng(seed), np.ones(len(own), bool), 0
        for _ in range(200):
            ctrl = states.ctrl + rng.normal(0, 0.1, states.ctrl.shape)
            frame = case.sim.step(ctrl=ctrl if ctrl.size else None)
            for world, pair in enumerate(zip(own, other, strict=True)):
                for data in pair:
                    data.ctrl[:] = ctrl[world]
                    mujoco.mj_step(case.model, data)
                first, second = pair
                agrees[world] &= relative(first.qpos, second.qpos) < 1e-7 and not first.warning.number.any()
                # a world that explodes ends at the bounds of a run
                agrees[world] &= np.abs(first.qvel).max(initial=0.0) < 1e4
                if agrees[world]:
                    assert relative(frame.qpos[world], first.qpos) < 1e-6
            steps += int(agrees.sum())
        assert steps > 100


@pytest.mark.parametrize("integrator", ["Euler", "implicit", "implicitfast"])
@pytest.mark.parametrize("seed", range(TREES))
def test_free_joints_and_balls_are_passive_as_mujocos(integrator: str, seed: int) -> None:
    """Springs that rest away from the start, axes that differ in armature and damping, and the energy of springs."""
    features = replace(JOINTS, springs=True, armature=True, damping=True, option=f'integrator="{integrator}"')
    model = mujoco.MjModel.from_xml_string(random_mjcf(seed, 1 + seed % 4, features))
    rng = np.random.default_rng(seed)
    mujoco.mj_integratePos(model, model.qpos_spring, rng.normal(0, 0.5, model.nv), 1.0)
    model.dof_armature[:] = rng.uniform(0, 0.3, model.nv)
    model.dof_damping[:] = rng.uniform(0, 2, model.nv)
    mujoco.mj_setConst(model, mujoco.MjData(model))
    with live(model, fields=("kinetic_energy", "potential_energy")) as case:
        assert_step(case, seed, 1e-8)
        states = case.states(seed)
        frame = case.place(states)
        for world, data in enumerate(case.data(states)):
            mujoco.mj_forward(model, data)
            mujoco.mj_energyVel(model, data)
            mujoco.mj_energyPos(model, data)
            static = -sum(model.body_mass[b] * data.xipos[b] @ model.opt.gravity for b in static_bodies(model))
            np.testing.assert_allclose(frame.kinetic_energy[world], data.energy[1], rtol=1e-10)
            np.testing.assert_allclose(frame.potential_energy[world], data.energy[0] - static, rtol=1e-10, atol=1e-9)


def static_bodies(model: mujoco.MjModel) -> list[int]:
    """Bodies that stand still, which have no part in our potential energy."""
    return np.flatnonzero(model.body_weldid == 0).tolist()


@pytest.mark.parametrize("pairs", [False, True])
@pytest.mark.parametrize("cone", ["pyramidal", "elliptic"])
@pytest.mark.parametrize("seed", sweep(range(2 * TREES), daily=4))
def test_geoms_touch_as_mujocos(cone: str, pairs: bool, seed: int) -> None:
    option = f'cone="{cone}" impratio="2"'
    features = replace(JOINTS, geoms=True, pairs=pairs, equalities=seed % 2 == 0, mocap=seed % 3 == 0, option=option)
    xml = random_mjcf(seed, 2 + seed % 5, features)
    with live(xml, fields=("contact_count",)) as case:
        states = case.states(seed)
        frame = case.place(states)
        for world, data in enumerate(case.data(states)):
            mujoco.mj_forward(case.model, data)
            if all(has_closed_form(case.model, contact) for contact in data.contact):
                assert relative(frame.qacc[world], data.qacc) < 1e-6, f"world {world}, {data.ncon} contacts"


@pytest.mark.parametrize("seed", range(TREES))
def test_single_precision_is_near(seed: int) -> None:
    with live(random_mjcf(seed, 1 + seed % 6, EVERYTHING), precision="f32", fields=("actuator_force",)) as case:
        states = case.states(seed)
        frame = case.place(states)
        for world, data in enumerate(case.data(states)):
            mujoco.mj_forward(case.model, data)
            assert relative(frame.qacc[world], data.qacc) < 1e-3


@pytest.mark.parametrize("seed", sweep(range(TREES), daily=2))
def test_a_gpu_and_lanes_step_as_one_world(seed: int) -> None:
    """Recorded programs on lavapipe and worlds in SIMD lanes, beside f64."""
    xml = random_mjcf(seed, 1 + seed % 6, EVERYTHING)
    found = {}
    for device, precision in (("cpu", "f64"), ("cpu", "f32"), ("gpu", "f32")):
        with live(xml, worlds=20, device=device, precision=precision, fields=("actuator_force",)) as case:
            frame = case.place(case.states(seed))
            found[device, precision] = [frame.qacc, frame.actuator_force, case.sim.step().qvel]
    for device in ("cpu", "gpu"):
        for name, single, double in zip(
            ("qacc", "actuator_force", "qvel"), found[device, "f32"], found["cpu", "f64"], strict=True
        ):
            if double.size:
                assert relative(single, double) < 1e-3, f"{name} on {device}"
