"""Whatever call of the system fails while a daemon starts, steps and ends: nothing is left, and the next one starts."""

from __future__ import annotations

import errno
import os
import sys
import time
from pathlib import Path

import pytest

import tightloop as tl
from failpoints import REMOVALS, Failpoint, Run, failpoints, is_supported, run

pytestmark = pytest.mark.skipif(not is_supported(), reason="no process may filter the system calls of another one here")

SHARED = Path("/dev/shm")
LIFE = """
import tightloop as tl
with tl.launch(tl.Scene.load({scene!r}), worlds=1, name="failing", device="cpu") as sim:
    sim.reset()
    sim.step()
"""
# A signal may interrupt these at any time, and none of them may fail for it.
RETRIED = {"flock", "fallocate", "pread64"}


class Life:
    """A daemon and its client, from start to end, under a root folder of their own."""

    def __init__(self, scene: tl.Scene, folder: Path) -> None:
        scene.save(folder / "scene.toml")
        self._command = [sys.executable, "-c", LIFE.format(scene=str(folder / "scene.toml"))]
        self.root = folder / "root"
        self._env = {"TIGHTLOOP_ROOT": str(self.root), "XDG_CACHE_HOME": str(folder / "cache")}
        calls = run(self._command, [self.root, SHARED], env=self._env).calls
        # the daemon's own folder; others run beside it
        self.shared = next(call.path for call in calls if call.name == "mkdir" and call.path.parent == SHARED)

    def run(self, failpoint: Failpoint | None = None) -> Run:
        return run(self._command, [self.root, self.shared], failpoint, env=self._env, seconds=120)

    def left(self) -> list[str]:
        there = [*self.root.iterdir()] if self.root.exists() else []
        return [str(path) for path in (*there, self.shared) if path.exists()]


@pytest.fixture
def life(pendulum: tl.Scene, tmp_path: Path) -> Life:
    return Life(pendulum, tmp_path)


def test_a_signal_never_fails_locks_and_reservations(life: Life) -> None:
    for failpoint in failpoints(life.run().calls):
        if failpoint.error == errno.EINTR and failpoint.call.name in RETRIED:
            done = life.run(failpoint)
            assert done.code == 0, f"{failpoint}: {done.err}"


def test_memory_between_client_and_daemon_that_cannot_be_opened_is_named_and_nobody_waits_for_it(life: Life) -> None:
    # the first three are those of requests and answers, at the client and at the daemon
    chosen = [
        each
        for each in failpoints(life.run().calls)
        if errno.errorcode[each.error] == "EIO"
        and each.call.name == "openat"
        and each.call.path.suffix in {".connection", ".data"}
        and each.number <= 3
    ]
    assert chosen
    for failpoint in chosen:
        start = time.monotonic()
        done = life.run(failpoint)
        took = time.monotonic() - start
        # a client waits 30 s for a daemon that is stopped
        assert took < 20, f"{failpoint}: {took:.1f} s, {done.err}"
        assert done.code == 0 or str(life.shared) in done.err.splitlines()[-1], f"{failpoint}: {done.err}"
        assert not life.left(), f"{failpoint}: {done.err}"


@pytest.mark.nightly
@pytest.mark.parametrize("error", ["ENOSPC", "EMFILE", "EIO", "EACCES"])
def test_a_life_that_fails_leaves_nothing_and_the_next_one_succeeds(life: Life, error: str) -> None:
    every = int(os.environ.get("TIGHTLOOP_FAILPOINTS_EVERY", "1"))
    # one of each kind: a daemon makes most calls once for each of its services
    chosen = [
        each for each in failpoints(life.run().calls) if errno.errorcode[each.error] == error and each.number == 1
    ]
    for failpoint in chosen[::every]:
        done = life.run(failpoint)
        said = f"{failpoint}: {done.err}"
        is_removal = done.failed is not None and done.failed.name in REMOVALS
        # the transport panics over a socket that it cannot remove, which ends nothing
        assert is_removal or "panicked" not in done.err, said
        if done.code != 0:
            last = done.err.splitlines()[-1]
            places = (str(life.root), str(SHARED))
            # errno 24 names the limit of open files
            assert any(place in last for place in places) or "ulimit -n" in last, said
        if not is_removal:
            assert not life.left(), said
        after = life.run()
        assert after.code == 0 and not life.left(), f"{said}\nafter it: {after.err}"
