"""A daemon never waits for the reader of its messages."""

from __future__ import annotations

import json
import os
import re
import select
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import IO

import numpy as np
import pytest

import tightloop as tl

# Nothing here takes long; this only ends a test in which somebody waits for ever [s]
PATIENCE = 120


class Pipe:
    """A pipe that nobody reads, and that is full."""

    def __init__(self) -> None:
        self.was_read = False
        self.reader, self.writer = os.pipe()
        os.set_blocking(self.writer, False)
        with pytest.raises(BlockingIOError):
            while True:
                os.write(self.writer, b"x" * 4096)
        os.set_blocking(self.writer, True)

    def read(self) -> str:
        """Return what comes until nobody can write any more."""
        self.was_read = True
        os.close(self.writer)
        with os.fdopen(self.reader, "rb") as reader:
            return reader.read().decode().lstrip("x")


@pytest.fixture
def full() -> Iterator[Pipe]:
    pipe = Pipe()
    yield pipe
    if not pipe.was_read:
        os.close(pipe.reader)
        os.close(pipe.writer)


def line_of(stream: IO[bytes]) -> dict:
    """Return the one line of a daemon; a daemon that waits does not print it."""
    assert select.select([stream], [], [], PATIENCE)[0], "no line"
    return json.loads(stream.readline())


@pytest.fixture
def scene_file(pendulum: tl.Scene, tmp_path: Path) -> Path:
    pendulum.save(tmp_path / "scene.toml")
    return tmp_path / "scene.toml"


def serve(scene: Path, name: str, stderr: int, *flags: str) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "tightloop", "serve", str(scene), "--name", name, "--worlds", "3", *flags]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=stderr)


def ended(process: subprocess.Popen[bytes]) -> int:
    return process.wait(PATIENCE)


def test_a_daemon_whose_stderr_is_full_serves_its_clients(scene_file, unique, full):
    name = unique()
    process = serve(scene_file, name, full.writer, "--on-nan", "freeze")
    try:
        assert process.stdout is not None
        assert line_of(process.stdout)["ready"]["name"] == name
        sim = tl.attach(name)
        for _ in range(3):
            # each is a line of the log
            sim.step(joint_f=np.full((3, 2), np.nan))
            assert sim.reset().status.tolist() == [0, 0, 0]
        sim.close()
    finally:
        process.terminate()
        code = ended(process)
    assert code == 0


def test_what_was_not_read_in_time_comes_once_somebody_reads(scene_file, unique, full):
    name = unique()
    process = serve(scene_file, name, full.writer)
    try:
        assert process.stdout is not None
        assert "ready" in line_of(process.stdout)
    finally:
        process.terminate()
    # the last words wait for a reader, for a while
    said = full.read()
    assert ended(process) == 0
    assert f"tightloop: {name}: 3 worlds on cpu" in said and "tightloop: ended\n" in said


def test_an_error_at_the_start_is_reported_to_the_reader_of_one_of_the_streams(scene_file, unique, full):
    process = serve(scene_file, unique(), full.writer, "--fields", "nonsense")
    assert process.stdout is not None
    assert line_of(process.stdout)["error"]["kind"] == "ArgumentError"
    assert ended(process) == 2
    process = subprocess.Popen(
        [sys.executable, "-m", "tightloop", "serve", str(scene_file), "--fields", "nonsense"],
        stdout=full.writer,
        stderr=subprocess.PIPE,
    )
    assert b"unknown field" in process.communicate(timeout=PATIENCE)[1]
    assert process.returncode == 2


def test_a_launched_daemon_whose_streams_are_full_serves_and_ends(pendulum, full, monkeypatch):
    # the daemon inherits our stderr
    kept = os.dup(2)
    os.dup2(full.writer, 2)
    try:
        with tl.launch(pendulum, worlds=2) as sim:
            assert sim.step().status.tolist() == [0, 0]
        with pytest.raises(tl.errors.ArgumentError, match="no such field"):
            tl.launch(pendulum, worlds=2, fields=["nonsense"])
    finally:
        os.dup2(kept, 2)
        os.close(kept)


SHELL = """
import fcntl, subprocess, sys, termios
# a shell with job control: this terminal is ours, and stops jobs of the background that write to it
fcntl.ioctl(0, termios.TIOCSCTTY, 0)
attributes = termios.tcgetattr(0)
attributes[3] |= termios.TOSTOP
termios.tcsetattr(0, termios.TCSANOW, attributes)
daemon = subprocess.Popen([sys.executable, "-m", "tightloop", "serve", *sys.argv[1:]], process_group=0)
print("daemon", daemon.pid, flush=True)
sys.exit(daemon.wait())
"""


@pytest.mark.skipif(sys.version_info < (3, 11), reason="process groups of subprocesses came with Python 3.11")
def test_a_daemon_in_the_background_of_a_terminal_that_stops_writers(scene_file, unique):
    name = unique()
    terminal, theirs = os.openpty()
    command = [sys.executable, "-c", SHELL, str(scene_file), "--name", name, "--worlds", "3"]
    shell = subprocess.Popen(command, stdin=theirs, stdout=theirs, stderr=theirs, start_new_session=True)
    os.close(theirs)
    said = ""
    try:
        while '"ready"' not in said or "3 worlds on cpu" not in said:
            assert select.select([terminal], [], [], PATIENCE)[0], f"the daemon is stopped: {said}"
            said += os.read(terminal, 4096).decode()
        with tl.attach(name) as sim:
            assert sim.step().status.tolist() == [0, 0, 0]
    finally:
        for pid in re.findall(r"daemon (\d+)", said):
            os.kill(int(pid), signal.SIGCONT)
            os.kill(int(pid), signal.SIGTERM)
        assert ended(shell) == 0
        os.close(terminal)
