"""Whether a daemon is there: reported rightly when its folder is gone, descriptors run out, or its name is taken."""

from __future__ import annotations

import fcntl
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import tightloop as tl
from processes import alive, stopped, wait_until

LOGGED_OUT = """
import os, shutil, signal, time
import tightloop as tl
scene = tl.Scene(dt=1 / 480, substeps=4)
scene.add_urdf({urdf!r}, name="arm")
sim = tl.launch(scene, worlds=4)
look = tl.attach(sim.name)
assert os.listdir({folder!r}) == ["tightloop"], "the daemon is under the folder of the session"
shutil.rmtree({folder!r})
for _ in range(3):
    sim.step()
    sim.snapshot()
    look.latest(timeout=1.0)
print("lives", flush=True)
os.kill(sim.pid, signal.SIGKILL)
try:
    sim.step()
except tl.DaemonLost:
    print("lost", flush=True)
"""


def test_a_logout_ends_no_run(pendulum_urdf, tmp_path):
    folder = tmp_path / "session"
    folder.mkdir(mode=0o700)
    environment = {name: value for name, value in os.environ.items() if name != "TIGHTLOOP_ROOT"}
    code = LOGGED_OUT.format(urdf=str(pendulum_urdf), folder=str(folder))
    process = subprocess.run(
        [sys.executable, "-c", code],
        env=environment | {"XDG_RUNTIME_DIR": str(folder)},
        capture_output=True,
        text=True,
        timeout=30,
        check=False,
    )
    assert process.stdout.split() == ["lives", "lost"], process.stderr


NO_DESCRIPTORS = """
import os
import tightloop as tl
scene = tl.Scene(dt=1 / 480, substeps=4)
scene.add_urdf({urdf!r}, name="arm")
sim = tl.launch(scene, worlds=4)
sim.step()
import resource
resource.setrlimit(resource.RLIMIT_NOFILE, (256, 256))
taken = []
try:
    while True:
        taken.append(os.open("/dev/null", os.O_RDONLY))
except OSError:
    pass
sim.step()
sim.forward()
try:
    tl.attach(sim.name)
except tl.TightloopError as error:
    print(type(error).__name__, error, flush=True)
for descriptor in taken:
    os.close(descriptor)
sim.step()
"""


def test_a_client_without_descriptors_steps_on_and_reports_what_it_lacks(pendulum_urdf):
    code = NO_DESCRIPTORS.format(urdf=str(pendulum_urdf))
    process = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=30, check=False)
    assert process.returncode == 0, process.stderr
    assert process.stdout.startswith("ResourceError ") and "ulimit -n" in process.stdout, process.stdout


@pytest.fixture
def lock_file(root, unique) -> Iterator[Path]:
    """The path of a daemon's lock file, which is removed afterwards."""
    path = root / f"{unique()}.lock"
    yield path
    path.unlink()


def test_a_name_that_something_holds_in_silence_gets_an_error(lock_file):
    with lock_file.open("w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        began = time.monotonic()
        with pytest.raises(tl.WaitTimeout, match=str(lock_file)):
            tl.attach(lock_file.stem)
        assert time.monotonic() - began < 20


def test_a_lock_file_that_cannot_be_read_is_no_absent_daemon_and_hinders_no_other(pendulum, lock_file):
    lock_file.symlink_to(lock_file.name)
    with pytest.raises(tl.LaunchError, match=str(lock_file)):
        tl.attach(lock_file.stem)
    with tl.launch(pendulum, worlds=1) as sim:
        sim.step()


def test_a_stopped_daemon_is_closed_as_any_other(pendulum):
    sim = tl.launch(pendulum, worlds=4)
    os.kill(sim.pid, signal.SIGSTOP)
    assert wait_until(lambda: stopped(sim.pid), 5.0)
    end: Any = sim._end.peek()
    process = end[2][1].process
    sim.close()
    assert process.returncode == 0, "it ended by itself; a killed one has -9"
    assert not alive(sim.pid)


def test_control_comes_free_as_soon_as_its_holder_is_killed(pendulum):
    hold = "import sys, tightloop as tl\nsim = tl.attach(sys.argv[1])\nsim.step()\nprint(flush=True)\nsys.stdin.read()"
    with tl.launch(pendulum, worlds=4) as sim:
        sim.release()
        for _ in range(10):
            holder = subprocess.Popen(
                [sys.executable, "-c", hold, sim.name], stdin=subprocess.PIPE, stdout=subprocess.PIPE
            )
            assert holder.stdout is not None and holder.stdout.readline()
            holder.kill()
            holder.wait()
            sim.step()
            sim.release()
            holder.communicate()


ELSEWHERE = """
import sys, tightloop as tl
with tl.attach(sys.argv[1]) as sim:
    sim.step()
    kept = sim.snapshot()
    sim.restore(kept)
    print(kept.to_bytes() == sim.snapshot().to_bytes())
"""


def test_a_client_of_another_container_passes_snapshots(pendulum):
    # processes have other numbers there
    unshare = ["unshare", "--pid", "--fork", "--mount-proc", "--kill-child"]
    if subprocess.run([*unshare, "true"], capture_output=True, check=False).returncode:
        pytest.skip("no process namespace can be made here")
    with tl.launch(pendulum, worlds=4) as sim:
        sim.release()
        command = [*unshare, sys.executable, "-c", ELSEWHERE, sim.name]
        process = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
        assert process.stdout.strip() == "True", process.stderr
        sim.step()


def test_a_step_that_was_interrupted_before_control_came_can_be_made_again(pendulum):
    signal.signal(signal.SIGINT, signal.default_int_handler)
    with tl.launch(pendulum, worlds=4) as sim:
        sim.release()
        os.kill(sim.pid, signal.SIGSTOP)
        try:
            assert wait_until(lambda: stopped(sim.pid), 5.0)
            threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
            with pytest.raises(KeyboardInterrupt):
                sim.step()
        finally:
            os.kill(sim.pid, signal.SIGCONT)
        sim.step()
