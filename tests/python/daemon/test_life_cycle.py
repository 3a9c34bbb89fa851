"""However caller or daemon end: the other notices, and no process and no file is left."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

import tightloop as tl
from processes import alive, left_of, stems_of, stopped, wait_until
from tiers import nightly

# Kills each way
KILLS = pytest.mark.parametrize("kills", [10, nightly(int(os.environ.get("TIGHTLOOP_KILLS", "50")))])

CALLER = """
import os, signal, sys, time
import tightloop as tl
scene = tl.Scene(dt=1 / 480, substeps=4)
scene.add_urdf({urdf!r}, name="arm")
sim = tl.launch(scene, worlds=8)
frame = sim.step()
print(sim.pid, flush=True)
{end}
"""
ENDS = {
    "normal end": "",
    "exception": "raise RuntimeError('end')",
    "sys.exit": "sys.exit(3)",
    "os._exit": "os._exit(4)",
    "with an open frame": "keep = [frame, frame.joint_q]",
    "SIGTERM": "os.kill(os.getpid(), signal.SIGTERM)",
    "kill -9": "os.kill(os.getpid(), signal.SIGKILL)",
    "abort": "os.abort()",
    "KeyboardInterrupt": "os.kill(os.getpid(), signal.SIGINT); time.sleep(5)",
    "end of a forked child": "pid = os.fork()\nif pid == 0: sys.exit()\nos.waitpid(pid, 0); sim.step()",
}


def caller(urdf, end: str) -> subprocess.Popen[str]:
    code = CALLER.format(urdf=str(urdf), end=end)
    return subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def daemon_of(process: subprocess.Popen[str]) -> int:
    assert process.stdout is not None
    line = process.stdout.readline()
    if not line:
        pytest.fail(process.communicate()[1])
    return int(line)


@pytest.mark.parametrize("end", ENDS)
def test_nothing_is_left_however_the_caller_ends(pendulum_urdf, root, end):
    # It waits for a line, so that the daemon can be looked at while it runs
    process = caller(pendulum_urdf, f"sys.stdin.readline()\n{ENDS[end]}")
    pid = daemon_of(process)
    stems = stems_of(pid)
    before = time.monotonic()
    _, errors = process.communicate("\n", timeout=20)
    assert wait_until(lambda: not alive(pid), 1.0), "the daemon ends within a second"
    assert time.monotonic() - before < 6
    assert wait_until(lambda: not left_of(stems), 1.0), left_of(stems)
    assert not list(root.iterdir())
    if end == "end of a forked child":
        assert process.returncode == 0, errors


@KILLS
def test_kill_9_of_the_caller_at_any_moment_leaves_nothing(pendulum_urdf, root, kills):
    loop = "while True: sim.step(); sim.reset()"
    for kill in range(kills):
        process = caller(pendulum_urdf, loop)
        pid = daemon_of(process)
        stems = stems_of(pid)
        time.sleep(0.003 * kill % 0.05)
        process.kill()
        process.communicate()
        assert wait_until(lambda pid=pid: not alive(pid), 1.0), "the daemon notices within a second"
        assert wait_until(lambda stems=stems: not left_of(stems), 1.0), left_of(stems)
        assert not list(root.iterdir())


@KILLS
def test_kill_9_of_the_caller_while_it_starts_a_daemon_leaves_nothing(pendulum_urdf, root, kills):
    for kill in range(kills):
        process = caller(pendulum_urdf, "time.sleep(9)")
        time.sleep(0.1 + 0.4 * kill / kills)
        process.kill()
        process.communicate()
        assert wait_until(lambda: not list(root.iterdir()), 2.0), list(root.iterdir())


@KILLS
def test_kill_9_of_the_daemon_at_any_moment_is_reported_within_a_second(pendulum, root, kills):
    for kill in range(kills):
        with tl.launch(pendulum, worlds=64) as sim:
            stems = stems_of(sim.pid)
            killer = threading.Timer(0.003 * kill % 0.05, os.kill, (sim.pid, signal.SIGKILL))
            killer.start()
            step_began = time.monotonic()
            with pytest.raises(tl.DaemonLost, match=str(sim.pid)):
                while True:
                    step_began = time.monotonic()
                    sim.step()
            assert time.monotonic() - step_began < 1.0
            killer.join()
        assert left_of(stems) == []
        assert not list(root.iterdir())


def test_the_next_start_of_any_daemon_cleans_up_after_both_sides_were_killed(pendulum, pendulum_urdf, root):
    process = caller(pendulum_urdf, "time.sleep(9)")
    pid = daemon_of(process)
    stems = stems_of(pid)
    for victim in (pid, process.pid):
        os.kill(victim, signal.SIGSTOP)  # so that neither can clean up after the other
    assert wait_until(lambda: stopped(pid) and stopped(process.pid), 5.0)
    for victim in (pid, process.pid):
        os.kill(victim, signal.SIGKILL)
    process.communicate()
    assert wait_until(lambda: not alive(pid), 1.0)
    assert left_of(stems) and list(root.iterdir())
    with tl.launch(pendulum, worlds=1):
        assert left_of(stems) == []
    assert not list(root.iterdir())


def test_a_name_can_be_used_again_after_its_daemon_was_killed(pendulum, unique):
    name = unique()
    for _ in range(2):
        with tl.launch(pendulum, worlds=2, name=name) as sim:
            assert sim.step().step[0] == 1
            os.kill(sim.pid, signal.SIGKILL)


def test_a_stopped_daemon_can_be_interrupted(pendulum):
    # a shell that runs the tests in the background has it ignored
    signal.signal(signal.SIGINT, signal.default_int_handler)
    with tl.launch(pendulum, worlds=2) as sim:
        sim.step()
        os.kill(sim.pid, signal.SIGSTOP)
        try:
            threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
            began = time.monotonic()
            with pytest.raises(KeyboardInterrupt):
                sim.step()
            assert time.monotonic() - began < 0.6, "Ctrl-C is prompt"
        finally:
            os.kill(sim.pid, signal.SIGCONT)
        # the interrupted step may have been carried out; the simulation goes on either way
        assert sim.step().step[0] in (2, 3)


def test_other_python_threads_run_while_a_step_waits(pendulum):
    with tl.launch(pendulum, worlds=2) as sim:
        os.kill(sim.pid, signal.SIGSTOP)
        threading.Timer(0.2, os.kill, (sim.pid, signal.SIGCONT)).start()
        counted = 0
        waiting = threading.Thread(target=sim.step)
        waiting.start()
        while waiting.is_alive():
            counted += 1
        waiting.join()
        assert counted > 1000


def test_threads_that_share_a_sim_take_turns(pendulum):
    with tl.launch(pendulum, worlds=2, frames_held=8) as sim:
        threads = [threading.Thread(target=lambda: [sim.step().fields for _ in range(50)]) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert sim.step().step[0] == 201


FORK = """
child = os.fork()
if child == 0:
    code = 1
    try:
        sim.step()
    except tl.LeaseHeld as error:
        assert str(os.getppid()) in str(error)
        assert tl.attach(sim.name).worlds == 8
        code = 42
    finally:
        os._exit(code)
assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 42
assert sim.step().step[0] == 2
"""


def test_a_forked_child_cannot_step_what_its_parent_steps(pendulum_urdf):
    process = caller(pendulum_urdf, FORK)
    daemon_of(process)
    _, errors = process.communicate(timeout=20)
    assert process.returncode == 0, errors


def test_a_dropped_sim_ends_its_daemon(pendulum):
    sim = tl.launch(pendulum, worlds=2)
    pid = sim.pid
    del sim
    assert wait_until(lambda: not alive(pid), 1.0)


def test_the_working_directory_cannot_shadow_what_the_daemon_imports(pendulum, tmp_path, monkeypatch):
    for module in ("json", "signal", "tightloop", "pathlib"):
        (tmp_path / f"{module}.py").write_text("raise SystemExit('imported from the working directory')")
    monkeypatch.chdir(tmp_path)
    with tl.launch(pendulum, worlds=1) as sim:
        sim.step()


@pytest.mark.parametrize(
    ("end", "told"),
    [
        ("os.kill(os.getpid(), 9)", "killed by signal 9"),
        ("sys.exit(7)", "exit code 7"),
        ("print('hello')", "exit code 0"),
    ],
)
def test_a_daemon_that_ends_before_it_is_ready_says_how(pendulum, tmp_path, monkeypatch, end, told):
    program = tmp_path / "daemon.py"
    program.write_text(f"import os, sys\n{end}")
    monkeypatch.setattr("tightloop.sim.daemon._PROGRAM", program)
    with pytest.raises(tl.LaunchError, match=rf"{told} before it was ready; .*log=FILE"):
        tl.launch(pendulum, worlds=1)


def test_lines_that_a_driver_prints_before_the_daemon_is_ready_are_passed_over(pendulum, tmp_path, monkeypatch):
    real = Path(tl.__file__).with_name("__main__.py")
    program = tmp_path / "daemon.py"
    said = 'print("driver: hello"); print(7); print({}); sys.stdout.flush()'
    program.write_text(f"import runpy, sys\n{said}\nrunpy.run_path({str(real)!r}, run_name='__main__')")
    monkeypatch.setattr("tightloop.sim.daemon._PROGRAM", program)
    with tl.launch(pendulum, worlds=1) as sim:
        sim.step()


def test_a_log_file_gets_the_news(pendulum, tmp_path, capfd):
    log = tmp_path / "daemon.log"
    with tl.launch(pendulum, worlds=1, log=log) as sim:
        name = sim.name
    assert name in log.read_text()
    with contextlib.closing(tl.launch(pendulum, worlds=1)):
        pass
    assert capfd.readouterr() == ("", "")
