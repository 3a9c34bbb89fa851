"""The flag ``override``: contacts with the parameters of ``<option>``, beside MuJoCo."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from live_model import Live, live, relative

import tightloop as tl
from tightloop.errors import SceneError
from tightloop.mujoco import Batch

STEPS = 200
FIELDS = ("cfrc_ext", "contact_count")
#: Bodies of several kinds that slide, roll and lie on each other; parameters of geoms and pairs do not count.
XML = """<mujoco><option cone="{cone}" integrator="{integrator}" timestep=".002" o_margin="{margin}"
  o_solref="{solref}" o_solimp="{solimp}" o_friction="{friction}" {option}><flag override="enable"/></option>
<default><geom friction="2 .3 .1" solref=".05 2" solimp=".7 .8 .01 .3 4" margin=".03" gap="{gap}"/></default>
<worldbody>
  <geom name="floor" type="plane" size="9 9 1" euler="6 -4 20" condim="{condim}"/>
  <body name="ball" pos="0 0 .0995"><freejoint/><geom name="ball" size=".1" mass=".4" condim="1"/></body>
  <body name="log" pos="-1 0 .05" euler="85 30 0"><freejoint/>
    <geom type="capsule" size=".08 .15" mass=".5" priority="1" condim="{condim}"/></body>
  <body name="box" pos="1 .03 .1" euler="6 -4 10"><freejoint/>
    <geom name="box" type="box" size=".1 .07 .08" mass="1" solmix="3" condim="{condim}"/></body>
  <body name="top" pos="1 .03 .255"><freejoint/><geom name="top" size=".07" mass=".2"/></body>
  <body name="arm" pos="0 1 .3"><joint axis="1 0 0" range="-30 30" margin=".1" damping=".1"/>
    <geom type="capsule" size=".03" fromto="0 0 0 .1 .4 -.2" mass=".3"/></body>
</worldbody>
<contact>
  <pair geom1="floor" geom2="ball" condim="{condim}" friction=".1 .2 .3 .4 .5" margin=".1" gap="{gap}" solref=".1 3"
    solreffriction=".5 1"/>
  <pair geom1="top" geom2="box" condim="{condim}"/>
</contact></mujoco>"""


def model(
    *,
    cone: str = "elliptic",
    condim: int = 3,
    integrator: str = "Euler",
    margin: float = 0.004,
    gap: float = 0.0,
    solref: str = ".015 .9",
    solimp: str = ".85 .93 .004 .4 3",
    friction: str = ".3 .3 .02 .004 .004",
    option: str = "",
) -> str:
    return XML.format(**locals())


def compare(case: Live, tolerance: float) -> None:
    """Compare accelerations and forces on the way, then the motion."""
    states = case.states(3, spread=0.0, speed=0.3)
    frame, worlds = case.place(states), list(case.data(states))
    for step in range(STEPS):
        for world, data in enumerate(worlds if step % 20 == 0 else ()):
            mujoco.mj_forward(case.model, data)
            mujoco.mj_rnePostConstraint(case.model, data)
            assert frame.contact_count[world] == data.ncon
            assert relative(frame.qacc[world], data.qacc) < 100 * tolerance
            assert relative(frame.cfrc_ext[world].ravel(), data.cfrc_ext.ravel()) < 100 * tolerance
        frame = case.sim.step()
        for data in worlds:
            mujoco.mj_step(case.model, data)
    for world, data in enumerate(worlds):
        assert data.ncon >= 4
        assert relative(frame.qpos[world], data.qpos) < tolerance
        assert relative(frame.qvel[world], data.qvel) < 10 * tolerance


@pytest.mark.parametrize("condim", [1, 3, 4, 6])
@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
def test_contacts_take_the_parameters_of_the_option(cone, condim):
    with live(model(cone=cone, condim=condim), worlds=2, fields=FIELDS) as case:
        states = case.states(2, spread=0.0, speed=0.3)
        frame = case.place(states)
        for world, data in enumerate(case.data(states)):
            mujoco.mj_forward(case.model, data)
            assert relative(frame.qacc[world], data.qacc) < 1e-8
        compare(case, 1e-6)


@pytest.mark.parametrize(
    "parts",
    [
        {"margin": 0.0},
        {"gap": 0.01},
        {"solref": "-3000 -60"},
        {"solref": ".0001 1"},
        {"solimp": ".9 .9 .001 .5 2"},
        {"friction": "0 0 0 0 0", "condim": 6},
        {"friction": ".1 .6 .02 .004 .02", "condim": 6},
        {"friction": ".6 .1 .02 .004 .001", "condim": 6, "cone": "pyramidal"},
        {"friction": ".1 .6 .02 .004 .02", "condim": 3, "option": 'noslip_iterations="4"'},
    ],
)
def test_every_parameter_counts(parts):
    with live(model(**parts), worlds=2, fields=FIELDS) as case:
        compare(case, 1e-6)


@pytest.mark.parametrize("integrator", ["implicitfast", "implicit", "RK4"])
def test_integrators_take_it(integrator):
    with live(model(integrator=integrator), worlds=2, fields=FIELDS) as case:
        compare(case, 1e-6)


def test_single_precision_is_near():
    with live(model(condim=4), worlds=8, precision="f32") as case:
        states = case.states(3, spread=0.0, speed=0.3)
        frame = case.place(states)
        for world, data in enumerate(case.data(states)):
            mujoco.mj_forward(case.model, data)
            assert relative(frame.qacc[world], data.qacc) < 1e-2


def test_parameters_of_geoms_and_pairs_do_not_count_where_they_vary():
    robot = mujoco.MjModel.from_xml_string(model(condim=6))
    with Batch(robot, 3, precision="f64") as batch, Batch(robot, 3, precision="f64") as plain:
        scale = np.array([0.3, 1.0, 2.0])[:, None, None]
        for name in ("geom_friction", "pair_friction", "geom_solref"):
            batch.expand(name)[:] *= scale
        found, expected = batch.bind("qpos"), plain.bind("qpos")
        batch.step(nstep=50)
        plain.step(nstep=50)
        np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize(
    ("parts", "reason"),
    [
        ({"margin": -0.01}, "option `o_margin`: no support for a negative margin"),
        ({"solimp": ".9 .95 .001 .5 40"}, "option `o_solimp`: no support for a solimp with the power 40"),
    ],
)
def test_what_is_refused_has_a_name(parts, reason):
    with pytest.raises(SceneError, match=reason):
        tl.Scene.from_mujoco(mujoco.MjModel.from_xml_string(model(**parts)))


def test_a_flag_that_is_supported_is_no_name_of_without():
    with pytest.raises(SceneError, match="mjENBL_OVERRIDE is supported"):
        tl.Scene.from_mujoco(mujoco.MjModel.from_xml_string(model()), without=("mjENBL_OVERRIDE",))
