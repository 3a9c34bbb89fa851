"""Fields of contacts and centres of mass that differ between simulations, against a MuJoCo model of each."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from batch_reference import Lockstep, N, difference, separate

from tightloop.errors import LaunchError
from tightloop.mujoco import Batch

XML = """
<mujoco>
  <option timestep="0.004" cone="{cone}" integrator="implicitfast" tolerance="0" iterations="60" ls_iterations="60"/>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 .1" friction=".7 .02 .003" condim="{condim}"/>
    <body name="slides" pos="0 0 .099">
      <freejoint/>
      <geom name="low" type="sphere" size=".1" mass="1" friction=".4 .03 .002" condim="{condim}"/>
      <geom type="sphere" size=".02" pos=".03 .02 0" mass=".2" contype="0" conaffinity="0"/>
    </body>
    <body name="rules" pos="1 0 .099">
      <freejoint/>
      <geom name="high" type="sphere" size=".1" mass="2" priority="1" friction=".3 .01 .004" condim="{condim}"/>
      <geom type="sphere" size=".02" pos=".03 .02 0" mass=".2" contype="0" conaffinity="0"/>
    </body>
    <body name="paired" pos="2 0 .099">
      <freejoint/>
      <geom name="own" type="capsule" size=".1 .1" euler="90 0 0" mass="1" friction=".9 .01 .001"/>
      <geom type="sphere" size=".02" pos=".03 .02 0" mass=".2" contype="0" conaffinity="0"/>
    </body>
    <body name="arm" pos="0 2 1">
      <joint name="a" axis="0 1 0" range="-20 20"/>
      <inertial pos=".1 .02 -.1" mass="1" diaginertia=".01 .02 .015"/>
      <body name="hand" pos="0 0 -.3">
        <joint name="b" axis="1 0 0" range="-10 10" damping=".02"/>
        <geom type="box" size=".05 .03 .1" mass=".5" pos=".01 0 -.1" contype="0" conaffinity="0"/>
      </body>
    </body>
  </worldbody>
  <contact>
    <pair geom1="own" geom2="floor" condim="{condim}" friction=".5 .5 .02 .002 .002"/>
  </contact>
  <sensor>
    <framepos objtype="xbody" objname="hand"/>
    <subtreecom body="arm"/>
    <subtreeangmom body="arm"/>
  </sensor>
</mujoco>
"""
FIELDS = ("xipos", "subtree_com", "cvel", "qacc", "sensordata", "cfrc_int")


def model_of(condim: int, cone: str) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(XML.format(condim=condim, cone=cone))


def start(batch: Batch, lockstep: Lockstep) -> None:
    """Let the bodies slide, spin and roll, and the arm swing into its limits."""
    velocities = np.zeros((N, batch.model.nv))
    for body in range(3):
        velocities[:, 6 * body : 6 * body + 6] = (0.6, 0.2, 0.0, 1.0, -3.0, 4.0)
    velocities[:, 18:] = (2.0, -3.0)
    lockstep.write("qvel", velocities)


@pytest.mark.parametrize("condim", [1, 3, 4, 6])
@pytest.mark.parametrize("cone", ["pyramidal", "elliptic"])
def test_friction_follows_priorities_and_pairs(condim: int, cone: str) -> None:
    model = model_of(condim, cone)
    models = separate(model)
    with Batch(model, N, 1, precision="f64") as batch:
        friction = batch.expand("geom_friction")
        rng = np.random.default_rng(condim)
        for sim, own in enumerate(models):
            # each of the three by a factor of its own
            own.geom_friction *= rng.uniform(0.3, 3.0, own.geom_friction.shape)
            friction[sim] = own.geom_friction
        lockstep = Lockstep(batch, models)
        start(batch, lockstep)
        lockstep.step(nstep=40)
        lockstep.assert_equal(("qpos", "qvel"), 1e-7)
        moved = batch.bind("qvel")
        # the pair's own friction does not vary
        assert np.ptp(moved[:, 12:18], axis=0).max() < 1e-9
        assert condim == 1 or np.ptp(moved[:, :12], axis=0).max() > 0.01


@pytest.mark.parametrize("recomputes", [False, True])
def test_centres_of_mass_act_with_the_softness_that_derives_from_them(recomputes: bool) -> None:
    model = model_of(3, "elliptic")
    models = separate(model)
    with Batch(model, N, 1, precision="f64") as batch:
        centers = batch.expand("body_ipos")
        # without mj_setConst MuJoCo keeps some of the masses that it compiled
        masses = batch.expand("body_mass") if recomputes else None
        rng = np.random.default_rng(1)
        for sim, own in enumerate(models):
            own.body_ipos[1:] += rng.uniform(-0.02, 0.02, (own.nbody - 1, 3))
            if masses is not None:
                own.body_mass[1:] *= rng.uniform(0.5, 2.0, own.nbody - 1)
                masses[sim] = own.body_mass
            # MuJoCo keeps a flag per body, which a moved centre makes wrong
            own.body_sameframe[:] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
            assert not own.body_simple[1:].any()
            centers[sim] = own.body_ipos
            if recomputes:
                mujoco.mj_setConst(own, mujoco.MjData(own))
        if recomputes:
            batch.set_const()
            np.testing.assert_allclose(batch.expand("body_invweight0")[-1], models[-1].body_invweight0)
        lockstep = Lockstep(batch, models)
        start(batch, lockstep)
        lockstep.step(nstep=30)
        lockstep.assert_equal(("qpos", "qvel"), 1e-6)
        arrays = {name: batch.bind(name) for name in FIELDS}
        batch.forward()
        for own, data in zip(models, lockstep.data, strict=True):
            mujoco.mj_forward(own, data)
            mujoco.mj_rnePostConstraint(own, data)
        for name, array in arrays.items():
            error = difference(array, [getattr(data, name) for data in lockstep.data])
            assert error < 1e-5, f"{name} differs by {error:.1e}"
        assert np.ptp(arrays["xipos"] - batch.bind("xpos"), axis=0).max() > 0.01


def test_a_sensor_at_a_centre_of_mass_that_varies_is_refused() -> None:
    model = mujoco.MjModel.from_xml_string(XML.format(condim=3, cone="elliptic").replace('"xbody"', '"body"'))
    with Batch(model, N, 1) as batch:
        batch.bind("sensordata")
        batch.step()
        batch.expand("body_ipos")
        with pytest.raises(LaunchError, match="body_com varies; use objtype xbody or a site"):
            batch.step()
