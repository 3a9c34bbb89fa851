"""Shared memory that another program of the same user cuts, changes or fills: errors by name, and no hang.

A daemon cannot be safe from its own user: changed bytes may still end it. Cut files and a full file system may not.
"""

from __future__ import annotations

import os
import random
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

import tightloop as tl
from processes import started, stems_of
from tiers import sweep
from tightloop import _core

SHARED_MEMORY = Path("/dev/shm")
#: Seconds after which a call hangs: no wait is longer than 120.
HANG = 150
SEEDS = int(os.environ.get("TIGHTLOOP_CASES", "8"))

#: Steps and looks for two seconds, and reports the error that ended it.
CLIENT = """
import sys, time, tightloop as tl
try:
    with tl.attach(sys.argv[1]) as sim:
        sim.step()
        print("ready", flush=True)
        end = time.monotonic() + 1.0
        while time.monotonic() < end:
            sim.step()
            sim.latest()
except tl.TightloopError as error:
    print(type(error).__name__, str(error)[:160])
"""


def files_of(pid: int) -> list[Path]:
    """Return the files of shared memory of a daemon and its clients."""
    folders = [SHARED_MEMORY / stem for stem in stems_of(pid)]
    endings = (".data", ".dynamic", ".connection", ".event_mgmt", ".global_mgmt")
    return sorted(path for folder in folders for path in folder.iterdir() if path.name.endswith(endings))


def cut(rng: random.Random, path: Path) -> None:
    os.truncate(path, rng.choice([0, 1, 4096, rng.randrange(path.stat().st_size)]))


def flip(rng: random.Random, path: Path) -> None:
    size = path.stat().st_size
    with path.open("r+b") as file:
        for _ in range(rng.choice([1, 8, 64])):
            # most of what matters lies at the begin
            file.seek(rng.randrange(min(size, rng.choice([256, 4096, size]))))
            file.write(rng.randbytes(rng.choice([1, 8])))


def client(name: str) -> subprocess.Popen[str]:
    return subprocess.Popen([sys.executable, "-c", CLIENT, name], stdout=subprocess.PIPE, text=True)


def outcome(process: subprocess.Popen[str]) -> str:
    """Return how a client ended: the class of its error, ``signal N``, or ``fine``; a hang fails."""
    try:
        said, _ = process.communicate(timeout=HANG)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        return "hang"
    if process.returncode < 0:
        return f"signal {-process.returncode}"
    last = said.removeprefix("ready\n").split()
    return last[0] if last else "fine" if process.returncode == 0 else "exception"


@pytest.fixture
def scene_file(pendulum: tl.Scene, tmp_path: Path) -> Path:
    path = tmp_path / "scene.toml"
    pendulum.save(path)
    return path


def attacked(scene_file: Path, name: str, seed: int, attack: Callable[[random.Random, Path], None]) -> list[str]:
    """Attack a running daemon; return the outcomes for its client, for the next one and for itself."""
    rng = random.Random(seed)
    # not of this process, which would have the damaged memory too
    command = [sys.executable, "-m", "tightloop", "serve", str(scene_file), "--worlds=3", f"--name={name}"]
    with started(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as daemon:
        assert daemon.stdout is not None and daemon.stdout.readline()
        first = client(name)
        assert first.stdout is not None and first.stdout.readline() == "ready\n"
        attack(rng, rng.choice(files_of(daemon.pid)))
        ends = [outcome(first), outcome(client(name)), "alive" if daemon.poll() is None else "dead"]
        daemon.kill()
    # what it left would go with the next start of any daemon, and there may be none
    assert _core.sweep(name)
    return ends


@pytest.mark.parametrize("seed", sweep(range(SEEDS), daily=4))
def test_a_cut_file_costs_no_process_and_no_hang(scene_file, unique, seed):
    first, second, daemon = attacked(scene_file, unique(), seed, cut)
    assert daemon == "alive"
    for end in (first, second):
        assert not end.startswith(("signal", "hang", "exception")), (first, second)


@pytest.mark.parametrize("seed", sweep(range(SEEDS // 2), daily=1))
def test_changed_bytes_hang_nobody(scene_file, unique, seed):
    ends = attacked(scene_file, unique(), seed, flip)
    assert "hang" not in ends and "exception" not in ends


#: Fills shared memory but for some pages, and lets clients join.
FULL = """
import os, subprocess, sys, tightloop as tl
scene = tl.Scene(dt=1 / 480, substeps=4)
scene.add_urdf(sys.argv[1], name="arm")
with tl.launch(scene, worlds=2) as sim:
    sim.step()
    sim.release()
    for pages in (0, 1, 2, 3, 5, 8, 13, 21, 34, 55, 89):
        fill = os.open("/dev/shm/fill", os.O_RDWR | os.O_CREAT)
        while (left := os.statvfs("/dev/shm").f_bavail - pages) > 0:
            try:
                os.posix_fallocate(fill, 0, os.fstat(fill).st_size + 4096 * left)
            except OSError:
                pass  # the daemon takes memory for the next lease meanwhile
        done = subprocess.run([sys.executable, "-c", sys.argv[2], sim.name], stdout=subprocess.PIPE, text=True)
        print(pages, done.returncode, " ".join(done.stdout.split()), flush=True)
        os.unlink("/dev/shm/fill")
        os.close(fill)
    print("then", sim.step().step[0])
"""


@pytest.mark.skipif(os.geteuid() != 0, reason="only root may mount a small /dev/shm")
def test_a_client_that_joins_a_full_shared_memory_is_refused_by_name(pendulum_urdf):
    small = 'mount -t tmpfs -o size=24m tmpfs /dev/shm && exec "$@"'
    command = ["unshare", "--mount", "sh", "-c", small, "sh", sys.executable, "-c", FULL, str(pendulum_urdf), CLIENT]
    start = time.monotonic()
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    lines = done.stdout.splitlines()
    if not lines and "unshare" in done.stderr:
        pytest.skip(f"no mount: {done.stderr}")
    assert lines and lines[-1].startswith("then"), done.stderr
    for line in lines[:-1]:
        _, code, said = line.split(" ", 2) if line.count(" ") > 1 else (*line.split(" "), "")
        assert code == "0", line
        assert said.startswith("ready") or "ResourceError" in said, line
    assert time.monotonic() - start < 20 * HANG
