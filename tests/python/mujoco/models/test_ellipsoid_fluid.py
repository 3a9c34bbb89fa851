"""Geoms that count as ellipsoids in a medium: forces, steps and runs are MuJoCo's."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from live_model import live, relative

import tightloop as tl

WORLDS = 16
INTEGRATORS = ("Euler", "implicit", "implicitfast", "RK4")
#: A chain, a ball, a free body that carries another, and one that carries none; `box` and `plate` count as boxes.
XML = """<mujoco><option integrator="{integrator}" timestep=".002" density="{density}" viscosity="{viscosity}"
  wind="{wind}"/>
<default><geom contype="0" conaffinity="0" fluidshape="ellipsoid" fluidcoef=".7 .4 1.2 1.3 .8"/></default>
<asset><mesh name="wedge" vertex="-.2 -.1 0 .2 -.1 0 .1 .3 0 0 0 .25"/></asset>
<worldbody>
  <geom type="box" size=".2 .2 .2"/>
  <body name="upper" pos="0 0 1"><joint axis="0 1 0"/><geom type="capsule" size=".05" fromto="0 0 0 .3 .1 0"/>
    <geom type="ellipsoid" size=".1 .05 .2" pos=".1 .2 0" euler="20 30 40"/>
    <geom type="box" size=".1 .1 .1" fluidshape="none"/>
    <body name="lower" pos=".3 0 0"><joint axis="0 1 .3"/><joint type="slide" axis="1 0 .2"/>
      <geom type="cylinder" size=".08 .15" euler="0 50 10"/>
      <body pos="0 .2 .1"><geom type="box" size=".1 .02 .15"/></body></body>
    <body name="box" pos="-.3 0 0"><joint type="ball"/>
      <geom type="box" size=".1 .2 .1" fluidshape="none"/></body></body>
  <body name="swing" pos="-.5 0 1"><joint type="ball" damping=".1"/>
    <geom type="mesh" mesh="wedge" pos=".1 0 0"/></body>
  <body name="carrier" pos="0 1 1"><freejoint/><geom size=".15" pos=".02 .03 .04"/>
    <geom type="ellipsoid" size=".05 .1 .2" fluidcoef="0 .3 .5 0 1"/>
    <body name="wing" pos=".2 0 0"><joint axis="1 0 1"/><geom type="box" size=".2 .01 .1" pos=".2 0 .05"/></body></body>
  <body name="loose" pos="1 1 1"><freejoint/>
    <geom type="ellipsoid" size=".1 .25 .04" pos=".02 .01 0" euler="30 0 9"/>
    <geom type="capsule" size=".03 .1" pos="0 .3 0"/><body pos="-.1 0 .1"><geom size=".06"/></body></body>
  <body name="plate" pos="1 0 1"><freejoint/><geom type="box" size=".2 .1 .01" fluidshape="none"/></body>
</worldbody></mujoco>"""
MEDIA = {
    "water and wind": {"density": 900, "viscosity": 0.7, "wind": ".3 -.5 .2"},
    "density": {"density": 1000, "viscosity": 0, "wind": "0 0 0"},
    "viscosity": {"density": 0, "viscosity": 2, "wind": ".1 0 .4"},
}


def model_in(medium: str, integrator: str) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(XML.format(integrator=integrator, **MEDIA[medium]))


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("medium", MEDIA)
def test_forces_and_steps_are_mujocos(medium: str, integrator: str) -> None:
    with live(model_in(medium, integrator), worlds=WORLDS, fields=("qfrc_passive",)) as case:
        states = case.states(3, spread=0.5, speed=2.0)
        # one world is at rest, and one all but
        states.qvel[0], states.qvel[1] = 0.0, 1e-5 * states.qvel[1]
        frame = case.place(states)
        moved = case.sim.step()
        for world, data in enumerate(case.data(states)):
            mujoco.mj_forward(case.model, data)
            assert relative(frame.qfrc_passive[world], data.qfrc_passive) < 1e-8
            assert relative(frame.qacc[world], data.qacc) < 1e-8
            mujoco.mj_step(case.model, data)
            assert relative(moved.qvel[world], data.qvel) < 1e-8
            assert relative(moved.qpos[world], data.qpos) < 1e-8


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize(("precision", "tolerance"), [("f64", 1e-6), ("f32", 1e-3)])
def test_runs_are_mujocos(precision: str, tolerance: float, integrator: str) -> None:
    with live(model_in("water and wind", integrator), worlds=WORLDS, precision=precision) as case:
        states = case.states(5, spread=0.5, speed=0.5)
        case.place(states)
        references = list(case.data(states))
        for _ in range(200):
            frame = case.sim.step()
            for data in references:
                mujoco.mj_step(case.model, data)
        for world, data in enumerate(references):
            assert relative(frame.qpos[world], data.qpos) < tolerance


def test_a_body_needs_one_geom_that_interacts() -> None:
    """Shares beyond 0 and 1: MuJoCo takes all of a body's geoms once one has a positive share, else the body's box."""
    model = model_in("water and wind", "implicitfast")
    geoms = {model.body(int(body)).name: geom for geom, body in enumerate(model.geom_bodyid)}
    model.geom_fluid[geoms["upper"] - 1, 0] = -0.3
    model.geom_fluid[geoms["swing"], 0] = -0.5
    model.geom_fluid[geoms["wing"], 0] = 1e-3
    with live(model, worlds=WORLDS, fields=("qfrc_passive",)) as case:
        states = case.states(7, speed=2.0)
        frame = case.place(states)
        for world, data in enumerate(case.data(states)):
            mujoco.mj_forward(case.model, data)
            assert relative(frame.qfrc_passive[world], data.qfrc_passive) < 1e-8


def test_no_medium_acts_without_passive_forces() -> None:
    model = model_in("water and wind", "Euler")
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_SPRING | mujoco.mjtDisableBit.mjDSBL_DAMPER
    with live(model, worlds=WORLDS, fields=("qfrc_passive",)) as case:
        frame = case.place(case.states(1))
        np.testing.assert_array_equal(frame.qfrc_passive, 0.0)


def test_masses_of_ellipsoids_vary() -> None:
    """Their forces follow from the shapes alone, unlike those of a box that has the body's mass."""
    xml = XML.format(integrator="Euler", **MEDIA["density"]).replace('fluidshape="none"', "")
    with live(xml, worlds=4, fields=("qfrc_passive",), params=("body_mass",)) as case:
        states = case.states(5, speed=2.0)
        mass = case.sim.params.body_mass.copy()
        case.sim.params.write(body_mass=mass * np.array([0.5, 1.0, 2.0, 3.0])[:, None])
        frame, moved = case.place(states), case.sim.step()
        for world, data in enumerate(case.data(states)):
            mujoco.mj_forward(case.model, data)
            assert relative(frame.qfrc_passive[world], data.qfrc_passive) < 1e-8
            assert (np.abs(moved.qvel[world] - data.qvel) > 0).any()
    with pytest.raises(tl.SceneError, match="body_mass cannot vary: density and viscosity"):
        tl.launch(tl.Scene.from_mujoco(model_in("density", "Euler")), worlds=1, params=("body_mass",))
