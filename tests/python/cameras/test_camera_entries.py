"""Cameras of scenes: their entries, their errors, and what scene files keep."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tightloop as tl


def scene_with_ball() -> tl.Scene:
    scene = tl.Scene()
    scene.add_ground()
    scene.add_body(name="ball", pos=(0, 0, 1))
    scene.add_sphere(body="ball", radius=0.2)
    return scene


def test_intrinsics_are_those_of_the_vertical_field_of_view() -> None:
    camera = scene_with_ball().add_camera(width=64, height=48, fov=np.pi / 2)
    assert camera.name == "camera"
    np.testing.assert_allclose(camera.intrinsics, [[24, 0, 32], [0, 24, 24], [0, 0, 1]])


@pytest.mark.parametrize(
    ("pos", "target"),
    [((2, 0, 1), (0, 0, 1)), ((0, 0, 3), (0, 0, 0)), ((0, 0, -2), (0, 0, 1)), ((1, -2, 3), (0, 1, 0.5))],
)
def test_a_camera_with_a_target_has_it_in_the_middle_and_z_up(pos: Any, target: Any) -> None:
    camera = scene_with_ball().add_camera(pos=pos, target=target, width=8, height=8)
    x, y, z, w = camera.quat
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    forward = np.subtract(target, pos) / np.linalg.norm(np.subtract(target, pos))
    np.testing.assert_allclose(rotation[:, 2], forward, atol=1e-12)
    assert rotation[2, 0] == pytest.approx(0.0, abs=1e-12)  # rows are level
    assert rotation[2, 1] <= 1e-12  # y of the image is down


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"width": 0}, "width"),
        ({"height": 5000}, "at most 4096"),
        ({"width": None}, "give width and height"),
        ({"fov": 4.0}, "fov is 4.0"),
        ({"fov": 1.0, "focal": (50, 50)}, "both fov and focal"),
        ({"center": (1, 1)}, "center is given without focal"),
        ({"near": 0}, "near"),
        ({"far": 0.001}, "far"),
        ({"every": 0}, "every"),
        ({"every": 10**7}, "every is"),
        ({"worlds": ()}, "worlds has 0 entries"),
        ({"worlds": [True, False]}, "np.flatnonzero"),
        ({"worlds": [2**40]}, "so many worlds"),
        ({"worlds": (0, -1)}, "worlds is -1"),
        ({"worlds": 4}, r"such as range\(4\)"),
        ({"near": 1e39, "far": 1e40}, "near is"),
        ({"focal": (1e9, 1.0)}, "focal is"),
        ({"depth_noise": (0.0, 1e6)}, "at most 1000"),
        ({"body": "box"}, "no body of this scene"),
        ({"name": "my camera"}, "camera name 'my camera'"),
        ({"name": "my-camera"}, "give letters, digits and _"),
        ({"name": "c" * 20}, "19 at most"),
        ({"quat": (0, 0, 0, 1), "target": (1, 1, 1)}, "both quat and target"),
        ({"target": (0, 0, 0)}, "where the camera is"),
        ({"sees": "all"}, "sees"),
        ({"mujoco": "robot/eye"}, "'model/camera'"),
    ],
)
def test_what_is_wrong_with_a_camera_is_named(wrong: dict[str, Any], message: str) -> None:
    scene = scene_with_ball()
    arguments: dict[str, Any] = {"width": 8, "height": 8, **wrong}
    with pytest.raises(tl.SceneError, match=message):
        scene.add_camera(**arguments)
    assert not scene.cameras


def test_a_camera_of_a_mujoco_model_that_follows_a_body_is_refused() -> None:
    scene = tl.Scene.from_mujoco(Path(__file__).parent / "tracked.xml", name="robot")
    with pytest.raises(tl.SceneError, match="tracks or targets"):
        scene.add_camera(mujoco="robot/follower", width=8, height=8)
    with pytest.raises(tl.SceneError, match="no camera 'other'; it has follower, fixed"):
        scene.add_camera(mujoco="robot/other", width=8, height=8)
    camera = scene.add_camera(mujoco="robot/fixed")
    assert (camera.width, camera.height) == (64, 32)


def test_a_scene_file_keeps_its_cameras(tmp_path: Path) -> None:
    scene = scene_with_ball()
    scene.add_camera(
        body="ball", pos=(0.3, 0, 0), target=(1, 0, 0), width=16, height=8, fov=1.2, every=2, worlds=[3, 1], name="nose"
    )
    scene.add_camera(
        pos=(0, 0, 2), quat=(1, 0, 0, 0), width=8, height=8, focal=(9, 8), center=(4, 3), sees="collisions"
    )
    scene.save(tmp_path / "scene.toml")
    again = tl.Scene.load(tmp_path / "scene.toml")
    assert again.cameras == scene.cameras
    fields = [name for camera in scene.cameras.values() for name in (camera.depth, camera.segmentation)]
    with tl.launch(scene, worlds=4, fields=fields) as first, tl.launch(again, worlds=4, fields=fields) as second:
        one, two = first.reset(), second.reset()
        assert all(np.array_equal(getattr(one, name), getattr(two, name)) for name in fields)
        assert one.camera_depth.max() == pytest.approx(2.0, abs=1e-6)


def test_a_field_of_a_camera_that_is_not_there_is_refused_before_the_launch() -> None:
    scene = scene_with_ball()
    scene.add_camera(width=8, height=8, name="nose")
    with pytest.raises(tl.ArgumentError, match="nose_depth"):
        tl.launch(scene, worlds=1, fields=("joint_q", "nos_depth"))
