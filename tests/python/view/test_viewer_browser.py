"""The viewer's page in headless Chromium: what is seen, and what its controls do. Screenshots go to out/viewer."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import tightloop as tl
from browser import WIDE, WIDTH, View, chromium, differing, spots
from processes import started, wait_until
from tiers import sweep
from tightloop import Frame
from tightloop.view import Picture
from tightloop.view.parts import parts

START = [0.0, 0.0, 0.0, -2.4, 0.0, 2.4, 0.8, 0.04, 0.04]


@pytest.fixture(scope="module")
def browser():
    with chromium() as opened:
        yield opened


@pytest.fixture
def look(browser) -> Iterator[Callable[..., View]]:
    """Opens the page of a viewer; at the end, no error may have been in its console."""
    views: list[View] = []

    def at(url: str, width: int = WIDTH) -> View:
        views.append(View(browser, url, width))
        return views[-1]

    yield at
    for view in views:
        view.page.close()
    for view in views:
        assert view.errors == [], "\n".join(view.console)


@pytest.fixture
def arm(lesson) -> tl.Scene:
    """The lesson's Franka with drives, its table and cube."""
    scene = lesson(driven=True)
    scene.robots["arm"].joint_q = START
    scene.add_table(mu=0.8)
    scene.add_cube()
    return scene


@pytest.fixture
def box() -> tl.Scene:
    """A box that floats, and nothing else."""
    scene = tl.Scene(dt=1 / 480, substeps=8, gravity=(0, 0, 0))
    scene.add_box(half_extents=(0.1, 0.1, 0.1), body=scene.add_body(name="box", pos=(0, 0, 0.5)))
    return scene


def is_red(pixels: NDArray[np.int16]) -> NDArray[np.bool_]:
    """Where something is red: nothing of the page is, but frozen worlds."""
    red, green, blue = (pixels[..., channel] for channel in range(3))
    return (red > 100) & (red > green + 35) & (red > blue + 35)


def is_sand(pixels: NDArray[np.int16]) -> NDArray[np.bool_]:
    """Where the table is seen: nothing else has less blue than red and green, and little less."""
    red, green, blue = (pixels[..., channel] for channel in range(3))
    return (red - blue > 6) & (red - blue < 60) & (red - green < 20)


class Observer:
    """A client that only looks."""

    def __init__(self, name: str) -> None:
        self.sim = tl.attach(name)
        self.frame = self.sim.latest(5.0)

    def see(self) -> Frame:
        """The newest frame."""
        self.frame = self.sim.latest() or self.frame
        assert self.frame is not None
        return self.frame


def test_two_poses_of_an_arm_are_two_pictures_and_the_first_comes_back(arm, look, unique):
    with tl.launch(arm, worlds=1, name=unique()) as sim:
        sim.reset()
        view = look(sim.view(port=8300).url)
        view.close_notices()
        first = view.still("pose_first")
        sim.write(joint_q={"arm": [1.2, 0.4, *START[2:]]})
        view.wait(lambda: differing(view.shot(), first) > 0, "the arm moves")
        second = view.still("pose_second")
        # an arm covers some per cent of the picture
        assert differing(first, second) > 0.02 * first[..., 0].size
        sim.reset()
        view.wait(lambda: differing(view.shot(), second) > 0, "the arm moves back")
        assert differing(view.still(), first) == 0


@pytest.mark.parametrize("preset", sweep(["three-quarter", "front"], daily=1))
def test_page_and_film_have_one_ground_one_background_and_one_light(arm, look, unique, preset):
    with tl.launch(arm, worlds=1, name=unique()) as sim:
        frame = sim.reset()
        view = look(sim.view(port=8300).url)
        view.close_notices()
        view.choose("Camera", preset)
        page = view.still(f"stage_{preset}")
        scene = parts(sim.info["scene"], sim.info["scene_folder"], sim.body_names)
        film = Picture(scene, page.shape[1], page.shape[0]).render(frame, camera=preset).astype(np.int16)
        # at the left edge, where lines are a few per cent of the ground
        for name, rows in {"background": slice(0, 40), "ground": slice(290, 340)}.items():
            seen, drawn = (np.median(pixels[rows, :60].reshape(-1, 3), axis=0) for pixels in (page, film))
            assert np.abs(seen - drawn).max() <= 8, (name, seen, drawn)
        # from the background to the ground there is no horizon: lines of the grid are one or two rows
        left = np.median(page[:340, :20], axis=1)
        smooth = np.median(np.lib.stride_tricks.sliding_window_view(left, 9, axis=0), axis=-1)
        assert np.abs(np.diff(smooth, axis=0)).max() <= 4
        # the table top is the only thing that is sand-coloured; the browser's tone mapping takes a tenth of its colour
        seen, drawn = (pixels[is_sand(pixels)] for pixels in (page, film))
        assert min(len(seen), len(drawn)) > 0.03 * page[..., 0].size
        assert np.abs(np.median(seen, axis=0) - np.median(drawn, axis=0)).max() <= 25


def test_a_slider_moves_the_arm_and_pause_gives_control_back(arm, look, unique):
    with tl.launch(arm, worlds=1, name=unique()) as sim:
        sim.reset()
        sim.release()
        viewer = sim.view(port=8300)
        view = look(viewer.url)
        view.close_notices()
        before, observer = view.still(), Observer(sim.name)
        view.page.get_by_role("slider").first.focus()
        for _ in range(60):
            view.page.keyboard.press("ArrowRight")
        view.wait(lambda: observer.see().joint_q[0, 0] > 0.2, "the first joint turns")
        assert sim.controller() == viewer.pid
        view.wait(lambda: "you drive" in view.text, "the panel says who drives")
        with pytest.raises(tl.LeaseHeld, match=str(viewer.pid)):
            sim.step()
        view.wait(lambda: differing(view.shot(), before) > 0.005 * before[..., 0].size, "the page shows it")
        view.shot("slider_moved")
        view.press("Pause")
        assert wait_until(lambda: sim.controller() is None, 30)
        stood = int(sim.forward().step[0])
        assert sim.step().step[0] == stood + 1


def test_play_step_and_reset_drive_the_worlds(box, look, unique):
    with tl.launch(box, worlds=4, name=unique()) as sim:
        sim.reset()
        sim.release()
        view, observer = look(sim.view(port=8300).url), Observer(sim.name)
        for steps in (1, 2):
            view.press("Step")
            view.wait(lambda steps=steps: observer.see().step[0] == steps, f"{steps} steps are done")
        view.wait(lambda: sim.controller() is None, "a single step gives control back")
        view.press("Play")
        view.wait(lambda: observer.see().step[0] > 20, "it plays")
        view.press("Pause")
        view.wait(lambda: sim.controller() is None, "it stands still")
        view.press("Reset all")
        view.wait(lambda: observer.see().step.max() == 0, "it is reset")


def test_256_worlds_are_seen_and_a_frozen_one_is_red(box, look, unique):
    with tl.launch(box, worlds=256, name=unique(), on_nan="freeze", params=("body_f",)) as sim:
        sim.reset()
        view = look(sim.view(port=8300).url, WIDE)
        view.close_notices()
        view.choose("Camera", "top")
        assert not is_red(view.still("worlds_256")).any()
        sim.step(body_f=np.full((256, len(sim.body_names), 6), np.nan))
        view.wait(lambda: is_red(view.shot()).any(), "frozen worlds are red")
        # each world is a box that stands apart from the others
        assert len(spots(is_red(view.still("worlds_256_frozen")))) == 256
        sim.reset(mask=np.arange(256) != 7)
        view.wait(lambda: len(spots(is_red(view.shot()))) == 1, "one is left")


@pytest.mark.parametrize("worlds", sweep([16, 1], daily=1))
def test_the_worlds_fill_what_the_panel_leaves_free(box, look, unique, worlds):
    with tl.launch(box, worlds=worlds, name=unique(), on_nan="freeze", params=("body_f",)) as sim:
        sim.step(body_f=np.full((worlds, len(sim.body_names), 6), np.nan))
        view = look(sim.view(port=8300).url, WIDE)
        view.close_notices()
        view.wait(lambda: is_red(view.shot()).any(), "frozen worlds are red")
        rows, columns = np.nonzero(is_red(view.still(f"fills_{worlds}")))
        width, height = view.scene
        assert width < WIDE - 250, "the panel is beside the scene"
        across, upwards = np.ptp(columns) / width, np.ptp(rows) / height
        assert max(across, upwards) > 2 / 3
        assert columns.mean() / width == pytest.approx(0.5, abs=0.05)
        assert rows.mean() / height == pytest.approx(0.5, abs=0.1)


def test_contacts_ghosts_frames_shapes_and_plots_are_shown_when_they_are_chosen(arm, look, unique):
    with tl.launch(arm, worlds=1, name=unique()) as sim:
        for _ in range(30):
            sim.step()
        view = look(sim.view(port=8300).url)
        view.close_notices()
        before = view.still()
        for choice in ("Targets as ghosts", "Body frames", "Collision shapes"):
            view.page.get_by_label(choice, exact=True).check()
            view.wait(lambda before=before: differing(view.shot(), before) > 20, f"{choice} are shown")
            before = view.still(choice.lower().replace(" ", "_"))
        view.choose("Contacts", "followed world")
        view.wait(lambda: differing(view.shot(), before) > 3, "contacts are shown")
        view.still("contacts")
        view.page.get_by_text("Plots", exact=True).click()
        view.press("Add plot")
        view.wait(lambda: view.page.locator(".uplot").count() == 1, "a plot is drawn")
        for _ in range(30):
            sim.step()
        # in one go in the page, which draws the plot anew several times a second
        view.page.wait_for_function("(p => p && (p.scrollIntoView(), true))(document.querySelector('.uplot'))")
        view.shot("plot")


def test_the_image_of_a_camera_is_shown_when_it_is_chosen(arm, look, unique):
    arm.add_camera(pos=(1.0, -0.5, 0.9), target=(0, -0.5, 0.2), width=40, height=30, name="eye")
    with tl.launch(arm, worlds=1, name=unique()) as sim:
        sim.reset()
        view = look(sim.view(port=8300).url)
        view.close_notices()
        view.page.get_by_text("Cameras", exact=True).click()
        for field in ("eye_rgb", "eye_depth"):
            view.choose("Image", field)
            view.wait(lambda: view.page.locator("img[src^='blob:']").count() == 1, f"{field} is shown")
            sim.step()
        view.shot("camera_image")


def test_a_body_is_pulled_with_shift_and_the_mouse(box, look, unique):
    with tl.launch(box, worlds=1, name=unique(), params=("body_f",)) as sim:
        sim.reset()
        sim.release()
        view, observer = look(sim.view(port=8300).url), Observer(sim.name)
        view.close_notices()
        view.choose("Camera", "front")
        view.still()
        page, start = view.page, observer.see().body_q[0, 0, :3].copy()
        width, height = view.scene
        x, y = width / 2, height / 2
        page.keyboard.down("Shift")
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x, y - 100, steps=10)

        def follows() -> bool:
            # a page that is slow sees where the pointer is only when it moves
            page.mouse.move(x + 1, y - 100)
            page.mouse.move(x, y - 100)
            return bool(observer.see().body_q[0, 0, 2] > start[2] + 0.02)

        view.wait(follows, "the box follows the pointer upwards")
        view.shot("pulled")
        page.mouse.up()
        page.keyboard.up("Shift")


def test_while_another_is_in_control_the_page_says_who_and_can_only_look(arm, look, unique):
    with tl.launch(arm, worlds=1, name=unique()) as sim:
        sim.step()
        view = look(sim.view(port=8300).url)
        view.wait(lambda: f"process {os.getpid()} is in control" in view.text, "it says who")
        play = view.page.get_by_role("button", name="Play", exact=True)
        view.wait(play.is_disabled, "Play is disabled")
        # the thumb of a slider that is disabled is none
        view.wait(lambda: view.page.get_by_role("slider").count() == 0, "sliders are disabled")
        sim.release()
        view.wait(lambda: view.page.get_by_role("slider").count() > 0, "sliders are enabled")
        view.wait(play.is_enabled, "Play is enabled")


def test_a_page_outlives_its_daemon_and_goes_on_with_the_next_of_that_name(box, look, unique):
    name = unique()
    with tl.launch(box, worlds=1, name=name) as sim:
        sim.reset()
        command = [sys.executable, "-m", "tightloop", "view", name, "--port=8300"]
        with started(command, stdout=subprocess.PIPE, text=True) as viewer:
            assert viewer.stdout is not None
            view = look(viewer.stdout.readline().strip())
            os.kill(sim.pid, signal.SIGKILL)
            view.wait(lambda: "Daemon lost" in view.text, "it says that the daemon is gone")
            with tl.launch(box, worlds=2, name=name) as other:
                other.step()
                view.wait(lambda: "step 1" in view.text and "of 2" in view.text, "it shows the next one")
                viewer.send_signal(signal.SIGINT)
                assert viewer.wait(30) == 0


def test_a_page_says_that_the_program_that_opened_it_closed_the_run(box, look, unique):
    with tl.launch(box, worlds=1, name=unique()) as sim:
        sim.reset()
        view = look(sim.view(port=8300).url)
    view.wait(lambda: "run ended" in view.text.lower(), "it says that the run ended")
    view.errors.clear()  # the browser tries to reach the viewer again


@pytest.mark.parametrize("worlds", sweep([2, 1], daily=1))
def test_the_camera_moves_with_robots_that_leave_the_picture(box, look, unique, worlds):
    with tl.launch(box, worlds=worlds, name=unique(), on_nan="freeze", params=("body_f",)) as sim:
        sim.reset()
        view = look(sim.view(port=8300).url, WIDE)
        view.close_notices()
        moved = np.array(sim.forward().joint_q)
        for _ in range(100):
            moved[:, 1] += 0.1
            sim.write(joint_q=moved)
            sim.step()
            time.sleep(0.02)
        sim.step(body_f=np.full((worlds, len(sim.body_names), 6), np.nan))
        view.wait(lambda: is_red(view.shot()).any(), "the frozen boxes are in the picture")
        view.still(f"follows_{worlds}")


def test_what_nobody_sees_is_not_shown_and_a_page_that_comes_later_shows_what_is_now(box, look, unique):
    def mapped() -> int:
        """Pieces of shared memory that the viewer has mapped: fewer while it does not observe."""
        lines = Path(f"/proc/{viewer.pid}/maps").read_text().splitlines()
        return len({line.split()[-1] for line in lines if "/dev/shm/" in line})

    with tl.launch(box, worlds=2, name=unique()) as sim:
        viewer = sim.view(port=8290)
        first = look(viewer.url)
        sim.step()
        # a page that has just connected shows text before the viewer observes again
        first.wait(lambda: "step 1" in first.text, "the viewer observes")
        observing = mapped()
        first.page.close()
        assert wait_until(lambda: mapped() < observing, 10), "the viewer looks away"
        for _ in range(24):
            sim.step()
        second = look(viewer.url)
        second.wait(lambda: "step 25" in second.text, "the present step is shown")
        assert mapped() >= observing


def test_a_recording_plays_to_its_end_and_again(box, look, unique, tmp_path):
    file = tmp_path / "run.tlrec"
    with tl.launch(box, worlds=2, name=unique()) as sim:
        sim.reset()
        record = [sys.executable, "-m", "tightloop", "record", sim.name, str(file)]
        with started(record, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as recorder:
            assert recorder.stderr is not None and "recording" in recorder.stderr.readline()
            for _ in range(90):
                sim.step()
            time.sleep(1.0)  # so that what waits in shared memory is read
            recorder.send_signal(signal.SIGINT)
            recorder.communicate()
    command = [sys.executable, "-m", "tightloop", "view", str(file), "--port=8300"]
    with started(command, stdout=subprocess.PIPE, text=True) as viewer:
        assert viewer.stdout is not None
        view = look(viewer.stdout.readline().strip())
        view.wait(lambda: "the recording ends here" in view.text and "step 90" in view.text, "it is at its end")
        view.press("Restart")
        view.wait(lambda: "step 90" not in view.text, "it is at its begin")
        view.press("Step")
        view.press("+1 s")
        view.wait(lambda: "step 90" not in view.text and "step 6" in view.text, "a second is skipped")
        viewer.send_signal(signal.SIGTERM)
        assert viewer.wait(30) == 0
