"""Films: as many pictures as there should be, of the right size and at the right times, from each kind of source."""

from __future__ import annotations

import itertools
import signal
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image, ImageSequence

import tightloop as tl
from processes import started, wait_until
from tightloop.view import Film, Picture, film
from tightloop.view.parts import parts

COMMAND = [sys.executable, "-m", "tightloop"]
SIZE = (96, 64)
DT, SUBSTEPS = 1 / 240, 4
PERIOD = DT * SUBSTEPS


@pytest.fixture
def scene() -> tl.Scene:
    scene = tl.Scene(dt=DT, substeps=SUBSTEPS, gravity=(0, 0, 0))
    cube = scene.add_body(name="cube", pos=(0, 0, 0.5))
    scene.add_box(half_extents=(0.2, 0.2, 0.2), body=cube)
    return scene


def spin(sim: tl.Sim) -> tl.Frame:
    """Worlds that turn from now on, each about its own axis: always to be seen, and never the same."""
    return sim.write(joint_qd=[[0, 0, 0, 1, 2 * world, 3] for world in range(sim.worlds)])


def pictures_of(path: Path) -> list[NDArray[np.uint8]]:
    """All pictures of a file or folder."""
    if path.is_dir():
        return [np.asarray(Image.open(file)) for file in sorted(path.iterdir())]
    if path.suffix.lower() == ".mp4":
        with av.open(str(path)) as container:
            return [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    with Image.open(path) as image:
        return [np.asarray(frame.convert("RGB")) for frame in ImageSequence.Iterator(image)]


def moves(pictures: list[NDArray[np.uint8]]) -> bool:
    """Whether each picture differs from the one before."""
    return all(
        np.abs(before.astype(int) - after).sum(axis=-1).max() > 30 for before, after in itertools.pairwise(pictures)
    )


@pytest.mark.parametrize("out", ["run.gif", "run.MP4", "run", "run.png", "RUN.PNG"])
def test_frames_become_pictures_at_their_times(scene: tl.Scene, tmp_path: Path, out: str) -> None:
    with tl.launch(scene, worlds=2) as sim, Film(tmp_path / out, sim, size=SIZE, fps=20) as made:
        made.add(spin(sim))
        for _ in range(29):
            made.add(sim.step())
        # 29 periods of 1/60 s; a picture at the begin and every third frame
        assert made.pictures == (1 if out.lower() == "run.png" else 10)
        assert made.seconds == pytest.approx(29 * PERIOD)
    pictures = pictures_of(tmp_path / out)
    assert len(pictures) == made.pictures
    assert all(picture.shape == (SIZE[1], SIZE[0], 3) for picture in pictures)
    assert moves(pictures)


def test_a_film_keeps_the_pace(scene: tl.Scene, tmp_path: Path) -> None:
    with tl.launch(scene, worlds=1) as sim:
        for out, fps in (("a.gif", 30.0), ("a.mp4", 29.97)):
            with Film(tmp_path / out, sim, size=SIZE, fps=fps, speed=2.0) as made:
                made.add(spin(sim))
                for _ in range(240):
                    made.add(sim.step())
            # four seconds of the run are two of the film
            assert made.pictures == int(2.0 * fps) + 1
    with Image.open(tmp_path / "a.gif") as image:
        lengths = [frame.info["duration"] for frame in ImageSequence.Iterator(image)]
    assert sum(lengths) == pytest.approx(1000 * 61 / 30, abs=10)
    with av.open(str(tmp_path / "a.mp4")) as container:
        assert float(container.streams.video[0].average_rate or 0) == pytest.approx(29.97, rel=1e-4)
        assert container.streams.video[0].codec_context.pix_fmt == "yuv420p"


def test_frames_far_apart_stand(scene: tl.Scene, tmp_path: Path) -> None:
    with tl.launch(scene, worlds=1) as sim, Film(tmp_path / "slow", sim, size=SIZE, fps=10) as made:
        made.add(spin(sim))
        made.add(sim.step(), 0.05)
        assert made.pictures == 1
        sim.step()
        made.add(sim.step(), 0.35)
        assert made.pictures == 5
    pictures = pictures_of(tmp_path / "slow")
    assert not moves(pictures[1:]) and moves(pictures[:2])


class Recording:
    """A recorded run of two worlds, and what was seen of it."""

    def __init__(self, scene: tl.Scene, folder: Path, name: str) -> None:
        self.path = folder / "run.tlrec"
        self.frames: list[tl.FrameCopy] = []
        with tl.launch(scene, worlds=2, name=name) as sim:
            command = [*COMMAND, "record", name, str(self.path)]
            with started(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as recorder:
                assert recorder.stderr is not None
                assert "recording" in recorder.stderr.readline()
                self.frames.append(sim.reset().copy())
                self.frames.append(spin(sim).copy())
                self.frames += [sim.step().copy() for _ in range(58)]
                sim.close()
                assert recorder.wait(30) == 0
            self.parts = parts(sim.info["scene"], sim.info["scene_folder"], sim.body_names)

    def pictures(self, numbers: list[int], **options: Any) -> list[NDArray[np.uint8]]:
        picture = Picture(self.parts, *SIZE)
        return [picture.render(self.frames[number], contacts=False, **options) for number in numbers]


@pytest.fixture
def recording(scene: tl.Scene, tmp_path: Path, unique: Callable[[], str]) -> Recording:
    return Recording(scene, tmp_path, unique())


def test_a_recording_becomes_the_pictures_of_its_frames(recording: Recording, tmp_path: Path) -> None:
    made = film(recording.path, tmp_path / "all", size=SIZE, fps=6, world=1, contacts=False)
    # 60 frames, one in ten
    assert made.pictures == 6
    expected = recording.pictures([0, 10, 20, 30, 40, 50], worlds=[1], world=1)
    for found, own in zip(pictures_of(tmp_path / "all"), expected, strict=True):
        np.testing.assert_array_equal(found, own)
    film(recording.path, tmp_path / "part", size=SIZE, fps=12, at=0.25, seconds=0.5, worlds=2, contacts=False)
    found = pictures_of(tmp_path / "part")
    np.testing.assert_array_equal(found, recording.pictures([15, 20, 25, 30, 35, 40]))
    film(recording.path, tmp_path / "one.png", size=SIZE, at=0.5, contacts=False)
    np.testing.assert_array_equal(pictures_of(tmp_path / "one.png"), recording.pictures([30], worlds=[0]))


def test_the_command_line_films_recordings(recording: Recording, tmp_path: Path) -> None:
    command = [*COMMAND, "film", str(recording.path)]
    out = tmp_path / "run.mp4"
    done = subprocess.run(
        [*command, str(out), "--size=96x64", "--worlds=2"], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout.strip(), done.stderr) == (0, str(out), "")
    pictures = pictures_of(out)
    assert len(pictures) == 30 and pictures[0].shape == (64, 96, 3)
    for wrong, said, code in (
        (["run.avi"], ".mp4", 1),
        (["odd.mp4", "--size=95x64"], "even", 1),
        (["x.gif", "--world=2"], "world 2", 1),
        (["x.png", "--at=7"], "0.983333 s", 1),
        (["x.png", "--camera=behind"], "three-quarter", 2),
        (["x.png", "--size=big"], "640x480", 2),
    ):
        arguments = [str(tmp_path / wrong[0]), *wrong[1:]]
        done = subprocess.run([*command, *arguments], capture_output=True, text=True, check=False)
        assert done.returncode == code and said in done.stderr, (wrong, done.stderr)
        assert not (tmp_path / wrong[0]).exists()


def test_a_daemon_is_filmed_as_it_runs(scene: tl.Scene, tmp_path: Path, unique: Callable[[], str]) -> None:
    name = unique()
    with tl.launch(scene, worlds=3, name=name) as sim:
        spin(sim)
        out = tmp_path / "live.gif"
        command = [*COMMAND, "film", name, str(out), "--seconds=1", "--fps=10", "--size=96x64"]
        with started(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as filming:
            while filming.poll() is None:
                sim.step()
            _, news = filming.communicate()
            assert filming.returncode == 0, news
        with Image.open(out) as image:
            lengths = [frame.info["duration"] for frame in ImageSequence.Iterator(image)]
        # a second of it, where equal pictures are one
        assert sum(lengths) == 1000 and 1 < len(lengths) <= 10
        with started([*command[:5], str(tmp_path / "cut"), "--seconds=60"], stdout=subprocess.PIPE) as filming:
            assert wait_until(lambda: any((tmp_path / "cut").glob("*.png")), 60)
            filming.send_signal(signal.SIGINT)
            assert filming.wait(20) == 0
        assert len(pictures_of(tmp_path / "cut")) < 60 * 30
        made = film(sim, tmp_path / "now.png", size=SIZE)
        assert made.pictures == 1 and pictures_of(tmp_path / "now.png")[0].shape == (64, 96, 3)
    with pytest.raises(tl.UnknownDaemon, match=name):
        film(name, tmp_path / "gone.png")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"out": "run.avi"}, ".mp4"),
        ({"out": 7}, "out"),
        ({"fps": 0}, "fps"),
        ({"speed": -1}, "speed"),
        ({"worlds": [0, 9]}, "world 9"),
        ({"worlds": []}, r"worlds is \[\]"),
        ({"world": -1}, "world"),
        ({"camera": "behind"}, "three-quarter"),
        ({"kind": "nice"}, "collision"),
        ({"size": (8, 8)}, "width"),
        ({"out": "run.mp4", "size": (33, 32)}, "even"),
    ],
)
def test_wrong_arguments_are_named_and_nothing_is_written(
    scene: tl.Scene, tmp_path: Path, options: dict[str, Any], said: str
) -> None:
    out = options.pop("out", "run.gif")
    with tl.launch(scene, worlds=2) as sim, pytest.raises(tl.ArgumentError, match=said):
        Film(out if isinstance(out, int) else tmp_path / out, sim, **options)  # pyright: ignore[reportArgumentType]
    assert not list(tmp_path.iterdir())


def test_a_folder_with_files_stays_as_it_is(scene: tl.Scene, tmp_path: Path) -> None:
    (tmp_path / "000000.png").write_text("somebody's picture")
    with tl.launch(scene, worlds=1) as sim:
        with pytest.raises(tl.ArgumentError, match=r"000000\.png"):
            Film(tmp_path, sim)
        assert (tmp_path / "000000.png").read_text() == "somebody's picture"
        (tmp_path / "000000.png").unlink()
        with Film(tmp_path, sim, size=SIZE) as made:
            made.add(sim.reset())
        with pytest.raises(tl.ArgumentError, match="no folder"):
            Film(tmp_path / "nowhere" / "run.gif", sim)
        with pytest.raises(tl.ArgumentError, match="at most 50"):
            Film(tmp_path / "run.gif", sim, fps=60)
        assert "4 worlds" in " ".join(Film(tmp_path / "run.gif", sim, worlds=4, fps=20).notes)
    assert len(pictures_of(tmp_path)) == 1


def test_an_error_in_the_block_says_that_the_film_is_lost(scene: tl.Scene, tmp_path: Path) -> None:
    def fail(out: str) -> None:
        with tl.launch(scene, worlds=1) as sim, Film(tmp_path / out, sim, size=SIZE, fps=20) as made:
            for _ in range(10):
                made.add(sim.step())
            raise RuntimeError("mine")

    for out in ("run.gif", "run.html"):
        with (
            pytest.warns(UserWarning, match=rf"{out} is not written.*RuntimeError.*after [2-9] picture.*close") as told,
            pytest.raises(RuntimeError, match="mine"),
        ):
            fail(out)
        assert Path(told[0].filename) == Path(__file__)
        assert not list(tmp_path.iterdir())
    # these have their pictures already
    for out in ("run.png", "folder"):
        with warnings.catch_warnings(), pytest.raises(RuntimeError, match="mine"):
            warnings.simplefilter("error")
            fail(out)
        assert pictures_of(tmp_path / out)


def test_a_page_is_one_file_that_needs_no_other(scene: tl.Scene, tmp_path: Path) -> None:
    out = tmp_path / "run.html"
    with tl.launch(scene, worlds=4) as sim, Film(out, sim, worlds=4, fps=20) as made:
        for _ in range(30):
            made.add(sim.step())
    assert made.pictures == 10
    text = out.read_text()
    assert text.lstrip().lower().startswith("<!doctype html>") and "__VISER_EMBED_DATA__" in text
    assert 'src="http' not in text and 'href="http' not in text
