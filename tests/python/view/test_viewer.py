"""The viewer without a browser: where worlds stand, what cameras see, who drives, how its process begins and ends."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
import urllib.request
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import viser

import tightloop as tl
from processes import alive, started, wait_until
from tightloop.view import cameras, dependencies
from tightloop.view.browser.camera_image import image_fields, picture
from tightloop.view.browser.display_options import DisplayOptions
from tightloop.view.browser.drag_spring import drag_spring
from tightloop.view.browser.frame_stream import FIELDS
from tightloop.view.browser.joints import Joint, at_targets, joints
from tightloop.view.browser.live_driver import LiveDriver
from tightloop.view.browser.player import Player
from tightloop.view.browser.plots import choices
from tightloop.view.browser.sliders import Sliders
from tightloop.view.command import main
from tightloop.view.meshes import floor, grid, paint
from tightloop.view.meshes.batched import batched_meshes
from tightloop.view.parts import Mesh, Part
from tightloop.view.poses import IDENTITY
from tightloop.view.source import Live

CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float32)
CUBE_FACES = np.array("013 032 467 475 045 051 237 276 026 064 157 173".split())
CUBE_FACES = np.array([[int(corner) for corner in face] for face in CUBE_FACES], np.uint32)


def cube(color: tuple[int, int, int, int] = (200, 100, 50, 255)) -> Mesh:
    return Mesh(CUBE, CUBE_FACES, np.tile(np.array(color, np.uint8), (12, 1)))


def part(body: int, mesh: Mesh, x: float = 0.0, shape: str = "box") -> Part:
    return Part(body, "visual", "part", np.array([x, 0, 0, 0, 0, 0, 1.0]), mesh, shape)


def test_worlds_stand_apart_and_the_first_where_it_is():
    box = grid.extent([part(0, cube()), part(-1, cube(), x=2.0)], np.array([IDENTITY]))
    assert np.allclose(box, [[0, 0, 0], [3, 1, 1]])
    places = grid.offsets(10, box)
    assert np.array_equal(places[0], [0, 0, 0])
    gaps = np.abs(places[:, None] - places[None])
    apart = (gaps[..., 0] >= 3) | (gaps[..., 1] >= 1)
    assert np.all(apart | np.eye(10, dtype=bool))


def test_a_floor_does_not_push_worlds_apart():
    floor = Mesh(CUBE * [100, 100, 0], CUBE_FACES, cube().colors)
    assert np.allclose(grid.extent([part(0, cube()), part(-1, floor, shape="plane")], np.array([IDENTITY]))[1], 1)


@pytest.mark.parametrize("preset", cameras.PRESETS)
@pytest.mark.parametrize("aspect", [0.5, 1.0, 2.0])
def test_every_preset_sees_the_whole_box_and_not_much_else(preset, aspect):
    box = np.array([[-1.0, 2.0, 0.0], [3.0, 3.0, 1.5]])
    points = np.stack(np.meshgrid(*box.T), axis=-1).reshape(-1, 3)
    seen = cameras.camera(preset, points, aspect=aspect)
    position, target = np.array(seen.position), np.array(seen.target)
    forward = (target - position) / np.linalg.norm(target - position)
    right = np.cross(forward, seen.up)
    right /= np.linalg.norm(right)
    corners = points - position
    depth = corners @ forward
    x = corners @ right / depth / np.tan(seen.fov / 2) / aspect
    y = corners @ np.cross(right, forward) / depth / np.tan(seen.fov / 2)
    assert depth.min() > 0
    # four fifths, and the same room on both sides
    extreme = max(np.abs(x).max(), np.abs(y).max())
    assert extreme == pytest.approx(0.8)
    assert max(np.ptp(x), np.ptp(y)) == pytest.approx(1.6)


def test_bodies_that_look_alike_share_a_skin_and_each_colour_is_one():
    shared, other = cube(), cube((0, 0, 255, 255))
    found = batched_meshes([part(0, shared), part(1, shared), part(2, shared), part(2, other, x=2.0)])
    assert sorted((mesh.bodies, mesh.color) for mesh in found) == [
        ((0, 1), (200, 100, 50, 255)),
        ((2,), (0, 0, 255, 255)),
        ((2,), (200, 100, 50, 255)),
    ]
    # a corner of a cube is sharp: each of its three faces has one of its own
    assert all(len(mesh.vertices) == 24 and len(mesh.faces) == 12 for mesh in found)


def test_a_mesh_of_many_colours_becomes_few_skins_of_near_ones():
    rng = np.random.default_rng(0)
    mesh = Mesh(
        CUBE, CUBE_FACES, np.concatenate([rng.integers(0, 256, (12, 3)), np.full((12, 1), 255)], 1).astype("u1")
    )
    found = batched_meshes([part(0, mesh)])
    assert 1 < len(found) <= 6
    assert sum(len(mesh.faces) for mesh in found) == 12


def test_a_mesh_is_closed_where_no_face_of_it_is_seen_from_behind():
    colors = cube().colors
    turned = CUBE_FACES.copy()
    turned[0] = turned[0][::-1]
    faces = {"whole": CUBE_FACES, "inwards": CUBE_FACES[:, ::-1], "open": CUBE_FACES[1:], "one turned": turned}
    closed = {
        name: batched_meshes([part(0, Mesh(CUBE, own, colors[: len(own)]))])[0].closed for name, own in faces.items()
    }
    # the browser hides what is behind the faces of a closed one
    assert closed == {"whole": True, "inwards": False, "open": False, "one turned": False}


def test_the_floor_of_a_page_is_the_highest_plane_or_below_everything():
    plane = Mesh(CUBE * [100, 100, 0], CUBE_FACES, cube().colors)
    high, low = (part(-1, plane, shape="plane") for _ in range(2))
    high.pose[2], low.pose[2] = 0.3, -1.0
    box = np.array([[-1, -1, -2.0], [1, 1, 1]])
    assert floor.height([low, high, part(0, cube())], box) == 0.3
    assert floor.height([part(0, cube())], box) == -2.0
    assert floor.height([], np.abs(box)) == 0.0
    assert floor.is_floor(low) and not floor.is_floor(part(0, cube()))


def test_sliders_are_of_joints_with_drives_and_go_to_their_limits(lesson):
    with tl.launch(lesson(driven=True), worlds=1) as sim:
        found = joints(sim.info)
        assert [joint.name for joint in found] == sim.dof_names
        assert (found[0].lower, found[0].upper) == (-2.7437, 2.7437)
    with tl.launch(lesson(driven=False), worlds=1) as sim:
        assert joints(sim.info) == []


def test_a_robot_at_its_targets_is_where_its_drives_take_it(lesson):
    scene = lesson(driven=True)
    scene.gravity = (0, 0, 0)
    with tl.launch(scene, worlds=1, fields=("joint_q", "joint_target_q", "body_q")) as sim:
        goal = sim.reset().joint_q[0] + np.array([0.02] * 7 + [-0.02] * 2, np.float32)
        frame = sim.step(joint_target_q=goal)
        for _ in range(240):
            frame = sim.step()
        ghost = sim.forward_kinematics(at_targets(sim.info, joints(sim.info), sim.reset().joint_q[0], goal))
        # drives without gravity end at their targets, but for dry friction over stiffness: 1e-3 rad
        assert np.allclose(ghost, frame.body_q[0], atol=2e-3)


def test_images_of_cameras_are_shown_in_colours():
    depth = np.array([[0.0, 1.0], [2.0, 4.0]], np.float32)
    near = picture("eye_depth", depth)
    assert near.shape == (320, 320, 3) and near.dtype == np.uint8
    assert near[0, 0].max() == 0 and near[0, -1, 0] > near[-1, 0, 0] > near[-1, -1, 0] > 0
    labels = picture("eye_segmentation", np.array([[-1, 0, 3]], np.int32))
    assert labels[0, 0].max() == 0 and tuple(labels[0, -1]) == paint.palette(3)[:3]
    colours = np.arange(2 * 400 * 3, dtype=np.uint8).reshape(2, 400, 3)
    assert np.array_equal(picture("eye_rgb", colours), colours)
    assert np.array_equal(picture("eye_segmentation", np.full((1, 320), -1, np.int32)), np.zeros((1, 320, 3)))


def test_a_page_offers_the_images_of_the_scenes_cameras(lesson):
    scene = lesson(driven=True)
    camera = scene.add_camera(width=8, height=6, name="eye")
    with tl.launch(scene, worlds=2) as sim:
        assert image_fields(sim.info) == list(camera.fields)
        live = Live(sim.name, fields=(*FIELDS, camera.rgb))
        try:
            sim.reset()
            shown = live.poll(10.0)
            assert shown is not None and picture(camera.rgb, shown.eye_rgb[1]).shape == (240, 320, 3)
        finally:
            live.close()


def test_fields_are_plotted_by_the_names_of_their_columns(lesson):
    with tl.launch(lesson(driven=True), worlds=1) as sim:
        known = choices(sim.info)
    assert known["joint_q"] == ["all", *sim.coord_names]
    assert known["body_q"] == sim.body_names
    assert known["contact_count"] == ["all"]
    assert "mass_matrix" not in known and "contact_pos" not in known


class Newest:
    """The newest frame, as a page has it."""

    def __init__(self, name: str) -> None:
        self.live = Live(name, 64, FIELDS)
        self.shown: Any = self.live.poll(5.0)

    def __call__(self) -> Any:
        self.shown = self.live.poll() or self.shown
        return self.shown


@pytest.fixture
def driven(lesson, unique):
    """A simulation of three worlds, a driver of it, and what it shows."""
    with tl.launch(lesson(driven=True), worlds=3, name=unique(), params=("body_f",)) as sim:
        sim.reset()
        sim.release()
        newest = Newest(sim.name)
        driver = LiveDriver(tl.attach(sim.name), newest)
        yield sim, driver, newest
        driver.close()
        newest.live.close()


def test_a_pilot_plays_in_real_time_and_gives_control_back(driven):
    sim, driver, newest = driven
    driver.play()
    assert wait_until(lambda: newest().step[0] > 60, 20)
    # never faster than asked; how much slower is for the machine to say
    assert driver.pace <= 1.1
    assert driver.controller is None, "it is this process"
    driver.pause()
    assert wait_until(lambda: sim.controller() is None, 5)
    stood = sim.forward().step[0]
    assert sim.step().step[0] == stood + 1
    driver.play()
    assert wait_until(lambda: "control" in driver.problem, 5), "the message names who is in control"
    assert not driver.playing


def test_targets_are_set_in_one_world_or_in_all(driven):
    _, driver, newest = driven
    before = np.array(newest().joint_target_q)
    driver.set_target(0, 0.5, 1, everywhere=False)
    assert wait_until(lambda: newest().joint_target_q[1, 0] == np.float32(0.5), 5)
    expected = before.copy()
    expected[1, 0] = 0.5
    assert np.array_equal(newest().joint_target_q, expected)
    driver.set_target(1, -0.25, 1, everywhere=True)
    assert wait_until(lambda: bool(np.all(newest().joint_target_q[:, 1] == np.float32(-0.25))), 5)
    expected = np.tile(expected[1], (3, 1))
    expected[:, 1] = -0.25
    assert np.array_equal(newest().joint_target_q, expected)
    driver.reset(1)
    assert wait_until(lambda: np.array_equal(newest().joint_target_q[1], before[1]), 5)
    assert np.array_equal(newest().joint_target_q[0], expected[0]), "the others keep theirs"


def test_a_grip_pulls_a_free_body_as_its_mass_asks_and_no_fixed_one(lesson):
    scene = lesson(driven=True)
    cube = scene.add_cube(pos=(0, 0, 1))
    dynamics = tl.Dynamics(scene)
    with tl.launch(scene, worlds=1) as sim:
        joint_q = sim.reset().joint_q[0]
    ends = np.array([[0, 0, 1], [0.1, 0, 1.0]])
    body = dynamics.body_names.index("cube/body")
    held = drag_spring(dynamics, (0, body), ends, joint_q, strength=1.0)
    # 400 kg/m³ of 5 cm a side are 50 g; the spring's frequency is 1.5 Hz
    assert held.stiffness == pytest.approx(0.05 * (3 * np.pi) ** 2)
    still = SimpleNamespace(body_qd=np.zeros((1, len(dynamics.body_names), 6)))
    assert held.force(still) == pytest.approx([held.stiffness * 0.1, 0, 0])
    with pytest.raises(tl.CommandRefused, match=r"arm/base.*fixed"):
        drag_spring(dynamics, (0, 0), ends, joint_q, strength=1.0)
    assert cube.name == "cube"


class Numbers:
    """A recording whose frames are numbers."""

    period = 0.01

    def __init__(self) -> None:
        self.frames = iter(range(1, 501))

    def poll(self, timeout: float = 0.0) -> Any:
        return next(self.frames, None)

    def close(self) -> None:
        self.frames = iter(())


def test_a_recording_is_played_stepped_skipped_and_begun_anew():
    player = Player(Numbers)
    player.pause()
    assert player.poll(0.0) == 1, "the first frame is shown at once"
    assert player.poll(0.0) is None
    player.step()
    assert player.poll(0.0) == 2
    player.skip(1.0)
    assert player.poll(0.0) == 102
    player.speed = float("inf")
    player.play()
    shown = []
    while player.playing:
        shown.append(player.poll(0.1))
    # as fast as it goes is faster than a frame for each look of the page
    assert shown == sorted(set(shown)) and shown[-1] == 500 and len(shown) < 100
    assert "ends here" in player.problem
    player.reset(None)
    assert player.poll(0.0) == 1


def test_a_recording_that_is_looked_at_seldom_passes_frames_over():
    player = Player(Numbers)
    assert player.poll(0.0) == 1
    time.sleep(0.06)
    assert player.poll(0.0) >= 5


def test_an_unknown_daemon_is_named_with_those_that_run(pendulum, unique, capsys, restore_signals):
    with tl.launch(pendulum, worlds=1, name=unique()) as sim:
        assert main(["nobody-of-that-name"]) == 1
        assert sim.name in capsys.readouterr().err


def test_a_missing_library_is_named_with_its_cure(monkeypatch, capsys, restore_signals):
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(tl.MissingLibrary, match=r"viser.*pip install .*\[view\]"):
        dependencies.check("viser")
    assert main(["nobody"]) == 1
    assert dependencies.INSTALL in capsys.readouterr().err


@pytest.mark.parametrize("wrong", [["a", "--port=0"], ["a", "--worlds=1025"], [], ["a", "--port=x"]])
def test_misuse_ends_with_2(wrong, capsys):
    with pytest.raises(SystemExit) as end:
        main(wrong)
    assert end.value.code == 2
    assert "usage: tightloop view" in capsys.readouterr().err


@pytest.fixture
def restore_signals():
    kept = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in kept.items():
        signal.signal(number, handler)


def served(url: str) -> bool:
    with urllib.request.urlopen(url, timeout=20) as answer:
        return b"<html" in answer.read().lower()


def test_viewers_of_a_simulation_have_ports_of_their_own_and_end_with_it(pendulum):
    with tl.launch(pendulum, worlds=1) as sim:
        first, second = sim.view(port=8350), sim.view(port=8350)
        assert first.url != second.url
        assert all(
            re.fullmatch(r"http://localhost:\d+/[\w-]{32}/", viewer.url) and served(viewer.url)
            for viewer in (first, second)
        )
        first.close()
        assert not alive(first.pid) and alive(second.pid)
        sim.step()
    assert not alive(second.pid)


def test_a_viewer_ends_when_the_process_that_started_it_is_killed(pendulum_urdf):
    code = f"""
import tightloop as tl, time
scene = tl.Scene(dt=1 / 480, substeps=4)
scene.add_urdf({str(pendulum_urdf)!r}, name="arm")
sim = tl.launch(scene, worlds=1)
print(sim.view(port=8360).pid, flush=True)
time.sleep(60)
"""
    with started([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        pid = int(process.stdout.readline())
        process.kill()
    assert wait_until(lambda: not alive(pid), 10)


def test_ctrl_c_ends_a_viewer_with_0_and_the_daemon_goes_on(pendulum, unique):
    with tl.launch(pendulum, worlds=1, name=unique()) as sim:
        command = [sys.executable, "-m", "tightloop", "view", sim.name, "--port=8370"]
        with started(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as viewer:
            assert viewer.stdout is not None and viewer.stdout.readline().startswith("http://localhost:")
            os.kill(viewer.pid, signal.SIGINT)
            assert viewer.communicate(timeout=20) == ("", "")
            assert viewer.returncode == 0
        sim.step()


def test_a_simulation_that_is_looked_at_steps_to_the_same_bits(lesson, torques):
    runs = []
    for viewed in (False, True):
        with tl.launch(lesson(driven=False), worlds=64) as sim:
            if viewed:
                sim.view(port=8380)
            for frame in range(30):
                sim.step(joint_f=torques(frame))
            runs.append(sim.forward().copy().joint_q)
    assert np.array_equal(*runs)


def test_a_slider_that_a_user_moves_keeps_its_position_until_its_event_was_handled():
    server = viser.ViserServer(host="127.0.0.1", port=8700, verbose=False)
    try:
        driven = [Joint(0, "r/a", -1.0, 1.0), Joint(1, "r/b", -1.0, 1.0)]
        sliders = Sliders(server.gui, driven, cast(LiveDriver, None), DisplayOptions(), worlds=1)
        moved, still = sliders._handles
        sliders.update(np.array([0.1, 0.2]), disabled=False)
        assert (moved.value, still.value) == (0.1, 0.2)
        # what viser does with a page's message before it starts callbacks
        moved._impl.value = 0.5
        sliders.update(np.array([0.1, 0.3]), disabled=False)
        assert (moved.value, still.value) == (0.5, 0.3)
    finally:
        server.stop()
