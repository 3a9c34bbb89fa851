"""Files, folders and sockets of a daemon and its clients are for their user only, and go with them."""

from __future__ import annotations

import json
import os
import signal
import socket
import stat
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import tightloop as tl
from processes import left_of, stems_of, wait_until
from tightloop.view.source import Live

SHARED_MEMORY = Path("/dev/shm")
NOBODY = 65534
#: A client that takes and restores snapshots and reads parameters until it is killed.
BUSY = """
import sys, tightloop as tl
with tl.attach(sys.argv[1]) as sim:
    while sim.controller() is not None:
        pass
    sim.forward()
    print("ready", flush=True)
    while True:
        snapshot = sim.snapshot()
        sim.restore(snapshot)
        sim.params.body_mass_scale
"""


def under(*folders: Path) -> list[Path]:
    """Return folders and all that is in them; what goes meanwhile is left out."""
    found = list(folders)
    for folder in folders:
        found += folder.rglob("*")
    return found


def folders_of(pid: int) -> list[Path]:
    """Return all in shared memory that has the name of a daemon, or begins with it."""
    return [path for stem in stems_of(pid) for path in SHARED_MEMORY.glob(f"{stem}*")]


@contextmanager
def busy_daemon(scene: tl.Scene, tmp_path: Path) -> Iterator[tuple[tl.Sim, list[Path]]]:
    """Launch a daemon with a controller, an observer and a recorder; provide what there is of it in the file system."""
    with tl.launch(scene, worlds=4, params=("body_mass_scale",)) as sim:
        sim.step()
        source = Live(sim.name, worlds=2, fields=("joint_q",))
        command = [sys.executable, "-m", "tightloop", "record", sim.name, str(tmp_path / "out.tlrec")]
        recorder = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
        try:
            assert recorder.stderr is not None and "recording" in recorder.stderr.readline()
            sim.step()
            sim.snapshot()
            yield (
                sim,
                [path for path in under(*folders_of(sim.pid), Path(os.environ["TIGHTLOOP_ROOT"])) if path.exists()],
            )
        finally:
            recorder.send_signal(signal.SIGINT)
            recorder.communicate()
            source.close()


@pytest.fixture
def umask_0() -> Iterator[None]:
    before = os.umask(0)
    yield
    os.umask(before)


def test_modes_let_nobody_else_in_whatever_the_umask(pendulum, tmp_path, umask_0):
    with busy_daemon(pendulum, tmp_path) as (_, paths):
        kinds = {stat.S_IFMT(path.lstat().st_mode) for path in paths}
        assert kinds == {stat.S_IFDIR, stat.S_IFREG, stat.S_IFSOCK}
        wrong = {str(path): oct(path.lstat().st_mode) for path in paths if path.lstat().st_mode & 0o077}
        assert not wrong


def reach(path: str) -> list[str]:
    """Return what this process may do with a path."""
    done = []
    for how, flags in {"read": os.O_RDONLY, "write": os.O_WRONLY, "list": os.O_RDONLY | os.O_DIRECTORY}.items():
        try:
            os.close(os.open(path, flags | os.O_NONBLOCK))
            done.append(how)
        except OSError:
            pass
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as client:
            client.connect(path)
            done.append("connect")
    except OSError:
        pass
    return done


def as_nobody(paths: list[Path]) -> dict[str, list[str]]:
    """Return what another user may do with each path."""
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        os.setgroups([])
        os.setgid(NOBODY)
        os.setuid(NOBODY)
        with os.fdopen(write, "w") as to:
            json.dump({str(path): reach(str(path)) for path in paths}, to)
        os._exit(0)
    os.close(write)
    with os.fdopen(read) as said:
        found = json.load(said)
    os.waitpid(child, 0)
    return found


@pytest.mark.skipif(os.geteuid() != 0, reason="only root may become another user")
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_another_user_can_read_write_and_connect_to_nothing(pendulum, tmp_path, umask_0):
    root = Path(os.environ["TIGHTLOOP_ROOT"])
    with busy_daemon(pendulum, tmp_path) as (sim, paths):
        assert root.stat().st_mode & 0o077 == 0
        # the walk sees what an open door is
        door = SHARED_MEMORY / f"door-{os.getpid()}"
        door.touch()
        try:
            door.chmod(0o666)
            reached = {path for path, done in as_nobody([*paths, door]).items() if done}
        finally:
            door.unlink()
        assert reached == {str(door)}
        assert sim.step().step.min() > 0


@pytest.mark.parametrize("cut", [0, 1, 64, 4096])
def test_a_cut_file_of_a_daemon_is_an_error_at_the_next_attach_and_no_hang(pendulum, cut):
    with tl.launch(pendulum, worlds=2) as sim:
        files = [path for path in under(*folders_of(sim.pid)) if path.is_file() and path.stat().st_size > cut]
        named = [path for path in files if path.name.endswith((".dynamic", ".global_mgmt", ".data", ".event_mgmt"))]
        assert len(named) >= 4, files
        cut_files = [path for path in files if path.name.endswith(".global_mgmt") or (path.name.endswith(".dynamic"))]
        # what the daemon itself needs stays as it is, in a copy that it has mapped
        for path in cut_files:
            data = path.read_bytes()
            path.unlink()
            path.write_bytes(data[:cut])
        start = time.monotonic()
        with pytest.raises(tl.TightloopError, match="changed by another program"):
            tl.attach(sim.name)
        assert time.monotonic() - start < 30
        os.kill(sim.pid, signal.SIGKILL)


def test_killed_clients_leave_nothing_of_their_snapshots(pendulum):
    before = set(SHARED_MEMORY.iterdir())
    with tl.launch(pendulum, worlds=4096, params=("body_mass_scale",)) as sim:
        stems = stems_of(sim.pid)
        sim.release()
        for round_ in range(8):
            child = subprocess.Popen([sys.executable, "-c", BUSY, sim.name], stdout=subprocess.PIPE)
            assert child.stdout is not None and child.stdout.readline() == b"ready\n"
            time.sleep(0.05 + 0.01 * round_)
            assert child.poll() is None
            child.kill()
            child.communicate()
        left = {path for path in set(SHARED_MEMORY.iterdir()) - before if not path.name.startswith(tuple(stems))}
        assert not {path for path in left if path.name.startswith(("tightloop-", "tmp"))}
    assert wait_until(lambda: not left_of(stems), 10)
