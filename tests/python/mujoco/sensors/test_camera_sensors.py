"""Sensors about cameras that follow a body or look at it, pixels of sites, and frames inside of sites."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from live_model import Live, live

import tightloop as tl

MODES = ("fixed", "track", "trackcom", "targetbody", "targetbodycom")
LENSES = (
    'resolution="640 480" fovy="50"',
    'resolution="640 480" sensorsize="4e-3 3e-3" focal="5e-3 6e-3"',
    'resolution="641 481" sensorsize="4e-3 3e-3" focalpixel="500 600" principalpixel="10 20"',
    'resolution="640 480" projection="orthographic" fovy="2"',
    'resolution="320 200" fovy="90"',
)
ZONES = {"sphere": ".5", "capsule": ".3 .4", "ellipsoid": ".3 .4 .6", "cylinder": ".4 .5", "box": ".3 .4 .5"}
OBJECTS = (("body", "it"), ("xbody", "it"), ("geom", "skin"), ("site", "far"), *(("camera", mode) for mode in MODES))
PROPERTIES = tuple(f"frame{what}" for what in ("pos", "quat", "xaxis", "yaxis", "zaxis", "linvel", "angvel"))


def scene(mode: str, lens: str) -> str:
    """Two free bodies with an arm each, a camera on the first and zones at the second; sensors of all of them."""
    target = 'target="it"' if mode.startswith("target") else ""
    camera = f'<camera name="{mode}" mode="{mode}" {target} pos=".1 .2 .3" euler="40 50 60" {lens}/>'
    others = "".join(f'<camera name="{other}"/>' for other in MODES if other != mode)
    zones = "".join(
        f'<site name="{kind}" type="{kind}" size="{size}" euler="10 20 30" pos=".1 0 .1"/>'
        for kind, size in ZONES.items()
    )
    arm = '<body pos=".2 0 0"><joint axis="0 1 0"/><geom size=".07" pos=".1 .1 .1" {}/></body>'
    idle = 'contype="0" conaffinity="0"'
    sensors = ""
    for kind in PROPERTIES:
        own = f'objtype="camera" objname="{mode}"'
        sensors += f'<{kind} {own}/><{kind} {own} reftype="site" refname="far"/>'
        sensors += f'<{kind} objtype="body" objname="it" reftype="camera" refname="{mode}"/>'
    sensors += f'<frameangacc objtype="camera" objname="{mode}"/>'
    if not mode.startswith("track"):
        sensors += f'<framelinacc objtype="camera" objname="{mode}"/>'
    sensors += f'<camprojection site="far" camera="{mode}"/><camprojection site="box" camera="{mode}" cutoff="300"/>'
    sensors += "".join(
        f'<insidesite site="{kind}" objtype="{what}" objname="{name}"/>' for kind in ZONES for what, name in OBJECTS
    )
    sensors += '<insidesite site="box" objtype="body" objname="it" cutoff="0.5"/>'
    return f"""<mujoco><worldbody>
      <body name="it" pos=".3 -.2 .5"><freejoint/><geom name="skin" size=".1" pos=".05 .1 0" {idle}/>
        {arm.format(idle)}<site name="far" pos=".1 .2 .3"/></body>
      <body pos="1 0 0" euler="10 20 30"><freejoint/><geom size=".1" pos=".02 .03 0" {idle}/>
        {arm.format(idle)}{zones}{camera}{others}</body>
    </worldbody><sensor>{sensors}</sensor></mujoco>"""


def differences(case: Live, seed: int) -> np.ndarray:
    """Differences to MuJoCo over the largest value of each sensor, `(worlds, sensordata)`."""
    states = case.states(seed)
    values = case.place(states).sensordata
    expected = np.zeros(values.shape)
    for world, data in enumerate(case.data(states)):
        mujoco.mj_forward(case.model, data)
        expected[world] = data.sensordata
    error = np.abs(values - expected)
    for sensor in range(case.model.nsensor):
        own = slice(case.model.sensor_adr[sensor], case.model.sensor_adr[sensor] + case.model.sensor_dim[sensor])
        error[:, own] /= max(1.0, np.abs(expected[:, own]).max())
    return error


@pytest.mark.parametrize(("mode", "lens"), zip(MODES, LENSES, strict=True), ids=MODES)
def test_cameras_are_where_mujoco_has_them_and_see_the_same_pixels(mode: str, lens: str) -> None:
    with live(scene(mode, lens), worlds=32, fields=("sensordata",)) as case:
        inside = [
            case.model.sensor_adr[sensor]
            for sensor in range(case.model.nsensor)
            if case.model.sensor_type[sensor] == mujoco.mjtSensor.mjSENS_INSIDESITE
        ]
        assert differences(case, 1).max() < 1e-10
        shown = case.sim.forward().sensordata[:, inside]
        assert set(np.unique(shown)) == {0.0, 0.5, 1.0}


@pytest.mark.parametrize("device", ["cpu", "gpu"])
@pytest.mark.parametrize("mode", ["trackcom", "targetbody"])
def test_cameras_in_single_precision_are_near(mode: str, device: str) -> None:
    with live(scene(mode, LENSES[0]), worlds=20, fields=("sensordata",), precision="f32", device=device) as case:
        error = differences(case, 2)
        kinds = np.repeat(case.model.sensor_type, case.model.sensor_dim)
        at_edge = kinds == mujoco.mjtSensor.mjSENS_INSIDESITE
        assert error[:, ~at_edge].max() < 1e-3
        # a point may be at an edge
        assert (error[:, at_edge] > 0).mean() < 0.01


def test_a_camera_of_a_model_that_the_scene_turns_follows_in_the_axes_of_the_model() -> None:
    model = mujoco.MjModel.from_xml_string(scene("track", LENSES[0]))
    both = tl.Scene.from_mujoco(model, name="first")
    both.add_mujoco(model, name="second", pos=(1, 2, 3), quat=(0, 0, np.sin(0.4), np.cos(0.4)))
    with tl.launch(both, worlds=1, fields=("sensordata",)) as sim:
        shown = sim.forward().sensordata[0]
        # the first sensor of each is the place of the camera
        straight, turned = (shown[sim.sensors[f"{name}/sensor0"]] for name in ("first", "second"))
    cos, sin = np.cos(0.8), np.sin(0.8)
    expected = np.array([1, 2, 3]) + np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]]) @ straight
    np.testing.assert_allclose(turned, expected, atol=1e-10)


def test_accelerations_of_cameras_that_follow_are_refused_by_name() -> None:
    xml = """<mujoco><worldbody><body name="b"><freejoint/><geom size=".1"/><camera name="c" mode="trackcom"/></body>
    </worldbody><sensor><framelinacc name="a" objtype="camera" objname="c"/></sensor></mujoco>"""
    one = tl.Scene.from_mujoco(mujoco.MjModel.from_xml_string(xml), name="m")
    with pytest.raises(tl.TightloopError, match="sensor `a`: no support for accelerations of cameras that track"):
        tl.launch(one, worlds=1, fields=("sensordata",))


def test_what_is_at_a_centre_of_mass_that_varies_is_refused() -> None:
    xml = """<mujoco><worldbody><site name="z" size="1"/><body name="b"><freejoint/><geom size=".1"/></body></worldbody>
    <sensor><insidesite name="i" site="z" objtype="body" objname="b"/></sensor></mujoco>"""
    one = tl.Scene.from_mujoco(mujoco.MjModel.from_xml_string(xml), name="m")
    with pytest.raises(tl.TightloopError, match="sensor `i`: no support for a body's centre of mass"):
        tl.launch(one, worlds=1, params=("body_com",), fields=("sensordata",))
