"""``launch(outputs_at="last_substep")``: fields that lag as MuJoCo's data does after ``mj_step``."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from live_model import live
from random_mjcf import CONSTRAINED, random_mjcf

import tightloop as tl
from tightloop.errors import ArgumentError

PLACES = tuple("xpos xquat xipos site_xpos geom_xpos subtree_com cvel cinert".split())
FORCES = ("qacc", "actuator_force", "qfrc_actuator", "qfrc_constraint", "qfrc_bias", "qfrc_passive", "cfrc_ext")
LAGGING = (*PLACES, *FORCES)
TOUCHING = replace(CONSTRAINED, geoms=True, equalities=False, connections=False, friction=False)
STATE = ("qpos", "qvel", "joint_q", "joint_qd", "time")


def xml(seed: int, integrator: str) -> str:
    option = f'integrator="{integrator}" timestep="0.002"'
    return random_mjcf(seed, 2 + seed % 4, replace(TOUCHING, option=option))


@pytest.mark.parametrize("substeps", [1, 3])
@pytest.mark.parametrize("integrator", ["Euler", "implicit", "implicitfast", "RK4"])
@pytest.mark.parametrize("seed", range(4))
def test_fields_after_a_step_are_mujocos(seed: int, integrator: str, substeps: int) -> None:
    with live(xml(seed, integrator), fields=LAGGING, substeps=substeps, outputs_at="last_substep") as case:
        assert case.sim.info["outputs_at"] == "last_substep"
        states = case.states(seed)
        case.place(states)
        frame = case.sim.step(ctrl=states.ctrl)
        for world, data in enumerate(case.data(states)):
            mujoco.mj_step(case.model, data, substeps)
            mujoco.mj_rnePostConstraint(case.model, data)
            for name in ("qpos", "qvel", *LAGGING):
                expected, found = getattr(data, name), getattr(frame, name)[world]
                error = np.abs(found - expected).max(initial=0.0) / max(1.0, np.abs(expected).max(initial=0.0))
                assert error < 1e-7, f"{name}: {error}"


@pytest.mark.parametrize("precision", ["f32", "f64"])
@pytest.mark.parametrize("integrator", ["Euler", "RK4"])
def test_the_motion_has_the_same_bits(integrator: str, precision: str) -> None:
    runs = []
    for outputs_at in ("frame", "last_substep"):
        options = {"fields": LAGGING, "substeps": 2, "precision": precision, "worlds": 20}
        with live(xml(3, integrator), outputs_at=outputs_at, **options) as case:
            states = case.states(3)
            case.place(states)
            frames = [case.sim.step(ctrl=states.ctrl * scale) for scale in (1.0, -1.0, 0.5)]
            runs.append({name: [getattr(frame, name).copy() for frame in frames] for name in (*STATE, "xpos")})
    for name in STATE:
        np.testing.assert_array_equal(runs[0][name], runs[1][name])
    assert not np.array_equal(runs[0]["xpos"], runs[1]["xpos"])


def test_other_frames_show_their_state() -> None:
    with live(xml(1, "RK4"), fields=LAGGING, outputs_at="last_substep") as case:
        states = case.states(1)
        case.sim.step(ctrl=states.ctrl)
        frame = case.place(states)
        for world, data in enumerate(case.data(states)):
            mujoco.mj_forward(case.model, data)
            np.testing.assert_allclose(frame.xpos[world], data.xpos, atol=1e-9)
            np.testing.assert_allclose(frame.qfrc_actuator[world], data.qfrc_actuator, atol=1e-8)


def test_what_cannot_lag_is_refused() -> None:
    scene = tl.Scene.from_mujoco(mujoco.MjModel.from_xml_string(xml(1, "Euler")))
    with pytest.raises(ArgumentError, match=r"outputs-at.*use frame or last_substep"):
        tl.launch(scene, worlds=1, outputs_at="first_substep")
    with pytest.raises(ArgumentError, match="a GPU evaluates outputs at the state in the frame"):
        tl.launch(scene, worlds=1, device="gpu", outputs_at="last_substep")
    scene = tl.Scene.from_mujoco(mujoco.MjModel.from_xml_string(xml(1, "RK4")))
    with pytest.raises(ArgumentError, match="`sensordata` of a Runge-Kutta step"):
        tl.launch(scene, worlds=1, fields=("sensordata",), outputs_at="last_substep")
