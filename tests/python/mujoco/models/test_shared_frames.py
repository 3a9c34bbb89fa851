"""Geoms and sites that MuJoCo places by a frame of their body."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from live_model import live

# Inertias turned as exported files have them: nearly as their geoms, and a little off
XML = """
<mujoco><worldbody>
  <body pos="0 0 1"><freejoint/><geom type="capsule" size=".035 .0555" pos="-.0001 -.0005 .082"
    quat=".6951 -.00714564 .00738544 .71884"/></body>
  <body pos="0 1 1"><joint axis="0 1 0"/><inertial pos=".1 .2 .3" mass="1" diaginertia=".3 .2 .1" quat=".8 .1 .2 .3"/>
    <geom type="box" size=".1 .2 .3" pos=".10000002 .2 .3" quat=".8 .1 .2 .30000003"/>
    <site name="near" pos="2e-8 0 0" quat="1 3e-8 0 0"/><geom type="sphere" size=".1" quat="1 0 2e-8 0"/></body>
  <body pos="0 2 1"><joint type="ball"/><inertial pos="1e-8 0 0" mass="1" diaginertia=".3 .2 .1" quat="1 0 2e-8 0"/>
    <geom type="capsule" size=".1 .2" pos=".3 0 0"/></body>
</worldbody></mujoco>
"""
FIELDS = ("geom_xpos", "geom_xmat", "site_xpos", "site_xmat", "xipos")


def test_elements_that_share_a_frame_have_mujocos_pose() -> None:
    """MuJoCo copies frames that are equal up to 1e-6 or so; the elements' own numbers would be 1e-8 off."""
    model = mujoco.MjModel.from_xml_string(XML)
    kinds = set(model.geom_sameframe) | set(model.site_sameframe)
    assert {int(mujoco.mjtSameFrame.mjSAMEFRAME_INERTIA), int(mujoco.mjtSameFrame.mjSAMEFRAME_BODY)} <= kinds
    with live(model, worlds=4, fields=FIELDS) as case:
        states = case.states(1, spread=1.0)
        frame = case.place(states)
        for world, data in enumerate(case.data(states)):
            mujoco.mj_forward(case.model, data)
            for field in FIELDS:
                given = np.reshape(getattr(frame, field)[world], getattr(data, field).shape)
                assert given == pytest.approx(getattr(data, field), abs=1e-13), field
