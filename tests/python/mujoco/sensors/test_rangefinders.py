"""Rangefinders that see meshes and height fields, and all that they show of a ray."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from live_model import Live, live

import tightloop as tl

DATA = ("dist", "dist dir origin point normal depth", "point normal", "dir depth", "dist normal")
# seen, and touched by nothing
SEEN = 'contype="0" conaffinity="0"'


def ring(around: int = 30, across: int = 12) -> str:
    """A mesh that is not convex: a bent ring, with two triangles per piece."""
    corners, faces = [], []
    for i in range(around):
        for j in range(across):
            turn, roll = 2 * np.pi * i / around, 2 * np.pi * j / across
            radius = 0.3 + 0.1 * np.cos(roll)
            height = 0.1 * np.sin(roll) + 0.05 * np.sin(3 * turn)
            corners += [radius * np.cos(turn), radius * np.sin(turn), height]
            near, next_ = i * across, (i + 1) % around * across
            p, q, s, t = near + j, near + (j + 1) % across, next_ + j, next_ + (j + 1) % across
            faces += [p, s, t, p, t, q]
    vertex, face = " ".join(f"{x:.6f}" for x in corners), " ".join(map(str, faces))
    return f'<mesh name="ring" vertex="{vertex}" face="{face}"/>'


def scene(sites: int = 10) -> str:
    """Bodies with geoms of all kinds, and one with rangefinders."""
    rng = np.random.default_rng(3)

    def numbers(values: np.ndarray) -> str:
        return " ".join(f"{x:.5f}" for x in values)

    places = "".join(
        f'<site name="s{k}" pos="{numbers(rng.uniform(-0.3, 0.3, 3))}" quat="{numbers(rng.normal(size=4))}"/>'
        for k in range(sites)
    )
    sensors = "".join(
        f'<rangefinder site="s{k}" data="{DATA[k % 5]}" {"cutoff=" + repr("0.4") if k % 4 == 3 else ""}/>'
        for k in range(sites)
    )
    bodies = {
        "-.5 0 0": '<geom type="mesh" mesh="ring" {0}/><geom type="mesh" mesh="cone" pos=".2 0 .1" {0}/>',
        "0 .6 .2": '<geom type="box" size=".1 .2 .15" {0}/><geom type="cylinder" size=".1 .2" pos=".3 0 0" {0}/>',
        "0 -.6 .2": '<geom type="capsule" size=".1 .2" {0}/><geom type="ellipsoid" size=".1 .2 .3" pos=".3 0 .1" {0}/>'
        '<geom size=".1" pos="0 .3 .1" rgba="1 1 1 0" {0}/><geom size=".1" pos="0 .3 .3" {0}/>',
        "0 0 .3": '<geom size=".02" {0}/>' + places,
    }
    moving = "".join(f'<body pos="{pos}"><freejoint/>{geoms.format(SEEN)}</body>' for pos, geoms in bodies.items())
    return f"""<mujoco><asset>{ring()}
      <mesh name="cone" vertex="0 0 0 1 0 0 0 1 0 0 0 1 .1 .1 .1" face="0 2 4 2 3 4 0 4 3 0 1 2 0 3 1"/>
      <hfield name="h" nrow="7" ncol="6" size="1.5 1.2 .4 .2" elevation="{numbers(rng.uniform(0, 1, 42))}"/></asset>
    <worldbody><geom type="hfield" hfield="h" pos="0 0 -1" euler="5 10 20" {SEEN}/>
      <geom type="plane" size="4 4 .1" pos="0 0 -2" {SEEN}/>
      <geom type="mesh" mesh="ring" pos=".6 0 .2" {SEEN}/>{moving}</worldbody>
    <sensor>{sensors}</sensor></mujoco>"""


def differences(case: Live, seed: int) -> np.ndarray:
    """Differences to MuJoCo, `(worlds, sensordata)`."""
    states = case.states(seed)
    values = np.array(case.place(states).sensordata, dtype=float)
    expected = np.zeros(values.shape)
    for world, data in enumerate(case.data(states)):
        mujoco.mj_forward(case.model, data)
        expected[world] = data.sensordata
    # some rays meet nothing, others something
    shows_distance = case.model.sensor_intprm[:, 0] & 1 == 1
    far = expected[:, case.model.sensor_adr[shows_distance]]
    assert 0.2 < (far > 0).mean() < 0.9
    return np.abs(values - expected)


def test_rangefinders_show_mujocos_rays() -> None:
    with live(scene(), worlds=128, fields=("sensordata",)) as case:
        assert differences(case, 1).max() < 1e-10


@pytest.mark.parametrize("device", ["cpu", "gpu"])
def test_rangefinders_in_single_precision_are_near(device: str) -> None:
    with live(scene(5), worlds=20, fields=("sensordata",), precision="f32", device=device) as case:
        error = differences(case, 2)
        # a ray may pass an edge on the other side, or a side almost along it
        assert (error > 1e-3).mean() < 0.02


def test_a_mesh_of_another_model_is_not_seen() -> None:
    """As sensors of MuJoCo are of their model alone."""
    eye = """<mujoco><worldbody><body name="b"><freejoint/><geom size=".1"/><site name="s"/></body></worldbody>
    <sensor><rangefinder site="s" data="dist normal"/></sensor></mujoco>"""
    wall = """<mujoco><asset><mesh name="m" vertex="-1 -1 0 1 -1 0 0 1 0 0 0 1"/></asset>
    <worldbody>{}<geom type="mesh" mesh="m" contype="0" conaffinity="0"/></worldbody>{}</mujoco>"""
    model = wall.format(
        '<body name="b" pos="0 0 -3"><joint type="slide"/><geom size=".1"/><site name="s"/></body>',
        '<sensor><rangefinder site="s" data="dist normal"/></sensor>',
    )
    both = tl.Scene.from_mujoco(mujoco.MjModel.from_xml_string(eye), name="first")
    both.add_mujoco(mujoco.MjModel.from_xml_string(model), name="second", pos=(0, 0, 5))
    with tl.launch(both, worlds=1, fields=("sensordata",)) as sim:
        shown = sim.forward().sensordata[0]
        np.testing.assert_allclose(shown[sim.sensors["first/sensor0"]], [-1, 0, 0, 0])
        far, *normal = shown[sim.sensors["second/sensor0"]]
    # to the bottom of the tetrahedron, at height 0 of its model
    np.testing.assert_allclose(far, 3, atol=1e-9)
    np.testing.assert_allclose(normal, [0, 0, -1], atol=1e-7)


def test_rangefinders_of_cameras_are_refused_by_name() -> None:
    xml = """<mujoco><worldbody><body><freejoint/><geom size=".1"/><camera name="c" resolution="2 2"/></body>
    </worldbody><sensor><rangefinder name="r" camera="c"/></sensor></mujoco>"""
    scene_of_camera = tl.Scene.from_mujoco(mujoco.MjModel.from_xml_string(xml), name="m")
    with pytest.raises(tl.TightloopError, match="sensor `r`: no support for rangefinders of cameras"):
        tl.launch(scene_of_camera, worlds=1, fields=("sensordata",))
