"""Simulations that keep to real time. No test asks how late a frame is: that is for `benches/daemon/realtime.py`."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import tightloop as tl

URDF = """<robot name="r"><link name="base"/><link name="bob">
<inertial><origin xyz="0.3 0 0"/><mass value="1"/>
<inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hinge" type="continuous"><parent link="base"/><child link="bob"/><axis xyz="0 1 0"/></joint></robot>"""
PERIOD = 0.002  # [s]


@pytest.fixture
def scene(tmp_path: Path) -> tl.Scene:
    """A pendulum, whose frames are 2 ms."""
    (tmp_path / "r.urdf").write_text(URDF)
    scene = tl.Scene(dt=PERIOD, substeps=1)
    scene.add_urdf(tmp_path / "r.urdf", name="r")
    return scene


def launched(scene: tl.Scene, realtime: float | tl.RealTime | None, worlds: int = 1) -> tl.Sim:
    """A simulation of the scene."""
    return tl.launch(scene, worlds=worlds, realtime=realtime, device="cpu", threads=1)


def turned(sim: tl.Sim, frames: int) -> NDArray[np.float32]:
    """Positions of frames under torques that change."""
    torques = (np.sin(0.1 * step) for step in range(frames))
    return np.array([sim.step(joint_f=[[torque]] * sim.worlds).joint_q.copy() for torque in torques])


@pytest.mark.parametrize("factor", [0.5, 1.0, 4.0])
def test_frames_take_as_long_as_what_they_simulate(scene: tl.Scene, factor: float) -> None:
    with launched(scene, factor) as sim:
        sim.step()
        frames = 100
        start = time.monotonic()
        for _ in range(frames):
            sim.step()
        # a frame that is late by itself delays those after it, and never is one early
        assert time.monotonic() - start > (frames - 1) * PERIOD / factor
        assert sim.timing.frames == frames + 1


def test_the_bits_are_those_without_real_time(scene: tl.Scene) -> None:
    with launched(scene, None, 3) as fast, launched(scene, 1.0, 3) as slow:
        np.testing.assert_array_equal(turned(slow, 100), turned(fast, 100))


def test_a_plant_that_pauses_waits_for_its_command(scene: tl.Scene) -> None:
    with launched(scene, 1.0) as sim, launched(scene, None) as fast:
        sim.step(joint_f=[1.0])
        time.sleep(20 * PERIOD)
        frame = sim.step()
        assert frame.step[0] == 2
        assert sim.timing.late == 1
        assert sim.timing.missed >= 1
        fast.step(joint_f=[1.0])
        np.testing.assert_array_equal(frame.joint_q, fast.step().joint_q)


def test_a_plant_that_holds_goes_on_with_the_last_command(scene: tl.Scene) -> None:
    with launched(scene, tl.RealTime(late="hold")) as sim, launched(scene, None) as fast:
        sim.step(joint_f=[1.0])
        time.sleep(50 * PERIOD)
        frame = sim.step()
        steps = int(frame.step[0])
        assert steps > 25
        same = fast.step(joint_f=[1.0])
        for _ in range(steps - 1):
            same = fast.step()
        np.testing.assert_array_equal(frame.joint_q, same.joint_q)
        assert sim.timing.late >= steps - 2


@pytest.mark.parametrize("timeout", [None, 30 * PERIOD])
def test_a_plant_that_stops_has_no_torque(scene: tl.Scene, timeout: float | None) -> None:
    choice = tl.RealTime(late="stop") if timeout is None else tl.RealTime(late="hold", command_timeout=timeout)
    with (
        tl.launch(scene, worlds=1, realtime=choice, device="cpu", threads=1, fields=("joint_q", "joint_f")) as sim,
        launched(scene, None) as fast,
    ):
        assert sim.step(joint_f=[1.0]).joint_f[0, 0] == 1.0
        time.sleep(60 * PERIOD)
        frame = sim.step()
        assert frame.joint_f[0, 0] == 0.0
        assert frame.step[0] > 30
        # the torque ended at some frame after the first, and later ones have none
        frames = [fast.step(joint_f=[1.0]).joint_q.copy()]
        held = 1 if timeout is None else 15
        for k in range(1, int(frame.step[0])):
            frames.append(fast.step(joint_f=[1.0 if k < held else 0.0]).joint_q.copy())
        if timeout is None:
            np.testing.assert_array_equal(frame.joint_q, frames[-1])
        assert sim.step(joint_f=[0.5]).joint_f[0, 0] == 0.5


def test_an_observer_sees_a_plant_that_holds(scene: tl.Scene) -> None:
    with launched(scene, tl.RealTime(late="hold")) as sim:
        sim.step(joint_f=[1.0])
        with tl.attach(sim.name) as observer:
            first = observer.latest(5.0)
            second = observer.latest(5.0)
        assert first is not None
        assert second is not None
        assert second.step[0] > first.step[0]


@pytest.mark.parametrize("late", ["hold", "stop"])
def test_a_recording_of_frames_without_commands_replays(scene: tl.Scene, late: str, tmp_path: Path) -> None:
    command, file = [sys.executable, "-m", "tightloop"], str(tmp_path / "run.tlrec")
    with launched(scene, tl.RealTime(late=late), 3) as sim:
        turned(sim, 3)
        with subprocess.Popen([*command, "record", sim.name, file, "--frames", "200"]) as recorder:
            while recorder.poll() is None:
                turned(sim, 5)
                time.sleep(10 * PERIOD)
        assert recorder.returncode == 0
        assert sim.timing.late > 50
    done = subprocess.run([*command, "replay", file], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "200 frames of 3 worlds are equal" in done.stdout


def test_resets_and_writes_are_answered_at_once(scene: tl.Scene) -> None:
    with launched(scene, 0.001) as sim:  # a frame takes 2 s
        start = time.monotonic()
        sim.reset()
        sim.write(joint_q=[0.5])
        sim.forward()
        assert time.monotonic() - start < 2.0


def test_timing_begins_anew(scene: tl.Scene) -> None:
    with launched(scene, None) as sim:
        for _ in range(10):
            sim.step()
        assert sim.restart_timing().frames == 10
        assert sim.timing.frames == 0
        sim.step()
        timing = sim.timing
        assert timing.frames == 1
        assert timing.busy.p50 > 0.0
        assert timing.busy.worst >= timing.busy.p999 >= timing.busy.p50
        assert "p99.9" in str(timing)
        assert timing.missed == timing.late == timing.skipped == 0


@pytest.mark.parametrize(
    ("realtime", "said"),
    [
        (0.0, "realtime"),
        (-1.0, "realtime"),
        (float("nan"), "realtime"),
        (1e9, "factor"),
        (1e-9, "factor"),
        ("fast", "realtime"),
        (tl.RealTime(cores=(4000,)), "numbers end"),
    ],
)
def test_wrong_choices_are_named(scene: tl.Scene, realtime: float | tl.RealTime, said: str) -> None:
    with pytest.raises(tl.ArgumentError, match=said):
        launched(scene, realtime)


def test_a_time_out_is_of_holding_alone() -> None:
    with pytest.raises(tl.ArgumentError, match='needs late="hold"'):
        tl.RealTime(command_timeout=1.0)


def test_what_the_system_refuses_is_noted(scene: tl.Scene) -> None:
    with launched(scene, tl.RealTime(priority=10, lock_memory=True, cores=(0,))) as sim:
        sim.step()
        assert os.sched_getaffinity(sim.pid) == {0}
        status = Path(f"/proc/{sim.pid}/status").read_text()
        is_locked = "VmLck:\t       0 kB" not in status
        assert is_locked != any("memory was not locked" in note for note in sim.info["notes"])
        is_urgent = os.sched_getscheduler(sim.pid) == os.SCHED_FIFO
        assert is_urgent != any("priority 10 was not granted" in note for note in sim.info["notes"])


CONTROLLER = """
import sys
import tightloop as tl
sim = tl.attach(sys.argv[1])
print(int(sim.step(joint_f=[0.01]).step[0]), flush=True)
while True:
    sim.step(joint_f=[0.01])
"""


@pytest.fixture
def controllers() -> Iterator[list[subprocess.Popen[str]]]:
    """Processes that are killed in the end."""
    running: list[subprocess.Popen[str]] = []
    yield running
    for process in running:
        process.kill()
        process.wait()


@pytest.mark.parametrize("late", ["pause", "hold", "stop"])
def test_a_killed_controller_leaves_the_plant_as_chosen(
    scene: tl.Scene, late: str, controllers: list[subprocess.Popen[str]]
) -> None:
    """TIGHTLOOP_ROUNDS is their number; ``make kills`` has 200."""
    rounds = int(os.environ.get("TIGHTLOOP_ROUNDS", "4"))
    rng = np.random.default_rng(7)
    with tl.launch(scene, worlds=1, realtime=tl.RealTime(late=late), device="cpu", threads=1) as sim:
        sim.step()
        sim.release()
        steps = 0
        with tl.attach(sim.name) as observer:
            for _ in range(rounds):
                process = subprocess.Popen(
                    [sys.executable, "-c", CONTROLLER, sim.name], stdout=subprocess.PIPE, text=True
                )
                controllers.append(process)
                assert process.stdout is not None
                first = int(process.stdout.readline())
                assert first > steps
                time.sleep(float(rng.uniform(0.0, 0.05)))
                process.send_signal(signal.SIGKILL)
                process.wait()
                time.sleep(0.2)
                before = latest(observer, first)
                time.sleep(0.2)
                steps = latest(observer, before)
                if late == "pause":
                    assert steps == before
                else:
                    assert steps > before


def latest(observer: tl.Sim, seen: int) -> int:
    """The steps that an observer sees, once what was on its way has come; those seen before where nothing came."""
    for _ in range(3):
        frame = observer.latest(0.1)
        if frame is not None:
            seen = int(frame.step[0])
    return seen
