"""Files that users name are whole or not there: on a full disk, after an error, and after SIGKILL."""

from __future__ import annotations

import gc
import os
import resource
import signal
import stat
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import av
import pytest

import tightloop as tl
from processes import started, wait_until
from tightloop.view import Film
from tightloop.whole_files import WholeFile, whole_file

COMMAND = [sys.executable, "-m", "tightloop"]
SIZE = (96, 64)
# Smaller than any file of these tests [bytes].
FULL = 64
OLD = b"what was there"


def parts_in(folder: Path) -> list[Path]:
    """The hidden files of writers, under way or left."""
    return list(folder.glob(".tightloop-*"))


def on_a_full_disk(command: list[str]) -> subprocess.CompletedProcess[str]:
    """Run a command whose files cannot grow: its writes fail, as those on a full disk do."""
    return subprocess.run(
        command,
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (FULL, FULL)),
    )


@pytest.fixture
def running(pendulum: tl.Scene, unique: Callable[[], str]):
    with tl.launch(pendulum, worlds=1, name=unique()) as sim:
        sim.reset()
        yield sim


@pytest.fixture
def recording(running: tl.Sim, tmp_path: Path) -> Path:
    file = tmp_path / "run.tlrec"
    command = [*COMMAND, "record", running.name, str(file)]
    with started(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as recorder:
        assert recorder.stderr is not None and "recording" in recorder.stderr.readline()
        for _ in range(30):
            running.step()
        running.close()
        assert recorder.wait(60) == 0
    return file


@pytest.mark.parametrize("name", ["run.png", "run.gif", "run.mp4", "run.html"])
def test_a_film_on_a_full_disk_leaves_what_was_there(recording: Path, tmp_path: Path, name: str) -> None:
    folder = tmp_path / "films"
    folder.mkdir()
    out = folder / name
    for there in (None, OLD):
        if there is not None:
            out.write_bytes(there)
        done = on_a_full_disk([*COMMAND, "film", str(recording), str(out), "--size=96x64", "--fps=10"])
        assert done.returncode == 1
        assert done.stderr.splitlines()[-1] == f"tightloop: {out}: cannot be written: File too large"
        assert [each.read_bytes() for each in folder.iterdir()] == ([] if there is None else [there])
    # with room again, the old file is replaced
    done = subprocess.run(
        [*COMMAND, "film", str(recording), str(out), "--size=96x64", "--fps=10"], capture_output=True, check=False
    )
    assert done.returncode == 0 and out.read_bytes() != OLD and [*folder.iterdir()] == [out]


def test_a_folder_of_pictures_on_a_full_disk_has_no_cut_one(recording: Path, tmp_path: Path) -> None:
    done = on_a_full_disk([*COMMAND, "film", str(recording), str(tmp_path / "all"), "--size=96x64"])
    assert done.returncode == 1 and "000000.png: cannot be written: File too large" in done.stderr
    assert not [*(tmp_path / "all").iterdir()]


@pytest.mark.parametrize("name", ["run.mp4", "run.html"])
def test_a_film_that_is_killed_leaves_what_was_there(running: tl.Sim, tmp_path: Path, name: str) -> None:
    out = tmp_path / name
    out.write_bytes(OLD)
    code = f"""
import sys, tightloop as tl
from tightloop.view import Film
sim = tl.attach({running.name!r})
film = Film({str(out)!r}, sim, size=(96, 64))
for _ in range(100): film.add(sim.step())
print("filmed", flush=True)
while True: film.add(sim.step())
"""
    running.release()
    with started([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as filming:
        assert filming.stdout is not None and filming.stdout.readline() == "filmed\n"
        filming.kill()
    assert out.read_bytes() == OLD
    assert {each.name for each in tmp_path.iterdir()} - {each.name for each in parts_in(tmp_path)} == {
        name,
        "pendulum.urdf",
    }


@pytest.mark.parametrize("name", ["run.png", "run.gif", "run.mp4", "run.html"])
def test_an_error_while_a_film_is_made_leaves_what_was_there(running: tl.Sim, tmp_path: Path, name: str) -> None:
    out = tmp_path / name
    out.write_bytes(OLD)
    film = Film(out, running, size=SIZE)
    with pytest.raises(ZeroDivisionError), film:
        if name == "run.png":
            raise ZeroDivisionError
        for _ in range(20):
            film.add(running.step())
        raise ZeroDivisionError
    film.close()
    assert out.read_bytes() == OLD and not parts_in(tmp_path)


def test_a_film_that_is_forgotten_leaves_nothing(running: tl.Sim, tmp_path: Path) -> None:
    film = Film(tmp_path / "run.mp4", running, size=SIZE)
    film.add(running.step())
    assert parts_in(tmp_path)
    del film
    gc.collect()
    assert not [*tmp_path.glob("*.mp4"), *parts_in(tmp_path)]


def test_a_film_of_a_daemon_that_ends_is_shorter_and_whole(running: tl.Sim, tmp_path: Path) -> None:
    out = tmp_path / "run.mp4"
    command = [*COMMAND, "film", running.name, str(out), "--seconds=3600", "--size=96x64", "--fps=5"]
    with started(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as filming:
        assert wait_until(lambda: bool(parts_in(tmp_path)), 120)

        def steps() -> bool:
            running.step()
            return any(part.stat().st_size > 0 for part in parts_in(tmp_path)) or filming.poll() is not None

        # the encoder writes nothing before it has some forty pictures
        wait_until(steps, 15)
        running.close()
        _, printed = filming.communicate(timeout=120)
    assert filming.returncode == 0, printed
    assert "the film ends after" in printed
    with av.open(str(out)) as container:
        assert any(True for _ in container.decode(video=0))
    assert not parts_in(tmp_path)


@pytest.mark.parametrize("what", ["scene", "snapshot", "model"])
def test_a_save_on_a_full_disk_leaves_what_was_there(
    running: tl.Sim, pendulum: tl.Scene, tmp_path: Path, what: str
) -> None:
    running.snapshot().save(tmp_path / "start")
    pendulum.save(tmp_path / "start.toml")
    (tmp_path / "model.xml").write_text('<mujoco><worldbody><body><geom size="1"/></body></worldbody></mujoco>')
    saves = {
        "scene": f"tl.Scene.load({str(tmp_path / 'start.toml')!r}).save(out)",
        "snapshot": f"tl.Snapshot.load({str(tmp_path / 'start')!r}).save(out)",
        "model": f"from tightloop.mujoco import export; export.export({str(tmp_path / 'model.xml')!r}, out)",
    }
    folder = tmp_path / "kept"
    folder.mkdir()
    out = folder / "file"
    out.write_bytes(OLD)
    done = on_a_full_disk([sys.executable, "-c", f"import tightloop as tl; out = {str(out)!r}; {saves[what]}"])
    error = {"scene": "SceneError", "snapshot": "SnapshotError", "model": "OutputError"}[what]
    assert f"{error}: {out}: cannot be written: File too large" in done.stderr
    assert [(each, each.read_bytes()) for each in folder.iterdir()] == [(out, OLD)]


def test_models_beside_a_scene_are_whole(tmp_path: Path) -> None:
    model = '<mujoco model="ball"><worldbody><body><freejoint/><geom size="1"/></body></worldbody></mujoco>'
    code = f"import tightloop as tl; tl.Scene.from_mujoco({str(tmp_path / 'ball.xml')!r})"
    (tmp_path / "ball.xml").write_text(model)
    subprocess.run([sys.executable, "-c", code], check=True)
    (tmp_path / "scene_models").mkdir()
    kept = tmp_path / "scene_models" / "ball.safetensors"
    kept.write_bytes(OLD)
    done = on_a_full_disk([sys.executable, "-c", f"{code}.save({str(tmp_path / 'scene.toml')!r})"])
    assert "SceneError" in done.stderr and "ball.safetensors" in done.stderr
    assert kept.read_bytes() == OLD and [*kept.parent.iterdir()] == [kept]


def test_a_save_that_is_killed_leaves_the_old_file(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_bytes(OLD)
    code = f"""
import os, pathlib, signal
from tightloop.whole_files import whole_file
with whole_file(pathlib.Path({str(file)!r})) as part:
    part.write_bytes(b"half of")
    os.kill(os.getpid(), signal.SIGKILL)
"""
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == -signal.SIGKILL
    assert file.read_bytes() == OLD


def test_links_and_permissions_stay(tmp_path: Path) -> None:
    file, link = tmp_path / "file", tmp_path / "link"
    link.symlink_to("file")
    with whole_file(link) as part:
        part.write_bytes(b"1")
    umask = os.umask(0)
    os.umask(umask)
    assert link.is_symlink() and stat.S_IMODE(file.stat().st_mode) == 0o666 & ~umask
    file.chmod(0o640)
    with whole_file(file) as part:
        part.write_bytes(b"2")
    assert link.read_bytes() == b"2" and stat.S_IMODE(file.stat().st_mode) == 0o640
    assert {each.name for each in tmp_path.iterdir()} == {"file", "link"}


def test_a_place_that_cannot_be_a_file_is_named(tmp_path: Path, running: tl.Sim) -> None:
    pipe = tmp_path / "pipe.gif"
    os.mkfifo(pipe)
    for wrong, said in (
        (pipe, "is there and no file"),
        (tmp_path / "nowhere" / "x", "cannot be written: No such file"),
        (tmp_path, "cannot be written: Is a directory"),
    ):
        with pytest.raises(tl.OutputError, match=said) as refused, whole_file(wrong):
            pass
        assert str(refused.value).startswith(f"{wrong}: ")
    with pytest.raises(tl.OutputError, match="no file"):
        Film(pipe, running)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_file_that_is_read_only_is_not_replaced(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_bytes(OLD)
    file.chmod(0o444)
    with pytest.raises(tl.OutputError, match="Permission denied"):
        WholeFile(file)
    assert file.read_bytes() == OLD


def test_the_child_of_a_fork_leaves_the_file_to_its_parent(tmp_path: Path) -> None:
    code = f"""
import os, pathlib
from tightloop.whole_files import WholeFile
file = WholeFile(pathlib.Path({str(tmp_path / "file")!r}))
if os.fork() == 0:
    raise SystemExit
os.wait()
file.part.write_bytes(b"whole")
file.keep()
"""
    subprocess.run([sys.executable, "-c", code], check=True)
    assert (tmp_path / "file").read_bytes() == b"whole" and not parts_in(tmp_path)
