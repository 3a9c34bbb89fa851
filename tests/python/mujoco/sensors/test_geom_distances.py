"""Sensors of how geoms are apart: planes, spheres and capsules, and bodies with several of them."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from live_model import Live, live

import tightloop as tl

# seen, and touched by nothing
SEEN = 'contype="0" conaffinity="0"'
KINDS = {"sphere": 'size=".2"', "capsule": 'type="capsule" size=".1 .2"'}
PAIRS = (
    *((f"a{one}", f"b{other}") for one in KINDS for other in KINDS),
    *(("floor", "acapsule"), ("asphere", "floor"), ("floor", "asphere"), ("acapsule", "wall")),
)


def scene(cutoffs: tuple[str, ...] = ("", 'cutoff=".4"', 'cutoff="5"')) -> str:
    """Free bodies with a geom or several, two planes, and sensors of pairs of them."""
    geoms = "".join(
        f'<body name="{name}{kind}"><freejoint/><geom name="{name}{kind}" {size} {SEEN}/></body>'
        for name in "ab"
        for kind, size in KINDS.items()
    )
    bodies = "".join(
        f'<body name="{name}"><freejoint/><geom size=".1" {SEEN}/>'
        f'<geom type="capsule" size=".05 .1" pos=".1 .2 0" {SEEN}/>'
        f'<geom size=".08" pos="-.1 0 .2" {SEEN} rgba="1 1 1 0"/></body>'
        for name in ("hand", "foot")
    )
    sensors = ""
    for cutoff in cutoffs:
        for kind in ("distance", "normal", "fromto"):
            sensors += "".join(f'<{kind} geom1="{one}" geom2="{other}" {cutoff}/>' for one, other in PAIRS)
            sensors += f'<{kind} body1="hand" body2="foot" {cutoff}/><{kind} geom1="floor" body2="hand" {cutoff}/>'
    return f"""<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1" euler="10 20 30" pos=".1 .2 .1" {SEEN}/>
      <geom name="wall" type="plane" size="0 0 1" euler="0 90 0" {SEEN}/>{geoms}{bodies}</worldbody>
    <sensor>{sensors}</sensor></mujoco>"""


def differences(case: Live, seed: int) -> np.ndarray:
    """Differences to MuJoCo, `(worlds, sensordata)`."""
    states = case.states(seed)
    values = np.array(case.place(states).sensordata, dtype=float)
    expected = np.zeros(values.shape)
    for world, data in enumerate(case.data(states)):
        mujoco.mj_forward(case.model, data)
        expected[world] = data.sensordata
    # some overlap, and some are farther apart than the cutoff
    is_distance = case.model.sensor_type == mujoco.mjtSensor.mjSENS_GEOMDIST
    apart = expected[:, case.model.sensor_adr[is_distance]]
    assert (apart < 0).any()
    assert (apart > 0).any()
    return np.abs(values - expected)


def test_distances_normals_and_segments_are_mujocos() -> None:
    with live(scene(), worlds=128, fields=("sensordata",)) as case:
        assert differences(case, 1).max() < 1e-9


@pytest.mark.parametrize("device", ["cpu", "gpu"])
def test_distances_in_single_precision_are_near(device: str) -> None:
    text = scene(('cutoff="5"',))
    with live(text, worlds=20, fields=("sensordata",), precision="f32", device=device) as case:
        error = differences(case, 2)
        # of several pairs of geoms, two may be as near
        assert (error > 1e-3).mean() < 0.01


def test_distances_without_a_closed_form_are_refused_by_name() -> None:
    xml = """<mujoco><worldbody><geom name="a" type="box" size="1 1 1"/><body><freejoint/><geom name="b" size=".1"/>
    </body></worldbody><sensor><distance name="d" geom1="a" geom2="b" cutoff="1"/></sensor></mujoco>"""
    boxes = tl.Scene.from_mujoco(mujoco.MjModel.from_xml_string(xml), name="m")
    with pytest.raises(tl.TightloopError, match="sensor `d`: no support for distances of other geoms than planes"):
        tl.launch(boxes, worlds=1, fields=("sensordata",))
