"""Images of cameras: what they show beside MuJoCo's rays, and that they depend on their world alone."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

import tightloop as tl
from tightloop import _core, assets
from tightloop.view.source import Live

#: What every MuJoCo ray may meet: geoms of groups 0 to 2, as renderers show them.
GROUPS = np.array([1, 1, 1, 0, 0, 0], np.uint8)

MJCF = """
<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 1"/>
    <geom name="wall" type="box" pos="1.2 0 0.5" size="0.05 1 0.5"/>
    <camera name="above" pos="0.2 -1.2 1.1" xyaxes="1 0.1 0 -0.05 0.6 0.8" fovy="60"/>
    <body name="arm" pos="0 0 0.7">
      <joint type="hinge" axis="0 1 0"/>
      <geom name="upper" type="capsule" fromto="0 0 0 0.4 0 0" size="0.06"/>
      <camera name="wrist" pos="0.4 0 0.1" xyaxes="0 -1 0 0.6 0 0.8" fovy="70"/>
      <body name="hand" pos="0.4 0 0">
        <joint type="hinge" axis="0 0 1"/>
        <geom name="palm" type="ellipsoid" pos="0.1 0 0" size="0.1 0.07 0.05"/>
        <geom name="finger" type="cylinder" pos="0.2 0.05 0" size="0.02 0.08"/>
        <camera name="follower" mode="track" pos="0 0 1"/>
      </body>
    </body>
    <body name="ball" pos="0.6 0.3 0.15"><freejoint/><geom name="ball" type="sphere" size="0.15"/></body>
  </worldbody>
</mujoco>
"""


def rays_of(model: mujoco.MjModel, data: mujoco.MjData, camera: tl.Camera, name: str) -> tuple[Any, Any]:
    """Depth [m] and geom of each pixel by MuJoCo's rays from the camera of that name; 0 and -1 where there is none."""
    place = data.camera(name)
    eye, axes = place.xpos, place.xmat.reshape(3, 3) @ np.diag([1.0, -1.0, -1.0])
    (fx, fy), (cx, cy) = camera.focal, camera.center
    depth = np.zeros((camera.height, camera.width))
    geoms = np.full((camera.height, camera.width), -1)
    geom = np.zeros(1, np.int32)
    for row in range(camera.height):
        for column in range(camera.width):
            ray = axes @ [(column + 0.5 - cx) / fx, (row + 0.5 - cy) / fy, 1.0]
            far = mujoco.mj_ray(model, data, eye, ray, GROUPS, 1, -1, geom)
            if camera.near <= far <= camera.far:
                depth[row, column], geoms[row, column] = far, geom[0]
    return depth, geoms


def near_edges(labels: NDArray[Any]) -> NDArray[np.bool_]:
    """Pixels beside one with another label."""
    edge = np.zeros(labels.shape, bool)
    for axis in (0, 1):
        differ = np.diff(labels, axis=axis) != 0
        pad = [(0, 0), (0, 0)]
        for side in ((1, 0), (0, 1)):
            pad[axis] = side
            edge |= np.pad(differ, pad)
    return edge


@pytest.mark.parametrize("precision", ["f32", "f64"])
@pytest.mark.parametrize("name", ["above", "wrist"])
def test_depths_and_labels_are_those_of_mujocos_rays(name: str, precision: str) -> None:
    model = mujoco.MjModel.from_xml_string(MJCF)
    scene = tl.Scene.from_mujoco(model, name="robot")
    camera = scene.add_camera(mujoco=f"robot/{name}", width=48, height=40, name="eye")
    fields = ("qpos", camera.depth, camera.segmentation)
    data = mujoco.MjData(model)
    with tl.launch(scene, worlds=2, precision=precision, fields=fields) as sim:
        names = sim.segment_names
        for step in range(40):
            frame = sim.step()
            if step not in (0, 20, 39):
                continue
            for world in range(2):
                data.qpos[:] = frame.qpos[world]
                mujoco.mj_forward(model, data)
                depth, geoms = rays_of(model, data, camera, name)
                labels = frame.eye_segmentation[world]
                edge = near_edges(geoms)
                inside = ~edge & (depth > 0)
                assert inside.mean() > 0.5
                error = np.abs(frame.eye_depth[world] - depth)[inside]
                assert error.max() < 1e-5 * depth.max(), error.max()
                for geom in np.unique(geoms[inside]):
                    own = labels[inside & (geoms == geom)]
                    body = int(model.geom_bodyid[geom])
                    expected = model.body(body).name if body else model.geom(geom).name
                    assert {names[label].rsplit("/", 1)[-1] for label in own} == {expected}
                nothing = ~edge & (depth == 0)
                assert (labels[nothing] == -1).all() and (frame.eye_depth[world][nothing] == 0).all()


def tumbling(every: int = 1) -> tuple[tl.Scene, tl.Camera]:
    """An arm over a cube that starts elsewhere in each world, seen from the hand."""
    scene = tl.Scene(dt=1 / 480, substeps=4)
    scene.add_ground()
    arm = scene.add_urdf(assets.FR3, name="arm")
    arm.joint_target_ke, arm.joint_target_kd = 400.0, 40.0
    arm.joint_q = [0.0, -0.4, 0.0, -2.0, 0.0, 2.0, 0.8, 0.04, 0.04]
    scene.add_cube(name="cube", pos=(0.5, 0.0, 0.4))
    scene.randomize(body_q={"cube": {"x": tl.Uniform(-0.1, 0.1), "yaw": tl.Uniform(-1.0, 1.0)}})
    camera = scene.add_camera(
        body=arm.link("fr3_link0"),
        pos=(1.3, 0.4, 0.8),
        target=(0.4, 0, 0.2),
        width=40,
        height=24,
        every=every,
        name="eye",
    )
    return scene, camera


def images(frame: Any) -> tuple[NDArray[Any], ...]:
    return frame.eye_depth.copy(), frame.eye_segmentation.copy(), frame.eye_rgb.copy()


def test_an_image_is_the_same_for_any_number_of_worlds_threads_and_groups() -> None:
    scene, camera = tumbling()
    fields = ("joint_q", *camera.fields)

    def run(worlds: int, **options: Any) -> list[tuple[NDArray[Any], ...]]:
        with tl.launch(scene, worlds=worlds, fields=fields, **options) as sim:
            sim.reset(seed=np.arange(worlds))
            return [images(sim.step()) for _ in range(12)]

    one = run(3, threads=1)
    for many in (run(3, threads=2), run(21, threads=2)):
        for shown, others in zip(one, many, strict=True):
            assert [image.tobytes() for image in shown] == [image[:3].tobytes() for image in others]
    depth, _, rgb = one[-1]
    assert rgb.shape == (3, 24, 40, 3) and rgb.dtype == np.uint8 and len(np.unique(rgb)) > 20
    assert (depth > 0).mean() > 0.2 and not np.array_equal(depth[0], depth[1])
    with tl.launch(scene, worlds=4, groups=2, threads=2, fields=fields) as groups:
        for group in groups:
            group.reset(seed=np.arange(group.info["first_world"], group.info["first_world"] + 2))
        frames = [[images(group.step()) for _ in range(12)][-1] for group in groups]
    for plane in range(3):
        assert np.concatenate([shown[plane] for shown in frames])[:3].tobytes() == one[-1][plane].tobytes()


def test_a_camera_draws_at_its_rate_and_repeats_the_last_image_in_between() -> None:
    scene, camera = tumbling(every=3)
    whole, _ = tumbling()
    fields = ("joint_q", *camera.fields)
    with tl.launch(scene, worlds=3, fields=fields) as slow, tl.launch(whole, worlds=3, fields=fields) as fast:
        shown = [[images(sim.reset(seed=1)), *(images(sim.step()) for _ in range(8))] for sim in (slow, fast)]
        for step, (image, _) in enumerate(zip(*shown, strict=True)):
            expected = shown[1][step - step % 3]
            assert all(np.array_equal(a, b) for a, b in zip(image, expected, strict=True)), step
        # a world that begins anew has an image of its start, whatever the others show
        mask = np.array([False, True, False])
        again = [images(sim.reset(mask=mask, seed=5)) for sim in (slow, fast)]
        assert np.array_equal(again[0][0][1], again[1][0][1])
        assert np.array_equal(again[0][0][0], shown[0][8][0][0])


def test_images_of_worlds_that_do_not_change_stay_and_the_others_are_new() -> None:
    scene, camera = tumbling()
    fields = ("joint_q", "joint_qd", *camera.fields)

    def differ(one: tuple[NDArray[Any], ...], other: tuple[NDArray[Any], ...]) -> list[bool]:
        return [
            any(a[world].tobytes() != b[world].tobytes() for a, b in zip(one, other, strict=True)) for world in range(3)
        ]

    with tl.launch(scene, worlds=3, fields=fields) as sim, tl.launch(scene, worlds=3, fields=fields) as plain:
        begun = images(sim.reset(seed=1))
        before = [images(sim.step()) for _ in range(8)][-1]
        after = images(sim.reset(mask=np.array([False, True, False])))
        assert differ(before, after) == [False, True, False]
        assert differ(begun, before) == [True, True, True]
        # a world that is written to is seen anew although its step is the same
        written = sim.forward().joint_q.copy()
        written[2] += 0.1
        frame = sim.write(joint_q=written)
        moved = images(frame)
        assert differ(after, moved) == [False, False, True]
        # the same states without anything before them
        plain.reset(seed=1)
        alone = images(plain.write(joint_q=written, joint_qd=frame.joint_qd))
        assert differ(alone, moved) == [False, False, False]


def test_labels_are_places_in_the_list_of_segments() -> None:
    scene, camera = tumbling()
    with tl.launch(scene, worlds=1, fields=("joint_q", camera.segmentation)) as sim:
        labels = sim.reset().eye_segmentation
        assert labels.dtype == np.int32 and labels.shape == (1, 24, 40)
        assert sim.segment_names[: len(sim.body_names)] == sim.body_names
        seen = {sim.segment_names[label] for label in np.unique(labels[labels >= 0])}
        assert {"ground", "cube/body", "arm/fr3_link0"} <= seen


def test_a_camera_that_nobody_asks_for_is_no_field() -> None:
    scene, camera = tumbling()
    with tl.launch(scene, worlds=1, fields=("joint_q",)) as sim:
        frame = sim.reset()
        assert camera.depth not in frame.fields and sim.segment_names == []
        with pytest.raises(tl.UnknownField, match="are fields if `launch"):
            _ = frame.eye_depth


def test_a_recording_with_images_is_replayed_bit_for_bit(tmp_path: Path) -> None:
    scene, camera = tumbling(every=2)
    file = tmp_path / "run.tlr"
    with tl.launch(scene, worlds=2, fields=("joint_q", camera.depth)) as sim, sim.record(file):
        sim.reset(seed=3)
        shown = [sim.step(joint_target_q={"arm": np.full(9, 0.1 * step)}).eye_depth.copy() for step in range(6)]
    subprocess.run([sys.executable, "-m", "tightloop", "replay", file], check=True)
    played = _core.Playback(str(file), 2, ["joint_q", camera.depth])
    frames = []
    while (arrays := played.next()) is not None:
        frames.append(arrays[camera.depth])
    assert len(frames) == 7 and all(np.array_equal(a, b) for a, b in zip(frames[1:], shown, strict=True))


def test_observers_see_the_images_of_the_first_worlds_and_of_any_camera() -> None:
    scene, camera = tumbling()
    with tl.launch(scene, worlds=4, watch_worlds=2, fields=("joint_q", camera.depth)) as sim:
        frame = sim.reset(seed=2)
        observer = _core.Client(sim.name, lease=False)
        try:
            seen = observer.wait_newer(10.0)
            assert seen is not None and np.array_equal(seen.eye_depth, frame.eye_depth[:2])
        finally:
            observer.close()
        live = Live(sim.name, fields=(camera.depth, camera.segmentation))
        try:
            shown = live.poll(10.0)
            assert shown is not None and np.array_equal(shown.eye_depth, frame.eye_depth[:2])
            assert shown.eye_segmentation.max() > 0
        finally:
            live.close()


def test_colours_are_those_of_the_scene_and_a_shadow_is_darker() -> None:
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody>
        <geom name="floor" type="plane" size="5 5 1" rgba="0.8 0.8 0.8 1"/>
        <geom name="red" type="box" pos="0 0 0.5" size="0.3 0.3 0.05" rgba="1 0 0 1"/>
        <geom name="glass" type="box" pos="0 0 1.5" size="0.3 0.3 0.05" rgba="0 1 0 0"/>
        <camera name="above" pos="0 0 3"/></worldbody></mujoco>"""
    )
    scene = tl.Scene.from_mujoco(model, name="room")
    camera = scene.add_camera(mujoco="room/above", width=64, height=64, name="eye")
    with tl.launch(scene, worlds=1, fields=camera.fields) as sim:
        frame = sim.reset()
        labels, rgb = frame.eye_segmentation[0], frame.eye_rgb[0].astype(int)
        names = np.array([*sim.segment_names, "nothing"])[labels]
        red = rgb[names == "room/world/red"]
        floor = rgb[names == "room/world/floor"]
    assert len(red) > 50 and (red[:, 0] > 3 * np.maximum(red[:, 1], red[:, 2])).all()
    assert (np.ptp(floor, axis=1) < 30).all()  # grey, in light and in shadow
    brightness = floor.mean(axis=1)
    assert 30 < (brightness < 0.75 * np.median(brightness)).sum() < 0.3 * len(floor)
    assert not (names == "room/world/glass").any()


def test_cameras_are_placed_anew_in_each_episode_as_a_function_of_seed_and_world() -> None:
    scene = tl.Scene()
    scene.add_ground()
    above = scene.add_camera(pos=(0, 0, 2), target=(0, 0, 0), width=9, height=9, name="above")
    scene.add_camera(pos=(0, 0, 1), target=(0, 0, 0), width=9, height=9, name="fixed")
    scene.randomize(cameras={"above": {"z": tl.Uniform(-0.5, 0.5), "focal": tl.Uniform(-0.2, 0.2)}})
    fields = (above.depth, "fixed_depth")

    def heights(worlds: int, **seed: Any) -> NDArray[Any]:
        with tl.launch(scene, worlds=worlds, fields=fields) as sim:
            shown = [sim.reset(**seed).above_depth[:, 4, 4].copy()]
            shown.append(sim.step().above_depth[:, 4, 4].copy())
            shown.append(sim.reset().above_depth[:, 4, 4].copy())
            assert (sim.reset().fixed_depth[:, 4, 4] == np.float32(1.0)).all()
        return np.stack(shown)

    many = heights(40, seed=3)
    assert many[0].min() < 1.6 and many[0].max() > 2.4 and (many >= 1.5).all() and (many <= 2.5).all()
    assert (many[0] == many[1]).all() and not (many[0] == many[2]).any()
    assert np.array_equal(many[:, :5], heights(5, seed=3)) and not np.array_equal(many, heights(40, seed=4))


def test_noise_of_depths_has_its_standard_deviation_and_differs_from_frame_to_frame() -> None:
    scene = tl.Scene()
    scene.add_ground()
    camera = scene.add_camera(
        pos=(0, 0, 2), target=(0, 0, 0), width=64, height=64, depth_noise=(0.01, 0.005), far=20.0, name="above"
    )
    with tl.launch(scene, worlds=2, fields=(camera.depth,)) as sim:
        first = sim.reset(seed=1).above_depth.copy()
        second = sim.step().above_depth.copy()
        again = sim.reset(seed=1).above_depth.copy()
    assert np.array_equal(first, again) and not np.array_equal(first, second)
    for image in (*first, *second):
        error = image.astype(float) - 2.0
        assert abs(error.mean()) < 0.0015 and error.std() == pytest.approx(0.01 + 0.005 * 4.0, rel=0.05)
    assert abs(np.corrcoef(first[0].ravel(), second[0].ravel())[0, 1]) < 0.06
    assert abs(np.corrcoef(first[0].ravel(), first[1].ravel())[0, 1]) < 0.06


def test_a_recording_that_begins_between_two_images_is_replayed(tmp_path: Path) -> None:
    scene, camera = tumbling(every=5)
    file = tmp_path / "run.tlrec"
    with tl.launch(scene, worlds=2, fields=("joint_q", *camera.fields)) as sim:
        sim.reset(seed=3)
        for _ in range(7):
            sim.step()
        with sim.record(file):
            for _ in range(6):
                sim.step()
            state = sim.snapshot()
            for _ in range(4):
                sim.step()
            sim.restore(state)
            for _ in range(3):
                sim.step()
    subprocess.run([sys.executable, "-m", "tightloop", "replay", file], check=True)


def test_recordings_that_begin_at_different_steps_are_both_replayed(tmp_path: Path) -> None:
    scene, camera = tumbling(every=5)
    first, second = tmp_path / "first.tlrec", tmp_path / "second.tlrec"
    with tl.launch(tl.Scene(), worlds=2) as other:
        of_another_scene = other.snapshot()
    with tl.launch(scene, worlds=2, fields=("joint_q", *camera.fields)) as sim:
        sim.reset(seed=3)
        with sim.record(first):
            for _ in range(7):
                sim.step()
            with sim.record(second):
                for _ in range(6):
                    sim.step()
                with pytest.raises(tl.TightloopError):
                    sim.restore(of_another_scene)
                sim.step()
    for file in (first, second):
        subprocess.run([sys.executable, "-m", "tightloop", "replay", file], check=True)


def test_a_fault_ends_an_episode_with_its_own_image_and_the_next_one_has_another() -> None:
    scene = tl.Scene(dt=1 / 480, substeps=4)
    scene.add_ground()
    scene.add_body(name="ball", pos=(0, 0, 3))
    scene.add_sphere(body="ball", radius=0.1)
    above = scene.add_camera(pos=(0, 0, 6), target=(0, 0, 0), width=8, height=8, every=1000, name="above")
    scene.add_camera(pos=(0.5, 0, 6), target=(0.5, 0, 0), width=8, height=8, name="mounted")
    scene.randomize(cameras={name: {"z": tl.Uniform(-0.5, 0.5)} for name in ("above", "mounted")})
    fields = ("status", "body_q", above.depth, "mounted_depth")
    with tl.launch(scene, worlds=1, fields=fields[1:], bounds={"joint_qd": 3.0}, on_fault="reset") as sim:
        sim.reset(seed=1)
        shown = [sim.step().copy() for _ in range(120)]
    faulted = [int(frame.status[0]) & 8 != 0 for frame in shown]
    first = faulted.index(True)
    assert 5 < first < 100
    corner = [(frame.above_depth[0, 0, 0], frame.mounted_depth[0, 0, 0]) for frame in shown]
    # all frames of an episode, the one with the fault too, have one mount and one image; the next have others
    assert len({heights for heights in corner[: first + 1]}) == 1
    assert corner[first + 1] != corner[first] and corner[first + 1][0] != corner[first][0]


def test_observers_of_a_group_see_its_mounts() -> None:
    scene = tl.Scene()
    scene.add_ground()
    camera = scene.add_camera(pos=(0, 0, 2), target=(0, 0, 0), width=4, height=4, name="above")
    scene.randomize(cameras={"above": {"z": tl.Uniform(-0.5, 0.5)}})
    with tl.launch(scene, worlds=4, groups=2, fields=(camera.depth,)) as groups:
        frame = groups[1].reset(seed=3)
        live = Live(groups[1].name, fields=(camera.depth,))
        try:
            shown = live.poll(10.0)
            assert shown is not None and np.array_equal(shown.above_depth, frame.above_depth)
        finally:
            live.close()
