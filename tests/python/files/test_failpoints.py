"""Whatever call of the system fails, the old file or the new one is whole, and the error names the file."""

from __future__ import annotations

import errno
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import tightloop as tl
from failpoints import REMOVALS, Failpoint, Run, failpoints, is_supported, run
from processes import started
from tiers import sweep

pytestmark = pytest.mark.skipif(not is_supported(), reason="no process may filter the system calls of another one here")

COMMAND = [sys.executable, "-m", "tightloop"]
OLD = b"what was there"
SCENE = "import tightloop as tl; tl.Scene.load({scene!r}).save({out!r})"
WHOLE = """
import pathlib, tightloop.whole_files
with tightloop.whole_files.whole_file(pathlib.Path({out!r})) as part:
    part.write_text("new")
"""
STEPS = """
import select, sys, tightloop as tl
with tl.launch(tl.Scene.load(sys.argv[1]), worlds=1, name=sys.argv[2], device="cpu") as sim:
    sim.reset()
    print("ready", flush=True)
    while not select.select([sys.stdin], [], [], 0.002)[0]:
        sim.step()
"""


@pytest.fixture
def scene(pendulum: tl.Scene, tmp_path: Path) -> Path:
    pendulum.save(tmp_path / "scene.toml")
    return tmp_path / "scene.toml"


@pytest.fixture
def stepping(scene: Path, unique: Callable[[], str]) -> Iterator[str]:
    """Name of a daemon that steps all the time."""
    name = unique()
    command = [sys.executable, "-c", STEPS, scene, name]
    with started(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as client:
        assert client.stdin is not None and client.stdout is not None and client.stdout.readline() == "ready\n"
        yield name
        client.stdin.close()
        assert client.wait(20) == 0


def each_call(command: list[str], out: Path, there: bytes | None) -> Iterator[tuple[Failpoint, Run]]:
    """Run a command that writes a file once for each of its calls and each error, and check what stays."""
    folder = out.parent

    def begin() -> None:
        for left in folder.iterdir():
            left.unlink()
        if there is not None:
            out.write_bytes(there)

    begin()
    whole = run(command, [folder])
    assert whole.code == 0 and whole.calls, whole.err
    for failpoint in failpoints(whole.calls):
        begin()
        done = run(command, [folder], failpoint)
        said = f"{failpoint}: {done.err}"
        assert done.failed is not None, said
        assert "panicked" not in done.err, said
        # POSIX: a call that a signal interrupts has done nothing, and is made again
        assert done.code == 0 or failpoint.error != errno.EINTR, said
        assert done.code == 0 or str(out) in done.err.splitlines()[-1], said
        if done.failed.name not in REMOVALS:
            assert {each.name for each in folder.iterdir()} <= {out.name}, said
        if done.code == 0:
            assert out.read_bytes() != there, said
        yield failpoint, done


@pytest.mark.parametrize("there", sweep([OLD, None], daily=1))
@pytest.mark.parametrize("what", sweep(["whole_file", "scene", "picture"], daily=1))
def test_a_file_is_the_old_one_or_the_new_one(
    scene: Path, pendulum_urdf: Path, tmp_path: Path, what: str, there: bytes | None
) -> None:
    out = tmp_path / "kept" / "file"
    out.parent.mkdir()
    names = {"scene": str(scene), "out": str(out)}
    command = {
        "whole_file": [sys.executable, "-c", WHOLE.format(**names)],
        "scene": [sys.executable, "-c", SCENE.format(**names)],
        "picture": [*COMMAND, "inspect", str(pendulum_urdf), "--png", str(out)],
    }[what]
    for failpoint, done in each_call(command, out, there):
        if done.code != 0:
            assert (out.read_bytes() if out.exists() else None) == there, failpoint


@pytest.mark.nightly
def test_a_private_file_stays_private(scene: Path, tmp_path: Path) -> None:
    out = tmp_path / "kept" / "file"
    out.parent.mkdir()
    out.touch(0o600)
    command = [sys.executable, "-c", SCENE.format(scene=str(scene), out=str(out))]
    for failpoint in failpoints(run(command, [out.parent]).calls):
        run(command, [out.parent], failpoint)
        assert out.stat().st_mode & 0o777 == 0o600, failpoint


def test_a_recording_that_replaces_another_is_whole(stepping: str, tmp_path: Path) -> None:
    out = tmp_path / "kept" / "run.tlrec"
    out.parent.mkdir()
    command = [*COMMAND, "record", stepping, str(out), "--frames=3", "--force"]
    for failpoint, done in each_call(command, out, OLD):
        if done.code != 0:
            assert out.read_bytes() == OLD, failpoint


def test_what_stays_of_a_recording_can_be_replayed(stepping: str, tmp_path: Path) -> None:
    out = tmp_path / "kept" / "run.tlrec"
    out.parent.mkdir()
    for failpoint, done in each_call([*COMMAND, "record", stepping, str(out), "--frames=3"], out, None):
        if out.exists():
            replayed = subprocess.run([*COMMAND, "replay", str(out)], capture_output=True, text=True, check=False)
            assert replayed.returncode == 0, f"{failpoint}: {done.err}{replayed.stderr}"
