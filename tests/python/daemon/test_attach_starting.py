"""A client that attaches to a daemon that is still starting gets an answer within its timeout."""

from __future__ import annotations

import subprocess
import sys
import threading
import time

import pytest

import tightloop as tl
from conftest import URDF
from processes import started, wait_until
from tightloop.errors import UnknownDaemon

SCENE = f'dt = 0.002\nsubsteps = 1\n[[robot]]\nname = "arm"\nurdf = "{URDF}"\n'
# Beside the wait that was asked for [s]
BESIDE_MAX = 2.0


@pytest.mark.parametrize("timeout", [0.5, 2.0])
def test_attaching_to_a_start_ends_with_the_timeout_and_says_what_is_waited_for(root, unique, timeout):
    name = unique()
    # it waits for its scene
    command = [sys.executable, "-m", "tightloop", "serve", "-", "--name", name]
    with started(command, stdin=subprocess.PIPE, stderr=subprocess.DEVNULL) as daemon:
        assert wait_until(lambda: any(root.iterdir()), 20.0)
        began = time.monotonic()
        with pytest.raises(UnknownDaemon, match=f"{name}.*still starting.*tightloop stop {name}"):
            tl.attach(name, timeout=timeout)
        assert timeout <= time.monotonic() - began < timeout + BESIDE_MAX
        daemon.terminate()
        daemon.wait(20.0)


def test_a_start_that_begins_late_gets_no_further_timeout(root, unique):
    name = unique()
    command = [sys.executable, "-m", "tightloop", "serve", "-", "--name", name]
    begun = threading.Event()

    def serve() -> None:
        begun.wait(20.0)
        time.sleep(1.5)
        daemons.append(subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.DEVNULL))

    daemons: list[subprocess.Popen[bytes]] = []
    thread = threading.Thread(target=serve)
    thread.start()
    try:
        began = time.monotonic()
        begun.set()
        with pytest.raises(UnknownDaemon):
            tl.attach(name, timeout=3.0)
        assert time.monotonic() - began < 3.0 + 1.0
    finally:
        thread.join()
        for daemon in daemons:
            daemon.terminate()
            daemon.wait(20.0)


def test_a_daemon_that_becomes_ready_within_the_timeout_is_attached(root, unique):
    name = unique()
    command = [sys.executable, "-m", "tightloop", "serve", "-", "--name", name, "--device", "cpu"]
    with started(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as daemon:
        assert wait_until(lambda: any(root.iterdir()), 20.0)
        assert daemon.stdin is not None
        daemon.stdin.write(SCENE.encode())
        daemon.stdin.close()
        with tl.attach(name, timeout=60.0) as sim:
            assert sim.worlds == 1
        daemon.terminate()
        daemon.wait(20.0)
