"""Velocities that sensors of contacts show, of geoms that touch and of such that are near."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from live_model import Live, live
from random_sensors import heap

import tightloop as tl

# MuJoCo shows them since 3.17
pytestmark = pytest.mark.skipif(
    not hasattr(mujoco.mjtConDataField, "mjCONDATA_LINVEL"), reason="this MuJoCo shows no velocities of contacts"
)

PAIRS = ('body1="b0"', 'subtree1="b1" body2="b2"', 'body1="b2" subtree2="b1"', 'site="s0"', 'subtree2="b3"', "")
DATA = (
    'data="found force linvel angvel" num="1" reduce="maxforce"',
    'data="dist normal linvel" num="3" reduce="mindist"',
    'data="angvel" num="2" reduce="mindist" cutoff="0.1"',
)


def text(seed: int, cone: str) -> str:
    """A heap of bodies with sensors of contacts that show velocities; a cutoff does nothing, as in MuJoCo."""
    sensors = "".join(f"<contact {pair} {data}/>" for pair in PAIRS for data in DATA)
    bodies = heap(seed, f'cone="{cone}"').replace('<site name="s0"', '<site name="s0" type="box" size=".3 .3 .3"')
    return bodies.replace("</mujoco>", f"<sensor>{sensors}</sensor></mujoco>")


def worst(case: Live, seed: int) -> float:
    """Largest difference to MuJoCo, over the largest value of its column."""
    states = case.states(seed, speed=1.0)
    values = np.array(case.place(states).sensordata)
    expected = np.zeros(values.shape)
    for world, data in enumerate(case.data(states)):
        mujoco.mj_forward(case.model, data)
        expected[world] = data.sensordata
    for sensor in np.flatnonzero(case.model.sensor_intprm[:, 1] == 2):
        # contacts without force are all the largest
        first, end = case.model.sensor_adr[sensor] + np.array([4, case.model.sensor_dim[sensor]])
        idle = ~expected[:, first - 3 : first].any(axis=1)
        values[idle, first:end] = expected[idle, first:end]
    assert np.abs(expected).max() > 1
    return float((np.abs(values - expected) / np.maximum(1.0, np.abs(expected).max(axis=0))).max())


@pytest.mark.parametrize("cone", ["pyramidal", "elliptic"])
@pytest.mark.parametrize("seed", range(4))
def test_velocities_of_contacts_are_mujocos(seed: int, cone: str) -> None:
    with live(text(seed, cone), worlds=8, fields=("sensordata",)) as case:
        assert worst(case, seed) < 1e-6


@pytest.mark.parametrize("device", ["cpu", "gpu"])
def test_velocities_of_contacts_in_single_precision_are_near(device: str) -> None:
    xml = """<mujoco><worldbody><geom name="floor" type="plane" size="5 5 .1"/>
      <body pos="0 0 .09"><freejoint/><geom name="a" size=".1"/></body>
      <body name="b" pos=".15 0 .12"><freejoint/><geom name="b" type="capsule" size=".08 .1"/></body></worldbody>
      <sensor><contact geom1="a" geom2="b" data="found linvel angvel"/>
      <contact geom1="b" geom2="a" data="dist linvel angvel"/>
      <contact geom1="a" geom2="floor" data="linvel angvel"/></sensor></mujoco>"""
    with live(xml, worlds=20, fields=("sensordata",), precision="f32", device=device) as case:
        states = case.states(3, spread=0.02, speed=1.0)
        values = case.place(states).sensordata
        for world, data in enumerate(case.data(states)):
            mujoco.mj_forward(case.model, data)
            np.testing.assert_allclose(values[world], data.sensordata, atol=1e-4)


def test_velocities_of_contacts_with_another_robot_are_from_that_robot() -> None:
    def one(sensor: str) -> mujoco.MjModel:
        xml = """<mujoco><worldbody><body name="b" pos="0 0 1"><joint type="slide" axis="1 0 0"/><geom size=".1"/>
        </body></worldbody>{}</mujoco>"""
        return mujoco.MjModel.from_xml_string(xml.format(sensor))

    scene = tl.Scene.from_mujoco(one('<sensor><contact body1="b" data="found linvel"/></sensor>'), name="first")
    scene.add_mujoco(one(""), name="second", pos=(0, 0, 0.15))
    with tl.launch(scene, worlds=1, fields=("sensordata",)) as sim:
        shown = sim.write(joint_qd=np.array([[0.3, -0.5]])).sensordata[0]
    # the normal is z: the other body moves by -0.8 along x
    assert shown[0] == 1
    np.testing.assert_allclose(np.linalg.norm(shown[1:]), 0.8, atol=1e-12)
    np.testing.assert_allclose(shown[1], 0, atol=1e-12)
