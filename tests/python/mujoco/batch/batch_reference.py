"""A batch beside MuJoCo's own data of each simulation, with the same writes and calls."""

from __future__ import annotations

import copy
from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from tightloop.mujoco import Batch

Array = NDArray[np.float64]

mujoco.set_mju_user_warning(lambda _: None)

#: A cart with a pole, whose limit and dry friction act, and a free body whose centre is not at its origin.
XML = """
<mujoco>
  <option timestep="0.004" integrator="implicitfast" iterations="100" tolerance="0"/>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 .1" contype="{contacts}" conaffinity="{contacts}"/>
    <body name="cart" pos="0 0 1">
      <joint name="slide" type="slide" axis="1 0 0" range="-.3 .3" damping=".2" frictionloss=".1"/>
      <geom name="box" type="box" size=".1 .05 .05" mass="1" contype="0" conaffinity="0"/>
      <site name="base" pos="0 .1 0"/>
      <body name="pole">
        <joint name="hinge" type="hinge" axis="0 1 0" armature=".01" damping=".02"/>
        <geom name="rod" type="capsule" size=".02" fromto="0 0 0 .1 0 .6" mass=".1" contype="0" conaffinity="0"/>
        <site name="tip" pos="0 0 .6" euler="30 0 20"/>
        <body name="arm" pos="0 0 .6" euler="20 10 0">
          <joint name="ball" type="ball" damping=".01"/>
          <geom name="end" type="box" size=".05 .02 .03" pos=".05 0 0" mass=".2" contype="0" conaffinity="0"/>
        </body>
      </body>
    </body>
    <body name="stone" pos="1 0 .3">
      <freejoint name="free"/>
      <geom name="stone" type="sphere" size=".1" pos=".03 0 0" mass=".5" contype="{contacts}" conaffinity="{contacts}"/>
      <geom name="weight" type="sphere" size=".02" pos="0 .1 0" mass=".2" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
  <actuator>
    <motor name="push" joint="slide" gear="5" ctrlrange="-1 1"/>
    <position name="turn" joint="hinge" kp="2" kv=".1"/>
  </actuator>
  <keyframe>
    <key name="home" qpos=".1 .2 1 0 0 0 2 0 1 1 0 0 0" qvel=".1 .2 .3 .1 .2 1 2 3 .1 .2 .3" ctrl=".1 .2" time="1.5"/>
  </keyframe>
</mujoco>
"""
N = 6
FIELDS = (
    *("xpos", "xquat", "xmat", "xipos", "ximat", "geom_xpos", "geom_xmat", "site_xpos", "site_xmat"),
    *("subtree_com", "cvel", "qacc", "actuator_force"),
)
STATE = ("qpos", "qvel", "ctrl", "time", "qfrc_applied", "xfrc_applied")


def model_of(*, contacts: bool = False) -> mujoco.MjModel:
    """The model, with or without contacts of the stone with the floor."""
    return mujoco.MjModel.from_xml_string(XML.format(contacts=int(contacts)))


def separate(model: mujoco.MjModel) -> list[mujoco.MjModel]:
    """A model of its own for each simulation."""
    return [copy.copy(model) for _ in range(N)]


def positions(model: mujoco.MjModel, seed: int) -> Array:
    """Random positions around the start."""
    qpos, rng = np.tile(model.qpos0, (N, 1)), np.random.default_rng(seed)
    for row in qpos:
        mujoco.mj_integratePos(model, row, rng.normal(0, 0.3, model.nv), 1.0)
    return qpos


def difference(found: Array, expected: Sequence[Array] | Array) -> float:
    """Largest difference over the largest value, or over 1."""
    expected = np.asarray(expected)
    return float(np.abs(found - expected).max(initial=0.0) / max(1.0, np.abs(expected).max(initial=0.0)))


class Lockstep:
    """Writes into a batch and into MuJoCo's data alike, and calls both."""

    def __init__(self, batch: Batch, models: list[mujoco.MjModel], *, forward: bool = False) -> None:
        self.batch, self.models, self.forward = batch, models, forward
        self.data = [mujoco.MjData(model) for model in models]

    def write(self, field: str, values: Array) -> None:
        """Set a field of all simulations."""
        self.batch.bind(field)[:] = values
        for data, value in zip(self.data, values, strict=True):
            getattr(data, field)[:] = value

    def step(self, ids: Sequence[int] | None = None, nstep: int = 1) -> None:
        """Step simulations."""
        self.batch.step(None if ids is None else np.array(ids), nstep=nstep)
        for sim in range(N) if ids is None else ids:
            for _ in range(nstep):
                mujoco.mj_step(self.models[sim], self.data[sim])
            if self.forward:
                mujoco.mj_forward(self.models[sim], self.data[sim])

    def assert_equal(self, fields: Sequence[str], tolerance: float, ids: Sequence[int] = range(N)) -> None:
        """Compare fields of simulations."""
        for field in fields:
            expected = [getattr(self.data[sim], field) for sim in ids]
            error = difference(self.batch.bind(field)[list(ids)], expected)
            assert error < tolerance, f"{field} differs by {error:.1e}"
