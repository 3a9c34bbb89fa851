"""Every kind of process is killed, or stopped for a while, at random moments: the others go on, and nothing is left.

A round takes about a second. `TIGHTLOOP_ROUNDS` sets how many there are of each kind; `make kills` runs 200.
"""

from __future__ import annotations

import os
import random
import re
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest

import tightloop as tl
from processes import alive, left_of, stems_of, stopped, wait_until

ROUNDS = int(os.environ.get("TIGHTLOOP_ROUNDS", "4"))
# A bystander may wait this long for anything [s]: on an idle machine, and with five busy processes a core
PATIENCE = float(os.environ.get("TIGHTLOOP_PATIENCE", "10"))

CONTROLLER = """
import sys, tightloop as tl
sim = tl.attach(sys.argv[1])
sim.step()
print("ready", flush=True)
while True:
    sim.step(); sim.params.gravity; sim.restore(sim.snapshot()); sim.reset()
"""
OBSERVER = """
import sys, tightloop as tl
print("ready", flush=True)
while True:
    sim = tl.attach(sys.argv[1])
    for _ in range(20):
        sim.latest(0.05)
    sim.close()
"""
#: What each says once it is at work.
READY = {"controller": "ready", "observer": "ready", "recorder": "recording", "viewer": "http"}
CLIENTS: dict[str, list[str]] = {
    "controller": ["-c", CONTROLLER],
    "observer": ["-c", OBSERVER],
    "recorder": ["-m", "tightloop", "record"],
    "viewer": ["-m", "tightloop", "view", "--port=8390"],
}


def start(victim: str, name: str, folder: Path) -> subprocess.Popen[str]:
    out = [str(folder / f"{victim}.tlrec"), "--force"] if victim == "recorder" else []
    return subprocess.Popen(
        [sys.executable, *CLIENTS[victim], name, *out],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=os.environ | {"TMPDIR": str(folder)},
    )


def await_ready(victim: str, process: subprocess.Popen[str]) -> None:
    """Wait until a client is at work."""
    assert process.stdout is not None
    said = []
    for line in process.stdout:
        said.append(line)
        if READY[victim] in line:
            return
    pytest.fail(f"the {victim} ended before it was ready: {''.join(said)}")


def hit(pid: int, how: str, draw: random.Random) -> None:
    """Kill a process, or stop it for a while."""
    if how == "kill":
        os.kill(pid, signal.SIGKILL)
        return
    os.kill(pid, signal.SIGSTOP)
    time.sleep(draw.uniform(0.0, 0.5))
    os.kill(pid, signal.SIGCONT)


def strays(pids: set[int], folder: Path) -> list[Path]:
    """Files that these processes, which are gone, left in shared memory, and temporary ones."""
    left = tuple(f"tightloop-{pid}-" for pid in pids)
    shared = [path for path in Path("/dev/shm").iterdir() if path.name.startswith(left)]
    return shared + [path for path in folder.iterdir() if path.suffix != ".tlrec"]


def owners_of(files: list[str], daemon: int) -> Counter[str]:
    """Count files by kind and by the processes that made them: ids of ports and nodes have them in bits 64 to 95."""
    known = {daemon: "the daemon", os.getpid(): "the test"}

    def owner(number: str) -> str:
        return known.get(int(number) >> 64 & 0xFFFFFFFF, "a client")

    ids = [re.findall(r"[0-9]{20,}", Path(file).name) for file in files]
    return Counter(
        f"{Path(file).suffix} of {' to '.join(map(owner, own))}" for file, own in zip(files, ids, strict=True)
    )


def promptly(call: Callable[[], object]) -> None:
    """Make a call, which must neither fail nor take long."""
    began = time.monotonic()
    call()
    assert time.monotonic() - began < PATIENCE, "it takes too long"


@pytest.mark.parametrize("how", ["kill", "stop"])
@pytest.mark.parametrize("victim", CLIENTS)
def test_a_client_that_is_hit_hinders_nobody(pendulum, tmp_path, victim, how):
    if victim == "viewer":
        pytest.importorskip("viser")
    draw = random.Random(f"{victim} {how}")
    with tl.launch(pendulum, worlds=16, params=("gravity",)) as sim:
        sim.step()
        shared, victims, temporary = stems_of(sim.pid), set[int](), tmp_path / "temporary"
        temporary.mkdir()
        before = left_of(shared)
        for round_ in range(ROUNDS):
            sim.release()
            process = start(victim, sim.name, temporary)
            victims.add(process.pid)
            # every other one at work, the others while they start
            if round_ % 2:
                await_ready(victim, process)
            time.sleep(draw.uniform(0.0, 0.6))
            assert process.poll() is None, process.communicate()[0]
            hit(process.pid, how, draw)
            with tl.attach(sim.name) as onlooker:
                if how == "stop":
                    if victim != "controller":
                        promptly(onlooker.step)
                    time.sleep(draw.uniform(0.0, 0.3))
                    assert process.poll() is None, f"it goes on: {process.communicate()[0]}"
                process.kill()
                process.communicate()
                promptly(onlooker.step)
                promptly(lambda onlooker=onlooker: onlooker.latest(1.0))
            promptly(sim.snapshot)
        assert strays(victims, temporary) == []
        wait_until(lambda: len(left_of(shared)) <= len(before), PATIENCE)
        left = left_of(shared)
        more = owners_of(left, sim.pid) - owners_of(before, sim.pid)
        assert len(left) <= len(before), f"the dead left something with the living: {dict(more)}"
        assert alive(sim.pid)


@pytest.mark.parametrize("how", ["kill", "stop"])
def test_a_daemon_that_is_hit_is_reported_rightly(pendulum, root, how):
    draw, stems = random.Random(f"daemon {how}"), set[str]()
    for _ in range(ROUNDS):
        with tl.launch(pendulum, worlds=16, params=("gravity",)) as sim:
            stems |= stems_of(sim.pid)
            onlooker = tl.attach(sim.name)
            hitter = threading.Timer(draw.uniform(0.0, 0.1), hit, (sim.pid, how, draw))
            hitter.start()
            call = began = 0.0
            calls = (
                sim.step,
                sim.reset,
                sim.snapshot,
                lambda sim=sim: sim.params.gravity,
                lambda onlooker=onlooker: onlooker.latest(0.01),
            )
            try:
                while hitter.is_alive() or how == "kill":
                    began = time.monotonic()
                    draw.choice(calls)()
                    call = max(call, time.monotonic() - began)
            except tl.DaemonLost:
                assert how == "kill", "a stopped daemon is not lost"
                call = time.monotonic() - began
            hitter.join()
            assert call < PATIENCE
            if how == "stop":
                assert not stopped(sim.pid)
                sim.step()
            onlooker.close()
        assert not list(root.iterdir())
    assert left_of(stems) == []


def test_a_client_that_died_without_details_is_cleaned_up_after(pendulum):
    """As if it were killed between its node's monitor and the details, or between removing the two."""
    with tl.launch(pendulum, worlds=1) as sim:
        sim.step()
        shared = stems_of(sim.pid)
        before, nodes = left_of(shared), node_folders(shared)
        with subprocess.Popen(
            [sys.executable, "-c", OBSERVER, sim.name], stdout=subprocess.PIPE, text=True
        ) as observer:
            assert wait_until(lambda: len(node_folders(shared)) > len(nodes), PATIENCE)
            os.kill(sim.pid, signal.SIGSTOP)
            try:
                observer.kill()
                observer.wait()
                [theirs] = node_folders(shared) - nodes
                for details in theirs.glob("*node.details"):
                    details.unlink()
            finally:
                os.kill(sim.pid, signal.SIGCONT)
        assert wait_until(lambda: len(left_of(shared)) <= len(before), PATIENCE), left_of(shared)
        sim.step()


def test_a_connection_that_nobody_owns_is_removed(pendulum):
    """As if a client were killed between making the file and marking it as its own."""
    with tl.launch(pendulum, worlds=1) as sim:
        sim.step()
        shared = stems_of(sim.pid)
        connection = Path(next(file for file in left_of(shared) if file.endswith(".connection")))
        sender = re.findall(r"[0-9]{20,}", connection.name)[0]
        orphan = connection.with_name(connection.name.replace(sender, str(int(sender) + (1 << 100))))
        orphan.write_bytes(connection.read_bytes())
        assert wait_until(lambda: not orphan.exists(), PATIENCE)
        sim.step()
        assert connection.exists()


def node_folders(shared: set[str]) -> set[Path]:
    """Folders of the nodes, one for each process, of a daemon's shared memory."""
    return {Path(file).parent for file in left_of(shared) if file.endswith(".service_tag")}


def monitor_files(folder: Path, node: int, *suffixes: str) -> list[Path]:
    """Make files of a monitor, which iceoryx2 keeps beside a node's folder, as if nobody held them."""
    [ours] = folder.parent.glob(f"*_{folder.name}.node_monitor")
    files = [ours.with_name(ours.name.replace(folder.name, str(node)) + suffix) for suffix in suffixes]
    for file in files:
        file.write_bytes(bytes(16))
    return files


@pytest.mark.parametrize("suffixes", [(), ("_context",), ("_owner_lock", "_context")])
def test_a_node_without_a_whole_monitor_is_removed(pendulum, suffixes):
    """As if a client were killed between its node's details and the files of the monitor, or between removing them."""
    with tl.launch(pendulum, worlds=1) as sim:
        sim.step()
        [folder, *_] = node_folders(stems_of(sim.pid))
        with subprocess.Popen([sys.executable, "-c", ""]) as dead:
            pass
        node = (dead.pid << 64) + 7
        half = folder.with_name(str(node))
        half.mkdir(mode=0o700)
        (half / next(folder.glob("*node.details")).name).write_text("")
        files = monitor_files(folder, node, *suffixes)
        assert wait_until(lambda: not any(path.exists() for path in [half, *files]), PATIENCE)
        assert folder.exists()
        sim.step()


def test_a_node_that_closes_while_the_daemon_looks_is_removed(pendulum):
    """A closing node has a monitor without lock and no details, as a dead one: the daemon gives it details again."""
    with tl.launch(pendulum, worlds=1) as sim:
        sim.step()
        [folder, *_] = node_folders(stems_of(sim.pid))
        node = (os.getpid() << 64) + 7
        closing = folder.with_name(str(node))
        files = monitor_files(folder, node, "_owner_lock", "_context", "")
        assert wait_until(closing.exists, PATIENCE)
        os.kill(sim.pid, signal.SIGSTOP)
        for file in files:
            file.unlink(missing_ok=True)
        os.kill(sim.pid, signal.SIGCONT)
        assert wait_until(lambda: not closing.exists(), PATIENCE)
        sim.step()
