"""A second client of a daemon that runs by itself, started from the command line with a scene file."""

from __future__ import annotations

import fcntl
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator

import numpy as np
import pytest

import tightloop as tl
from processes import alive, left_of, started, stems_of, wait_until


@pytest.fixture
def served(pendulum, tmp_path, unique) -> Iterator[tuple[str, int]]:
    """Name and pid of a daemon started by hand."""
    file, name = tmp_path / "scene.toml", unique()
    pendulum.save(file)
    command = [sys.executable, "-m", "tightloop", "serve", str(file), "--worlds=3", f"--name={name}"]
    command += ["--fields=joint_q,joint_qd,body_q,mass_matrix"]
    with started(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as process:
        try:
            assert process.stdout is not None and process.stdout.readline()
            yield name, process.pid
        finally:
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
                process.wait(5)


def test_an_attached_client_knows_as_much_as_the_one_that_launched(served, pendulum):
    name, pid = served
    attached = tl.attach(name)
    with tl.launch(pendulum, worlds=3, fields=("joint_q", "joint_qd", "body_q", "mass_matrix")) as launched:
        for (
            fact
        ) in "worlds device precision dt substeps fields dof_names coord_names body_names dofs coords bodies".split():
            assert getattr(attached, fact) == getattr(launched, fact), fact
        assert (attached.name, attached.pid) == (name, pid)
        tau = np.array([[1, 2], [3, 4], [5, 6]], dtype=np.float32)
        assert np.array_equal(attached.step(joint_f=tau).joint_q, launched.step(joint_f=tau).joint_q)
    attached.close()


def test_control_passes_on_when_the_first_client_closes(served):
    name, _ = served
    first, second = tl.attach(name), tl.attach(name)
    assert first.reset().step[0] == 0
    with pytest.raises(tl.LeaseHeld, match=str(os.getpid())):
        second.step()
    first.close()
    assert second.step().step[0] == 1
    second.close()


def test_control_passes_on_when_the_first_client_is_killed(served):
    name, _ = served
    code = f"import tightloop as tl, os, signal; tl.attach({name!r}).step(); os.kill(os.getpid(), signal.SIGKILL)"
    subprocess.run([sys.executable, "-c", code], check=False)
    second = tl.attach(name)

    def stepped() -> bool:
        try:
            return second.step().step[0] == 2
        except tl.LeaseHeld:
            return False

    assert wait_until(stepped, 1.0), "within a second of the death"
    second.close()


def test_the_end_of_a_client_does_not_end_a_daemon_started_by_hand(served):
    name, pid = served
    code = f"import tightloop as tl; sim = tl.attach({name!r}); sim.step()"
    for _ in range(2):
        subprocess.run([sys.executable, "-c", code], check=True)
    assert alive(pid)


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_a_daemon_started_by_hand_ends_clean_on_a_signal(served, root, how):
    name, pid = served
    stems = stems_of(pid)
    os.kill(pid, how)
    assert wait_until(lambda: not alive(pid), 2)
    assert left_of(stems) == []
    assert not any(name in path.name for path in root.iterdir())


def test_a_daemon_that_was_restarted_is_distinguished_from_the_one_known(pendulum, tmp_path, unique):
    name = unique()
    with tl.launch(pendulum, worlds=1, name=name) as first:
        known = tl.attach(name)
        first.close()
        with tl.launch(pendulum, worlds=1, name=name), pytest.raises(tl.DaemonRestarted, match=name):
            known.step()
    known.close()


def test_another_protocol_version_is_refused_with_both_versions(root, unique):
    name = unique()
    lock = root / f"{name}.lock"
    with lock.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)  # as a daemon of some later release would
        file.write(f"tightloop 4711 {os.getpid()} 0000000000000001\n")
        file.flush()
        with pytest.raises(tl.ProtocolMismatch, match=r"4711.*\d"):
            tl.attach(name)
    lock.unlink()


def test_a_dead_daemon_is_reported(served):
    name, pid = served
    sim = tl.attach(name)
    sim.step()
    os.kill(pid, signal.SIGKILL)
    with pytest.raises(tl.DaemonLost, match=str(pid)):
        sim.step()
    sim.close()


def test_a_daemon_that_is_still_starting_is_waited_for(pendulum, tmp_path, unique):
    file, name = tmp_path / "scene.toml", unique()
    pendulum.save(file)
    with pytest.raises(tl.UnknownDaemon):
        tl.attach(name)
    # it starts after a moment, as the other pane of a terminal does
    late = "import sys, time, runpy; time.sleep(0.5); runpy.run_module('tightloop', run_name='__main__')"
    command = [sys.executable, "-c", late, "serve", str(file), "--worlds=3", f"--name={name}"]
    with started(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        try:
            with tl.attach(name, timeout=60.0) as sim:
                assert sim.step().step.tolist() == [1, 1, 1]
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(10)


def test_both_groups_of_a_daemon_that_is_still_starting_are_waited_for(pendulum, tmp_path, unique):
    file, name = tmp_path / "scene.toml", unique()
    pendulum.save(file)
    command = [sys.executable, "-m", "tightloop", "serve", str(file), "--worlds=4", "--groups=2", f"--name={name}"]
    with started(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        try:
            groups = tl.attach(name, timeout=60)
            assert isinstance(groups, tl.Groups) and [sim.worlds for sim in groups] == [2, 2]
            groups.close()
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(10)


@pytest.mark.parametrize("timeout", [0, 0.3])
def test_the_wait_for_a_daemon_ends_with_the_daemons_that_there_are(timeout, served):
    name, _ = served
    begun = time.monotonic()
    with pytest.raises(tl.UnknownDaemon, match=rf"`?absent`?.*{name}.*waited {timeout:g} s"):
        tl.attach("absent", timeout=timeout)
    assert timeout <= time.monotonic() - begun < timeout + 5.0


@pytest.mark.parametrize("timeout", [-1, float("nan"), "soon"])
def test_a_wait_that_is_no_time_is_refused(timeout):
    with pytest.raises(tl.ArgumentError, match="attach: timeout is"):
        tl.attach("absent", timeout=timeout)
