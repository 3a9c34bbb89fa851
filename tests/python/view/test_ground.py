"""Pictures, films and pages of scenes whose worlds share a large height field."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import tightloop as tl
from tightloop import terrain
from tightloop.view import Camera, Picture
from tightloop.view.browser import guarded_server
from tightloop.view.browser.display_options import DisplayOptions
from tightloop.view.browser.gate import Gate
from tightloop.view.framing import Framing
from tightloop.view.meshes import floor, ground
from tightloop.view.meshes.worlds import WorldMeshes
from tightloop.view.parts import Part, Parts, parts

STEP = 0.1  # of the hardest stairs [m]
GROUND = terrain.mixed(("stairs", "rough", "slopes"), levels=2, cell=0.05, border=2.0, hardest={"stairs": STEP})


@cache
def scene_parts() -> Parts:
    """A ball on stairs, rough ground and slopes: 28 m by 20 m, 450 000 triangles."""
    scene = tl.Scene()
    GROUND.add_to(scene)
    scene.add_sphere(body=scene.add_body(name="ball"), radius=0.1)
    return parts(scene.to_toml(), "/", tl.Dynamics(scene).body_names)


def field() -> Part:
    return next(part for part in scene_parts().of("visual") if part.shape == "hfield")


def at(*places: Any) -> SimpleNamespace:
    """A frame with the ball of each world at one of these places."""
    return SimpleNamespace(body_q=np.array([[[*place, 0.0, 0.0, 0.0, 1.0]] for place in places], float))


def moved(places: Any, *by: float) -> NDArray[np.float64]:
    return np.asarray(places) + np.array(by)


def shot(shown: Any, camera: Any, **options: Any) -> NDArray[np.int16]:
    return Picture(scene_parts(), 240, 180).render(shown, camera=camera, **options).astype(np.int16)


def brightness(pixels: NDArray[np.int16]) -> NDArray[np.float64]:
    return pixels.mean(axis=-1)


def is_blue(pixels: NDArray[np.int16]) -> NDArray[np.bool_]:
    """Where a ball is seen: the ground is sand."""
    return pixels[..., 2] > pixels[..., 0] + 20


def test_every_step_of_a_large_field_is_where_it_is_and_as_high():
    x, y, z = field().mesh.vertices.T
    top = z > GROUND.elevation.min() - 0.5
    np.testing.assert_allclose(z[top], GROUND.height(x[top], y[top]), atol=1e-5)
    # merged cells of treads have corners at each step: 10 on either side of each tile of stairs
    stairs = np.abs(x - GROUND.starts[1, 0, 0]) < 3.7
    assert len(np.unique(np.round(z[top & stairs & (y > 0)] / STEP, 3))) >= 10
    assert scene_parts().notes == []


def test_stairs_are_seen_as_regular_stripes():
    pit = GROUND.starts[1, 0]
    eye = moved(pit, 0.0, -0.5, 1.5)
    pixels = shot(at(pit), Camera(tuple(eye), tuple(moved(pit, 0.0, 2.6, 1.0)), 0.7))
    # up the middle of the picture, treads and risers alternate
    column = brightness(pixels)[:, 120]
    changes = np.flatnonzero(np.abs(np.diff(column)) > 5)
    assert len(changes) >= 12


def test_no_floor_cuts_through_a_field():
    box = ground.extent(scene_parts())
    assert box is not None and box[0, 2] == pytest.approx(GROUND.elevation.min() - 1.0)
    assert floor.height(scene_parts(), np.zeros((2, 3)), box) == pytest.approx(box[0, 2])
    pit = GROUND.starts[1, 0]
    pixels = shot(at(moved(pit, 0.0, 0.0, 3.0)), Camera(tuple(moved(pit, 0.0, -0.01, 2.0)), tuple(pit), 0.5))
    # looking down, nothing but sand: a floor has more blue than red
    assert np.all(pixels[..., 0] > pixels[..., 2])


def test_worlds_are_drawn_in_place_and_their_ground_once():
    place = moved(GROUND.starts[1, 0], 0.0, 0.0, 0.1)
    camera = Camera(tuple(moved(place, -3.0, -3.0, 2.0)), tuple(place))
    picture = Picture(scene_parts(), 240, 180)
    alone = picture.render(at(place), camera=camera)
    assert np.array_equal(picture.render(at(*[place] * 5), camera=camera), alone)
    assert picture.offsets.shape == (5, 3) and not picture.offsets.any()


@pytest.mark.parametrize("preset", ["three-quarter", "top"])
def test_a_camera_frames_all_worlds_on_the_field(preset):
    places = moved(GROUND.starts.reshape(-1, 3), 0.0, 0.0, 0.5)
    lost = [0.0, 0.0, -500.0]
    for shown in (at(*places), at(*places, lost)):
        picture = Picture(scene_parts(), 1000, 750)
        rows, columns = np.nonzero(is_blue(picture.render(shown, camera=preset).astype(np.int16)))
        assert max(np.ptp(columns) / 1000, np.ptp(rows) / 750) > 0.7
    points = Framing(scene_parts(), scene_parts().subject).points(at(*places, lost).body_q, np.zeros((7, 3)))
    assert points[:, 2].min() > -3.0


def test_a_camera_that_follows_keeps_its_robot():
    first, second = moved(GROUND.starts[1, :2], 0.0, 0.0, 0.1)
    picture = Picture(scene_parts(), 240, 180)
    for place in (first, second):
        assert is_blue(picture.render(at(place), camera="follow").astype(np.int16))[60:120, 80:160].any()


def test_level_ground_steps_and_steep_faces_differ_in_colour():
    mesh = field().mesh
    a, b, c = (mesh.vertices[mesh.faces[:, corner]].astype(float) for corner in range(3))
    normal = np.cross(b - a, c - a)
    upright = normal[:, 2] / np.linalg.norm(normal, axis=1)
    light = mesh.colors[:, :3].mean(axis=1)
    assert light[upright > 0.999].min() > light[upright < 0.9].max()
    assert len(np.unique(light[upright > 0.999])) == 2  # squares of a metre
    middles = ((a + b + c) / 3)[upright > 0.999]
    place = np.floor(middles[:, :2] - mesh.vertices.min(axis=0)[:2]).astype(int).sum(axis=1) % 2
    assert np.ptp(light[upright > 0.999][place == 0]) == 0


def test_a_page_has_the_ground_once_and_all_worlds_in_place():
    server = guarded_server.start(Gate("127.0.0.1"), "127.0.0.1", 0)
    try:
        options = DisplayOptions()
        places = GROUND.starts.reshape(-1, 3)
        meshes = WorldMeshes(server, scene_parts(), len(places), options, at(*places).body_q[0])
        assert not meshes.offsets.any()
        for kind in ("visual", "collision"):
            options.choose(kind=kind)
            meshes.show(at(*places).body_q, np.zeros(len(places), int))
            seen = [batch for batch in meshes._all() if batch.handle.visible]
            still = [batch for batch in seen if batch.mesh.bodies == (-1,)]
            assert len(still) <= 6 and all(len(batch.handle.batched_positions) == 1 for batch in still)
            assert all(batch.mesh.flat and batch.handle.lod == "off" for batch in still)
            # what is below `/ground`, the floor, is as low as it is
            assert not any(batch.handle.name.startswith("/ground") for batch in seen)
            moving = [batch for batch in seen if batch.mesh.bodies != (-1,)]
            np.testing.assert_allclose(moving[0].handle.batched_positions, places, atol=1e-6)
    finally:
        server.stop()
