"""Files that a user names: read only if they are files of a sensible size, and written whole or not at all."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import tightloop as tl
from processes import started
from tightloop.mujoco import saved

COMMAND = [sys.executable, "-m", "tightloop"]
# Nothing here takes long; this only ends a test in which somebody waits for ever [s]
PATIENCE = 120
MIB = 1 << 20


def run(*line: str | Path, limit: int | None = None, environment: dict[str, str] | None = None) -> tuple[int, str]:
    """Exit code and all that was said; files may grow to `limit` bytes."""

    def limited() -> None:
        if limit is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    done = subprocess.run(
        [*COMMAND, *(os.fspath(word) for word in line)],
        capture_output=True,
        timeout=PATIENCE,
        check=False,
        preexec_fn=limited,
        env=os.environ | (environment or {}),
    )
    return done.returncode, (done.stdout + done.stderr).decode(errors="replace")


@pytest.fixture
def pipe(tmp_path: Path) -> Path:
    path = tmp_path / "pipe"
    os.mkfifo(path)
    return path


@pytest.mark.parametrize("name", ["pipe", "/dev/zero", "/dev/null", "/proc/self/maps", "folder"])
def test_what_is_no_file_is_refused_by_name_and_not_waited_for(tmp_path, pipe, name):
    (tmp_path / "folder").mkdir()
    path = tmp_path / name
    readers: list[tuple[Callable[[], object], type[Exception]]] = [
        (lambda: tl.Snapshot.load(path), tl.SnapshotError),
        (lambda: tl.Scene.load(path), tl.SceneError),
        (lambda: tl.Scene().add_urdf(path), tl.UrdfError),
        (lambda: tl.Scene().add_mujoco(path), tl.SceneError),
        (lambda: tl.Scene().add_hfield(path, size=(1, 1), base=1), tl.SceneError),
        (lambda: saved.read(path, ["body_parentid"]), tl.SceneError),
    ]
    for read, error in readers:
        with pytest.raises(error, match=r"not a file|no file|Is a directory") as caught:
            read()
        assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    "line",
    [
        ["serve", "PATH"],
        ["bench", "PATH"],
        ["inspect", "PATH"],
        ["inspect", "MODEL"],
        ["replay", "PATH"],
        ["film", "PATH.tlrec", "film.mp4"],
    ],
    ids=" ".join,
)
def test_no_command_waits_for_a_pipe(tmp_path, pipe, line):
    for name in ("pipe.safetensors", "pipe.tlrec"):
        os.mkfifo(tmp_path / name)
    places = {"PATH": pipe, "MODEL": tmp_path / "pipe.safetensors", "PATH.tlrec": tmp_path / "pipe.tlrec"}
    code, said = run(*(places.get(word, word) for word in line))
    assert code != 0 and "Traceback" not in said
    assert "not a file" in said or "is no file" in said, said


def test_a_scene_beyond_the_limit_is_refused_and_a_long_line_is_not_repeated(tmp_path, unique):
    path = tmp_path / "scene.toml"
    path.write_text("a" * (20 * MIB))
    with pytest.raises(tl.SceneError) as caught:
        tl.Scene.load(path)
    assert str(path) in str(caught.value) and len(str(caught.value)) < 10_000
    path.write_text(f"dt = 0.1\nsubsteps = 1\n{'b' * MIB} = 1\n")
    with pytest.raises(tl.SceneError, match=r"unknown field(.|\n)*expected one of(.|\n)*contact_sensor") as caught:
        tl.Scene.load(path)
    assert len(str(caught.value)) < 10_000
    with path.open("wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(tl.SceneError, match="larger than the limit of 32 MiB"):
        tl.Scene.load(path)
    # standard input has no size
    with Path("/dev/zero").open("rb") as endless:
        done = subprocess.run(
            [*COMMAND, "serve", "-", "--name", unique()],
            stdin=endless,
            capture_output=True,
            timeout=PATIENCE,
            check=False,
        )
    assert done.returncode == 1 and b"larger than the limit of 32 MiB" in done.stdout


def test_xml_that_is_no_robot_is_an_error_with_the_cure(tmp_path):
    path = tmp_path / "page.xml"
    path.write_text("<html></html>")
    for command in ("serve", "bench"):
        code, said = run(command, path)
        assert code == 1 and f"{path}: this is XML and not a scene" in said, said
        assert "TOML parse error" not in said and "name a URDF file in a scene file" in said


def test_a_robot_is_served_as_it_is(pendulum_urdf, unique):
    name = unique()
    line = [sys.executable, "-m", "tightloop", "serve", str(pendulum_urdf), "--worlds", "2", "--name", name]
    with started(line, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        assert process.stdout is not None
        assert f'"name":"{name}"' in process.stdout.readline()
        with tl.attach(name) as sim:
            assert sim.step().joint_q.shape == (2, 2)
        process.terminate()


def test_a_snapshot_is_not_read_to_find_out_that_it_is_none(tmp_path):
    path = tmp_path / "sparse"
    with path.open("wb") as file:
        file.truncate(1 << 35)
    with pytest.raises(tl.SnapshotError, match="this is no snapshot"):
        tl.Snapshot.load(path)
    with path.open("r+b") as file:
        file.truncate(1 << 37)
    with pytest.raises(tl.SnapshotError, match="larger than the limit of 64 GiB"):
        tl.Snapshot.load(path)


def test_a_height_field_beyond_the_limit_is_neither_read_nor_written(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    sparse = tmp_path / "sparse.npy"
    np.save(sparse, np.zeros((2, 2)))
    with sparse.open("r+b") as file:
        file.truncate(1 << 40)
    with pytest.raises(tl.SceneError, match="larger than the limit of 128 MiB") as caught:
        tl.Scene().add_hfield(sparse, size=(1, 1), base=1)
    assert str(sparse) in str(caught.value)
    # of one number that is repeated: neither copied nor written to find out
    large = np.broadcast_to(np.float64(0), (1 << 20, 1 << 20))
    with pytest.raises(tl.SceneError, match="has 1099511627776 elevations, more than 16777216; make it coarser"):
        tl.Scene().add_hfield(large, size=(1, 1), base=1)
    assert not (tmp_path / "cache").exists()


SAVE = """
import sys
import tightloop as tl
scene = tl.Scene.load(sys.argv[1])
for index in range(400):
    scene.add_box(half_extents=[1, 1, 1], name=f"box{index}", pos=[index, 0, 0])
try:
    scene.save(sys.argv[2])
except tl.SceneError as error:
    print(error)
else:
    raise SystemExit("it was saved")
"""


def test_a_scene_that_cannot_be_saved_leaves_the_one_that_was_there(pendulum, tmp_path):
    path = tmp_path / "scene.toml"
    pendulum.save(path)
    before = path.read_bytes()
    done = subprocess.run(
        [sys.executable, "-c", SAVE, path, path],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (8192, 8192)),
    )
    assert done.returncode == 0 and "cannot be written: File too large" in done.stdout, done.stderr
    assert path.read_bytes() == before
    assert [entry.name for entry in tmp_path.iterdir() if entry.name.startswith(".")] == []


def test_a_picture_and_pages_that_cannot_be_written_leave_no_part(pendulum_urdf, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    picture = out / "picture.png"
    assert run("inspect", pendulum_urdf, "--png", picture)[0] == 0
    before = picture.read_bytes()
    code, said = run("inspect", pendulum_urdf, "--png", picture, limit=4096)
    assert code == 1 and "File too large" in said, said
    assert picture.read_bytes() == before and [entry.name for entry in out.iterdir()] == [picture.name]
    pages = tmp_path / "pages"
    code, said = run("man", pages, limit=1024)
    assert code == 1 and "File too large" in said, said
    assert list(pages.iterdir()) == []
    assert run("man", pages)[0] == 0
    assert (pages / "tightloop.1").stat().st_size > 1024
    assert not [entry.name for entry in pages.iterdir() if entry.name.startswith(".")]


def test_results_that_cannot_be_printed_are_an_error(pendulum_urdf):
    for line in (["inspect", str(pendulum_urdf), "--json"], ["completions", "bash"], ["man"], ["list"]):
        with Path("/dev/full").open("wb") as full:
            done = subprocess.run(
                [*COMMAND, *line], stdout=full, stderr=subprocess.PIPE, timeout=PATIENCE, check=False, text=True
            )
        if line == ["list"] and done.returncode == 0:
            continue  # no daemon runs, and nothing is printed
        assert done.returncode == 1 and "write to standard output: No space left" in done.stderr, (line, done.stderr)


@pytest.mark.parametrize("variable", ["TIGHTLOOP_ROOT", "XDG_RUNTIME_DIR"])
def test_a_root_that_is_not_utf_8_is_refused_by_name(pendulum, tmp_path, unique, monkeypatch, variable):
    pendulum.save(tmp_path / "scene.toml")
    monkeypatch.delenv("TIGHTLOOP_ROOT", raising=False)
    root = os.fsdecode(os.fsencode(tmp_path) + b"/r\xff")
    Path(root).mkdir(mode=0o700)
    code, said = run("serve", tmp_path / "scene.toml", "--name", unique(), environment={variable: root})
    assert code == 1 and "panicked" not in said and "Traceback" not in said, said
    assert "cannot be used: its path is not UTF-8; set TIGHTLOOP_ROOT" in said, said
    monkeypatch.setenv(variable, root)
    with pytest.raises(tl.LaunchError, match="its path is not UTF-8"):
        tl.launch(pendulum, worlds=1)
