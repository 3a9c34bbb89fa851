"""The tour: each stop for a moment, and what it says held against the records and marks that it quotes."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import tightloop as tl
from conftest import PENDULUM, REPOSITORY, URDF
from tightloop.assets import Policy
from tightloop.demo import lesson, tour
from tightloop.demo.any_file import FileScene
from tightloop.demo.command import main
from tightloop.demo.scenes import SCENES, DemoScene, Grasp, Many, Target, Torque, Trained
from tightloop.errors import MissingLibrary
from tightloop.view import dependencies

DATA = REPOSITORY / "tests/data"


def ran(stop: DemoScene, frames: int) -> str:
    """What a stop has to say after so many frames of a round."""
    stop.open(None, "cpu", 1)
    try:
        stop.begin()
        for _ in range(frames):
            stop.advance()
        return stop.summary()
    finally:
        stop.close()


def number(pattern: str, told: str) -> float:
    """The number that a pattern finds."""
    found = re.search(pattern, told)
    assert found, told
    return float(found[1].replace(",", ""))


@pytest.mark.parametrize("name", [stop.name for stop, _ in SCENES])
def test_each_stop_tells_a_line_and_leaves_a_picture(name, tmp_path, capsys):
    assert main(["--stop", name, "--seconds", "0.01", "--worlds", "3", "--device", "cpu", "--out", str(tmp_path)]) == 0
    said = capsys.readouterr()
    (line,) = said.out.splitlines()
    assert re.match(rf"{name} +3 \S.*: [\d,]+ physics steps/s; .*{name}\.png$", line)
    with Image.open(tmp_path / f"{name}.png") as image:
        assert image.size == (1280, 720)
        # the arm stands out from its surroundings
        assert len(np.unique(np.asarray(image).reshape(-1, 3), axis=0)) > 50


def test_one_command_goes_through_the_stops_in_order(tmp_path):
    command = [sys.executable, "-m", "tightloop", "demo", "--stop", "target", "--stop", "torque", "--seconds", "0.01"]
    command += ["--worlds", "2", "--device", "cpu", "--out", str(tmp_path / "new/folder")]
    said = subprocess.run(command, capture_output=True, text=True, check=True)
    assert [line.split()[0] for line in said.stdout.splitlines()] == ["torque", "target"]
    assert sorted(path.name for path in (tmp_path / "new/folder").iterdir()) == ["target.png", "torque.png"]


# As in test_reference.py: what two honest implementations differ by in single precision
@pytest.mark.parametrize(("stop", "frames", "tolerance"), [(Torque, 60, 5e-5), (Target, 180, 2e-6), (Grasp, 90, 1e-5)])
def test_world_0_is_as_far_from_mujoco_as_is_reported(stop, frames, tolerance):
    told = ran(stop(2), frames)
    assert 0 < number(r"within (\S+) rad of MuJoCo C", told) <= tolerance
    assert f"over {frames / 60:.2g} s" in told


def test_slippery_cubes_stay_down_and_others_are_lifted():
    told = ran(Grasp(8), lesson.FRAMES)
    assert "6 of 8 cubes are up (0 of them at friction 0.1)" in told


def test_the_policy_does_what_it_learned():
    told = ran(Trained(64), Trained.frames)
    # 84% in training (examples/trained); a share of 64 worlds is off by less than three standard deviations of 4.6%
    assert number(r"^(\d+)%", told) >= 70


def test_rates_are_steps_over_seconds():
    stop = Many(5)
    told = ran(stop, 4)
    assert stop.rate() == pytest.approx(5 * 8 * 4 / stop.seconds)
    assert number(r"^([\d,]+) s of robot time", told) == pytest.approx(5 * 4 / 60 / stop.seconds, abs=0.5)


def test_the_wave_begins_at_the_start_and_neighbours_differ():
    np.testing.assert_allclose(lesson.wave(0, 16, 4)[:, :7], np.tile(lesson.START[:7], (16, 1)))
    later = lesson.wave(60, 16, 4).reshape(4, 4, 9)
    for axis in (0, 1):
        assert (np.abs(np.diff(later[..., :2], axis=axis)).max(axis=-1) > 0.01).all()
    limits = {0: 2.7, 1: 1.7, 3: (-3.0, -0.15), 5: (0.6, 4.5)}
    for frame in range(0, 180, 5):
        goal = lesson.wave(frame, 64, 8)
        assert (np.abs(goal[:, 0]) < limits[0]).all() and (np.abs(goal[:, 1]) < limits[1]).all()
        for joint in (3, 5):
            low, high = limits[joint]
            assert ((low < goal[:, joint]) & (goal[:, joint] < high)).all()


def test_the_record_is_that_of_the_tests():
    for name, file, coords in (("target", "target", 9), ("torque", "torque_free", 9), ("grasp", "grasp", 16)):
        rows = np.loadtxt(DATA / f"mujoco_{file}.csv", delimiter=",")
        assert np.array_equal(lesson.record(name), rows[:, 1 : 1 + coords])
    goals = np.loadtxt(DATA / "grasp_targets.csv", delimiter=",", dtype=np.float32)
    assert np.array_equal(lesson.record("goals"), goals)


def test_a_policy_is_two_layers_of_elu_after_a_normaliser(tmp_path):
    rng = np.random.default_rng(1)
    sizes = [(5, 3), (5, 5), (2, 5)]
    weights = [rng.normal(size=size).astype(np.float32) for size in sizes]
    biases = [rng.normal(size=size[0]).astype(np.float32) for size in sizes]
    mean, scale = np.array([1, 2, 3], np.float32), np.array([0.1, 1, 10], np.float32)
    arrays: dict[str, Any] = {f"weight{place}": weight for place, weight in enumerate(weights)}
    arrays |= {f"bias{place}": bias for place, bias in enumerate(biases)}
    np.savez(tmp_path / "policy.npz", mean=mean, scale=scale, **arrays)
    obs = rng.normal(size=(7, 3)).astype(np.float32) * 5
    x = np.clip((obs.astype(float) - mean) / scale, -10, 10)
    for place in range(3):
        x = x @ weights[place].T.astype(float) + biases[place]
        if place < 2:
            x = np.where(x > 0, x, np.exp(np.minimum(x, 0)) - 1)
    got = Policy(tmp_path / "policy.npz")(obs)
    assert got.dtype == np.float32
    # a few hundred roundings of numbers around 100
    np.testing.assert_allclose(got, x, rtol=1e-4, atol=1e-3)


@pytest.mark.parametrize(
    "arguments", [["--stop", "lunch"], ["--seconds", "0"], ["--seconds", "nan"], ["--worlds", "0"], ["--port", "x"]]
)
def test_wrong_arguments_are_refused(arguments, capsys):
    with pytest.raises(SystemExit) as refused:
        main(arguments)
    assert refused.value.code == 2
    assert arguments[0] in capsys.readouterr().err


def test_an_error_is_one_line(tmp_path, capsys):
    assert main(["--stop", "torque", "--device", "gpu:no such adapter", "--out", str(tmp_path)]) == 1
    assert capsys.readouterr().err.startswith("tightloop: ")
    (tmp_path / "file").write_text("")
    assert main(["--stop", "torque", "--out", str(tmp_path / "file")]) == 1
    assert "file" in capsys.readouterr().err


def test_without_the_libraries_of_pictures_there_are_numbers(tmp_path, capsys, monkeypatch):
    def missing(*modules: str) -> None:
        raise MissingLibrary(f"the viewer needs `{modules[0]}`: {dependencies.INSTALL}")

    monkeypatch.setattr(dependencies, "check", missing)
    assert main(["--stop", "torque", "--seconds", "0.01", "--worlds", "2", "--out", str(tmp_path)]) == 0
    said = capsys.readouterr()
    assert "physics steps/s" in said.out and dependencies.INSTALL in said.err
    assert not list(tmp_path.iterdir())


class _Page:
    """What a viewer was asked to show."""

    def __init__(self, name: str, **options: object) -> None:
        self.name, self.url = name, "http://nowhere"
        opened.append(self)

    def close(self) -> None:
        self.closed = True


opened: list[_Page] = []


def test_one_page_follows_all_stops(tmp_path, monkeypatch, capsys):
    process = pytest.importorskip("tightloop.sim.viewer_process")
    monkeypatch.setattr(process, "Viewer", _Page)
    names = []
    stops = [Torque(2), Trained(2)]
    for stop in stops:
        begin = stop.begin
        monkeypatch.setattr(stop, "begin", lambda stop=stop, begin=begin: (names.append(stop.sim.name), begin()))
    plan = tour.Plan(Path(tmp_path), seconds=0.3, view=True, port=8123, device="cpu", threads=1)
    opened.clear()
    tour.tour(stops, plan)
    (page,) = opened
    assert page.closed and set(names) == {page.name} and len(names) >= 2
    assert "http://nowhere" in capsys.readouterr().out
    # in real time: 0.3 s are 18 frames at 60 Hz, not thousands
    assert 1 <= stops[0].done <= 19


@pytest.mark.parametrize("file", ["robot.urdf", "cart.xml", "scene.toml"])
def test_any_file_has_a_demo_and_a_benchmark(tmp_path, file):
    path = tmp_path / file
    if file == "robot.urdf":
        path.write_text(PENDULUM)
    elif file == "cart.xml":
        pytest.importorskip("mujoco")
        shutil.copy(REPOSITORY / "examples/assets/cart/cart.xml", path)
    else:
        scene = tl.Scene()
        scene.add_urdf(URDF, name="arm")
        scene.save(path)
    for command in (["demo", "--out", str(tmp_path / "out"), "--seconds", "1"], ["bench", "--worlds", "16", "--json"]):
        line = [sys.executable, "-m", "tightloop", command[0], str(path), *command[1:]]
        done = subprocess.run(line, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / f"{path.stem}.png").stat().st_size > 2000


@pytest.mark.parametrize(
    ("efforts", "said"),
    [
        ((9, 9), r"worlds of robot\.urdf, which follow waves$"),
        ((0, 0), r'which hang: each joint has effort="0" in its <limit>.*give the effort in the file$'),
        ((9, 0), r'of which 1 of 2 joints follow waves: `b` and each other has effort="0".*in the file$'),
        ((), r"which has no joint that could follow waves$"),
    ],
)
def test_the_demo_of_a_robot_says_whether_its_joints_can_follow(tmp_path, efforts, said):
    inertial = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    joints = [
        f'<link name="l{name}">{inertial}</link><joint name="{name}" type="revolute"><parent link="base"/>'
        f'<child link="l{name}"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="{effort}" velocity="1"/>'
        "</joint>"
        for name, effort in zip("ab", efforts, strict=False)
    ]
    (tmp_path / "robot.urdf").write_text(f'<robot name="r"><link name="base"/>{"".join(joints)}</robot>')
    assert re.search(said, FileScene(tmp_path / "robot.urdf", 4).title)


def test_a_file_that_is_none_is_reported(tmp_path):
    line = [sys.executable, "-m", "tightloop", "demo", str(tmp_path / "nowhere.urdf")]
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    assert done.returncode == 1 and "nowhere.urdf" in done.stderr and "Traceback" not in done.stderr
