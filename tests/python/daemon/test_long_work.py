"""A daemon at long work hears signals, ``tightloop stop`` and its owner's death; a new client gets an answer."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

import tightloop as tl
from conftest import URDF
from processes import alive, children_of, started, wait_until
from tiers import sweep

# From a request to the end of the daemon, whatever it does [s]
END_MAX = 2.0
# A command of ours starts within this time [s]
START_MAX = 1.5
TIGHTLOOP = [sys.executable, "-m", "tightloop"]

OWNER = """
import os, numpy as np, tightloop as tl
name = {name!r}
scene = tl.Scene(dt=1e-4, substeps={substeps})
scene.add_urdf({urdf!r}, name="arm")
def launch(scene=scene, **more):
    sim = tl.launch(scene, name=name, **{{"worlds": 1, "device": "cpu", "threads": 1, **more}})
    print("ready", flush=True)
    return sim
{work}
"""
#: Work of a daemon that takes minutes: physics steps of a control frame, and what its owner asks for.
WORK = {
    # as many dofs as a scene may have, and a pair of every two bodies
    "building a scene": (
        1,
        """
from tightloop.sim.daemon import Daemon
cube = '''
[[body]]
name = "cubeNUMBER"
pos = [NUMBER, 0, 1]
mass = 1.0
[[shape]]
name = "boxNUMBER"
type = "box"
half_extents = [0.1, 0.1, 0.1]
body = "cubeNUMBER"
'''
text = "dt = 0.002\\nsubsteps = 1\\n" + "".join(cube.replace("NUMBER", str(i)) for i in range(341))
print("ready", flush=True)
Daemon.start(text, {"name": name, "worlds": 1, "device": "cpu"})
""",
    ),
    "compiling for a GPU": (
        8,
        "print('ready', flush=True); sim = launch(device='gpu', worlds=256); import time; time.sleep(60)",
    ),
    "choosing a device": (
        8,
        "os.environ['TIGHTLOOP_AUTO_SOFTWARE'] = '1'; print('ready', flush=True); "
        "sim = launch(device='auto', worlds=256, threads=None); import time; time.sleep(60)",
    ),
    "snapshots and restores": (
        1,
        """
sim = launch(worlds=65_536)
while True:
    sim.restore(sim.snapshot())
""",
    ),
    "being recorded": (
        1,
        """
sim = launch(worlds=16_384)
with sim.record(os.environ["XDG_CACHE_HOME"] + "/long.tlrec", fields=["joint_q"]):
    while True:
        sim.step()
""",
    ),
    "a step": (10_000, "launch(worlds=20_000).step()"),
    "waiting for real time": (10_000, "sim = launch(realtime=0.001); sim.step(); sim.step()"),
    "a step of one group": (10_000, "launch(worlds=20_000, groups=2)[0].step()"),
    "inverse kinematics": (
        1,
        """
sim = launch(worlds=100_000)
sim.ik(tl.Reach("arm/fr3_hand_tcp")).solve((9, 9, 9), (1, 0, 0, 0), iterations=1000, restarts=900)
""",
    ),
    "waiting": (1, "sim = launch(); sim.step(); import time; time.sleep(600)"),
}


def shared_folders(root: Path) -> list[Path]:
    """Return the folders of this root's daemons in shared memory."""
    found: list[Path] = []
    for place in Path("/dev/shm").glob("tl*/place"):
        # daemons of other tests come and go
        with suppress(FileNotFoundError):
            if place.read_text().startswith(f"{root}\n"):
                found.append(place.parent)
    return found


@contextmanager
def at_work(work: str, name: str) -> Iterator[tuple[subprocess.Popen[str], int]]:
    """Run an owner whose daemon is at long work; yield it and the daemon's process."""
    substeps, code = WORK[work]
    source = OWNER.format(name=name, substeps=substeps, urdf=str(URDF), work=code)
    command = [sys.executable, "-c", source]
    with (
        # nothing is compiled yet, and what a killed owner wrote goes with the folder
        TemporaryDirectory() as cache,
        started(
            command,
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env={**os.environ, "XDG_CACHE_HOME": cache},
        ) as owner,
    ):
        assert owner.stdout is not None
        assert owner.stdout.readline() == "ready\n"
        children: list[int] = []

        def has_children() -> bool:
            children.extend(children_of(owner.pid))
            return bool(children)

        assert wait_until(has_children, 10.0)
        # a recorder comes after it
        daemon = children[0]
        try:
            time.sleep(1.0)
            assert alive(daemon) and owner.poll() is None
            yield owner, daemon
        finally:
            owner.kill()
            if not wait_until(lambda: not alive(daemon), 5.0):
                os.kill(daemon, signal.SIGKILL)


#: Ways to ask for the end, with the time that they take beside [s].
REQUESTS: dict[str, tuple[float, Callable[[str, int, int], object]]] = {
    "SIGTERM": (0.0, lambda _, owner, daemon: os.kill(daemon, signal.SIGTERM)),
    "SIGINT": (0.0, lambda _, owner, daemon: os.kill(daemon, signal.SIGINT)),
    "SIGHUP": (0.0, lambda _, owner, daemon: os.kill(daemon, signal.SIGHUP)),
    "the owner's death": (0.0, lambda _, owner, daemon: os.kill(owner, signal.SIGKILL)),
    "stop": (START_MAX, lambda name, owner, daemon: subprocess.run([*TIGHTLOOP, "stop", name], check=True)),
}


# all signals go one way, so one state stands for the rarer ones
RARE = ("SIGINT", "SIGHUP")
CASES = [(work, request) for work in WORK for request in REQUESTS if request not in RARE or work == "a step"]
# each request at one work, and each work with the request that all services get
DAILY = [(work, request) for work, request in CASES if request == "SIGTERM" or work == "a step"]
OTHERS = [case for case in CASES if case not in DAILY]


@pytest.mark.parametrize(("work", "request_"), sweep(DAILY + OTHERS, daily=len(DAILY)))
def test_a_daemon_at_long_work_ends_when_asked_and_leaves_nothing(root, unique, work, request_):
    name = unique()
    beside, ask = REQUESTS[request_]
    with at_work(work, name) as (owner, daemon):
        assert shared_folders(root)
        began = time.monotonic()
        ask(name, owner.pid, daemon)
        assert wait_until(lambda: not alive(daemon), END_MAX + beside), f"{work}: it does not hear {request_}"
        assert time.monotonic() - began < END_MAX + beside
        assert shared_folders(root) == []
        assert not list(root.iterdir())


@pytest.mark.parametrize("pause", [0.05, 0.4])
def test_a_second_signal_ends_long_work_within_a_second(root, unique, pause):
    with at_work("a step", unique()) as (_, daemon):
        os.kill(daemon, signal.SIGTERM)
        time.sleep(pause)
        os.kill(daemon, signal.SIGTERM)
        assert wait_until(lambda: not alive(daemon), 1.0)
        assert not list(root.iterdir()) and shared_folders(root) == []


def test_a_daemon_that_waits_for_its_scene_hears_a_signal(root, unique):
    command = [*TIGHTLOOP, "serve", "-", "--name", unique()]
    with started(command, stdin=subprocess.PIPE, stderr=subprocess.DEVNULL) as daemon:
        assert wait_until(lambda: any(root.iterdir()), 20.0)
        time.sleep(0.3)
        daemon.terminate()
        assert daemon.wait(END_MAX) == 1
        assert not list(root.iterdir()) and shared_folders(root) == []


def test_a_client_that_attaches_while_a_daemon_steps_is_answered(unique):
    name = unique()
    with at_work("a step", name):
        began = time.monotonic()
        with tl.attach(name) as onlooker:
            assert time.monotonic() - began < END_MAX
            assert onlooker.worlds == 20_000
