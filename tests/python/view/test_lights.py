"""Lights of MuJoCo models in pictures: where MuJoCo has them, and what surfaces look like in them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest

import tightloop as tl
from tightloop.mujoco import export
from tightloop.view import Camera, Picture
from tightloop.view.browser import guarded_server
from tightloop.view.browser.gate import Gate
from tightloop.view.browser.stage import add_stage
from tightloop.view.lights import COLUMNS, Lights, rows
from tightloop.view.parts import Parts, parts
from tightloop.view.poses import IDENTITY

XML = """<mujoco model="lit"><visual><headlight {head}/></visual><worldbody>{lights}
<geom name="table" type="box" size="1 1 .1" rgba=".8 .8 .8 1"/>
<body name="ball" pos="0 0 .6"><freejoint/><geom size=".2" rgba=".2 .4 .8 1"/>{carried}
  <body pos=".1 .2 .3" euler="10 20 30"><joint/><geom size=".05"/></body></body>
</worldbody></mujoco>"""
NO_HEAD = 'active="0"'
ABOVE = '<light directional="true" dir="0 0 -1" diffuse=".6 .5 .4" ambient=".1 .1 .1" specular="0 0 0" {more}/>'


def lit(lights: str, head: str = "", carried: str = "") -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(XML.format(lights=lights, head=head, carried=carried))


def scene_parts(scene: tl.Scene) -> Parts:
    return parts(scene.to_toml(), "/", tl.Dynamics(scene).body_names)


def rendered(model: mujoco.MjModel, view: Camera, worlds: int = 1, *, up: float = 0.0) -> np.ndarray:
    scene = tl.Scene.from_mujoco(model)
    coords = np.zeros((worlds, model.nq))
    coords[:, 2], coords[:, 6] = 0.6 + up, 1.0
    shown = SimpleNamespace(body_q=tl.Dynamics(scene).forward_kinematics(coords))
    return Picture(scene_parts(scene), 160, 120).render(shown, camera=view)


def middle(picture: np.ndarray) -> np.ndarray:
    return picture[picture.shape[0] // 2, picture.shape[1] // 2].astype(int)


def near(x: float, y: float) -> Camera:
    """From above, at the table's top."""
    return Camera((x, y - 2.0, 3.0), (x, y, 0.1), 0.1)


def test_lights_are_where_mujoco_has_them():
    carried = "".join(
        f'<light mode="{mode}" pos=".1 .2 {k}" dir=".3 .1 -1" target="ball" cutoff="{20 + k}" exponent="{k}"/>'
        for k, mode in enumerate(("fixed", "track", "trackcom", "targetbody", "targetbodycom"))
    )
    still = '<light pos="1 2 3" dir="0 1 -1" attenuation="1 .5 .25" castshadow="false"/><light active="false"/>'
    targets = '<light mode="targetbodycom" target="ball" pos="3 2 1"/><light type="point" pos="0 0 4"/>'
    model = lit(still + targets + ABOVE.format(more=""), carried=carried)
    data, made = mujoco.MjData(model), Lights()
    made.add(export.arrays(model), range(model.nbody))
    rng = np.random.default_rng(0)
    for _ in range(5):
        data.qpos[:] = rng.uniform(-1, 1, model.nq)
        mujoco.mj_normalizeQuat(model, data.qpos)
        mujoco.mj_forward(model, data)
        lamps = made.lamps(np.concatenate([data.xpos, data.xquat[:, [1, 2, 3, 0]]], axis=1))
        active = np.flatnonzero(np.asarray(model.light_active).ravel())
        assert len(lamps) == len(active) == len(made) == 9
        for light, lamp in zip(active, lamps, strict=True):
            np.testing.assert_allclose(lamp.direction, data.light_xdir[light], atol=1e-9)
            if lamp.position is not None:
                np.testing.assert_allclose(lamp.position, data.light_xpos[light], atol=1e-9)
            np.testing.assert_allclose(lamp.diffuse, model.light_diffuse[light])
            np.testing.assert_allclose(lamp.attenuation, model.light_attenuation[light])
            assert lamp.shadows == bool(np.asarray(model.light_castshadow).ravel()[light])
        assert [lamp.position is None for lamp in lamps].count(True) == 1
    assert rows(lamps).shape == (9, COLUMNS) and np.isclose(lamps[1].cutoff, np.radians(45))


def test_a_surface_has_the_sum_of_the_lights_as_in_mujoco():
    model = lit(ABOVE.format(more='castshadow="false"'), NO_HEAD)
    # from above the top is met at a right angle
    np.testing.assert_allclose(middle(rendered(model, near(0.7, 0.7))), 255 * 0.8 * np.array([0.7, 0.6, 0.5]), atol=2)
    aslant = lit(ABOVE.format(more='castshadow="false"').replace("0 0 -1", ".6 0 -.8"), NO_HEAD)
    wanted = 255 * 0.8 * (0.1 + 0.8 * np.array([0.6, 0.5, 0.4]))
    np.testing.assert_allclose(middle(rendered(aslant, near(0.7, 0.7))), wanted, atol=2)


def test_the_light_at_the_camera_is_added():
    light = ABOVE.format(more='castshadow="false"')
    without, head = (lit(light, head) for head in (NO_HEAD, 'ambient=".1 0 0" diffuse="0 0 .2" specular="0 0 0"'))
    view = near(0.7, 0.7)
    more = middle(rendered(head, view)) - middle(rendered(without, view))
    facing = 2.9 / np.hypot(2.9, 2.0)
    np.testing.assert_allclose(more, 255 * 0.8 * np.array([0.1, 0, 0.2 * facing]), atol=2)


def test_a_light_that_casts_shadows_leaves_a_shadow_below_a_ball():
    casts, none = (lit(ABOVE.format(more=f'castshadow="{casts}"'), NO_HEAD) for casts in ("true", "false"))
    view = Camera((0.0, -3.0, 0.7), (0.0, 0.0, 0.1), 0.02)
    dark, bright = (middle(rendered(model, view)) for model in (casts, none))
    np.testing.assert_allclose(dark, 255 * 0.8 * 0.1, atol=3)
    assert np.all(bright > 2 * dark)


def test_a_light_that_a_body_carries_moves_with_it():
    shape = 'pos="0 0 .3" dir="0 0 -1" cutoff="80" exponent="0" attenuation="1 0 1"'
    carried = f'<light {shape} castshadow="false" diffuse="1 1 1"/>'
    model = lit("", NO_HEAD, carried)
    low, high = (middle(rendered(model, near(0.7, 0.7), up=up)) for up in (0.0, 3.0))
    assert low.min() > high.max() + 10


def test_a_model_without_lights_has_the_fixed_ones():
    scene = tl.Scene.from_mujoco(lit(""))
    seen = scene_parts(scene)
    assert len(seen.lights) == 0
    shown = SimpleNamespace(body_q=tl.Dynamics(scene).forward_kinematics(np.eye(1, 8, 6)))
    # a list of parts has no lights
    pictures = [Picture(own, 160, 120).render(shown, camera=near(0, 0)) for own in (seen, list(seen))]
    np.testing.assert_array_equal(*pictures)


def test_worlds_side_by_side_are_lit_alike():
    model = lit('<light pos="1 1 3" dir="-.3 -.3 -1" diffuse="1 1 1"/>', NO_HEAD)
    scene = tl.Scene.from_mujoco(model)
    coords = np.zeros((2, model.nq))
    coords[:, 2], coords[:, 6] = 0.6, 1.0
    picture = Picture(scene_parts(scene), 160, 120)
    shown = SimpleNamespace(body_q=tl.Dynamics(scene).forward_kinematics(coords))
    picture.render(shown)
    colors = []
    for offset in picture.offsets:
        view = Camera((offset[0] + 0.7, offset[1] - 1.3, 3.0), (offset[0] + 0.7, offset[1] + 0.7, 0.1), 0.1)
        colors.append(middle(picture.render(shown, camera=view)))
    np.testing.assert_allclose(*colors, atol=2)


def test_the_light_of_the_page_that_casts_shadows_shines_from_far_off():
    model, lights = lit('<light pos="0 1 3" dir="0 0 -1"/>'), Lights()
    lights.add(export.arrays(model), range(model.nbody))
    server = guarded_server.start(Gate("127.0.0.1"), "127.0.0.1", 0)
    try:
        box = np.array([[-1, -1, 0], [1, 1, 2.0]])
        lamps = add_stage(server.scene, box, np.zeros((1, 3)), 0.0, lights=lights)
        lamps.show(np.tile(IDENTITY, (model.nbody, 1)))
        (handle,) = lamps._handles
        assert handle.cast_shadow
        # from above the middle of the box
        np.testing.assert_allclose(handle.position, np.array([0, 1, 2]) / np.sqrt(5))
    finally:
        server.stop()


@pytest.mark.parametrize("worlds", [1, 3])
def test_the_page_has_the_lights_of_a_model(worlds):
    spot = '<light pos="1 2 3" dir="0 1 -1" cutoff="30" castshadow="false"/>'
    point = '<light type="point" pos="0 0 4" castshadow="false"/>'
    model = lit(spot + point + ABOVE.format(more=""), carried='<light pos="0 0 1"/>')
    data, lights = mujoco.MjData(model), Lights()
    lights.add(export.arrays(model), range(model.nbody))
    mujoco.mj_forward(model, data)
    server = guarded_server.start(Gate("127.0.0.1"), "127.0.0.1", 0)
    try:
        offsets = np.arange(worlds)[:, None] * np.array([[3.0, 0, 0]])
        lamps = add_stage(server.scene, np.array([[-1, -1, 0], [1, 1, 1.0]]), offsets, 0.0, lights=lights)
        lamps.show(np.concatenate([data.xpos, data.xquat[:, [1, 2, 3, 0]]], axis=1))
        handles: list[Any] = lamps._handles
        kinds = [type(handle).__name__ for handle in handles]
        directional = "DirectionalLightHandle"
        if worlds == 1:
            assert kinds == ["SpotLightHandle", "PointLightHandle", directional, "SpotLightHandle"]
            np.testing.assert_allclose(handles[0].position, [1, 2, 3])
            np.testing.assert_allclose(handles[0].angle, np.radians(30))
            np.testing.assert_allclose(handles[3].position, data.light_xpos[3], atol=1e-6)
            data.qpos[2] += 1
            mujoco.mj_forward(model, data)
            lamps.show(np.concatenate([data.xpos, data.xquat[:, [1, 2, 3, 0]]], axis=1))
            np.testing.assert_allclose(handles[3].position, data.light_xpos[3], atol=1e-6)
        else:
            assert set(kinds) == {directional}
        assert sum(handle.cast_shadow for handle in handles) == 1
    finally:
        server.stop()
