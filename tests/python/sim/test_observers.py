"""Observers: what they see of a running daemon and of a recording is what its own frames say."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tightloop as tl
from conftest import START, STIFFNESS, URDF
from tightloop.view.browser.frame_stream import LiveStream
from tightloop.view.source import CONTACT_FIELDS, FIELDS, Live, Recorded, Shown

EVERYTHING = (*FIELDS, *CONTACT_FIELDS, "joint_qdd", "joint_torque", "bias_force", "body_contact_force")


def scene() -> tl.Scene:
    """An arm over a table, with a cube before it."""
    made = tl.Scene()
    arm = made.add_urdf(URDF, name="arm")
    arm.joint_target_ke, arm.joint_target_kd, arm.joint_q = STIFFNESS, 80.0, START
    made.add_box(half_extents=(1, 1, 0.05), pos=(0.5, 0, -0.05), name="table")
    cube = made.add_body(pos=(0.5, 0, 0.026), name="cube")
    made.add_box(half_extents=(0.025, 0.025, 0.025), body=cube, density=400.0)
    return made


def newest(source: Live, step: int) -> Shown:
    """What is shown once the worlds rest after a step."""
    deadline = time.monotonic() + 5
    while time.monotonic() < deadline:
        shown = source.poll(0.2)
        if shown is not None and (shown.step == step).all():
            return shown
    raise AssertionError(f"step {step} was not shown")


def same(shown: Shown, frame: Any, worlds: int) -> None:
    for name in EVERYTHING:
        np.testing.assert_array_equal(getattr(shown, name), getattr(frame, name)[:worlds], err_msg=name)


@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_an_observer_evaluates_any_field_of_the_first_worlds(precision: str) -> None:
    rng = np.random.default_rng(0)
    with tl.launch(scene(), worlds=37, precision=precision, fields=("joint_q",), params=("shape_mu",)) as sim:
        sim.params.write(shape_mu=rng.uniform(0.2, 1.0, sim.params.shape_mu.shape))
        source = Live(sim.name, worlds=5, fields=EVERYTHING)
        whole = Live(sim.name, worlds=1000, fields=EVERYTHING)
        assert (source.worlds, whole.worlds) == (5, 37)
        target = np.zeros((37, len(sim.dof_names)))
        target[:, :9] = START + rng.normal(0, 0.1, (37, 9))
        for _ in range(12):
            frame = sim.step(joint_target_q=target)
        # the same worlds with all of these fields in their frames
        twin_scene, snapshot = scene(), sim.snapshot()
        with tl.launch(twin_scene, worlds=37, precision=precision, fields=EVERYTHING, params=("shape_mu",)) as twin:
            frame = twin.restore(snapshot)
            assert (frame.contact_count > 0).any()
            same(newest(source, 12), frame, 5)
            same(newest(whole, 12), frame, 37)
        source.close()
        whole.close()
        assert sim.step().step[0] == 13


def test_worlds_on_a_gpu_are_seen_alike(pendulum_urdf: Path) -> None:
    rng = np.random.default_rng(2)
    small = tl.Scene()
    small.add_urdf(pendulum_urdf, name="arm")
    with tl.launch(small, worlds=70, device="gpu", fields=("joint_q", "body_q"), watch_worlds=66) as sim:
        source = Live(sim.name, worlds=66)
        sim.write(joint_q=rng.normal(size=(70, 2)))
        frames = [sim.step(joint_f=rng.normal(size=(70, 2))) for _ in range(3)]
        shown = newest(source, 3)
        np.testing.assert_array_equal(shown.joint_q, frames[-1].joint_q[:66])
        np.testing.assert_allclose(shown.body_q, frames[-1].body_q[:66], atol=1e-6)
        source.close()


def test_an_observer_that_rested_sees_the_present_and_knows_its_daemon(
    pendulum: tl.Scene, unique: Callable[[], str]
) -> None:
    name = unique()
    with tl.launch(pendulum, worlds=3, name=name) as sim:
        source = Live(name, worlds=2)
        newest(source, 0)
        source.rest()
        for _ in range(7):
            sim.step()
        assert newest(source, 7).joint_q.shape[0] == 2
        source.rest()
    with pytest.raises(tl.DaemonLost, match=name):
        source.poll(0.1)
    for groups in (1, 2):
        with tl.launch(pendulum, worlds=4, name=name, groups=groups), pytest.raises(tl.DaemonRestarted, match=name):
            source.poll(0.1)
    source.close()
    with pytest.raises(tl.SimClosed):
        source.poll(0.1)


def test_a_feed_that_rests_finds_that_its_daemon_is_gone(pendulum: tl.Scene, unique: Callable[[], str]) -> None:
    name = unique()
    with tl.launch(pendulum, worlds=3, name=name) as sim:
        stream = LiveStream(name, 2)
        for _ in range(3):
            stream.rest()
            time.sleep(0.6)
        os.kill(sim.pid, signal.SIGKILL)
        with pytest.raises(tl.DaemonLost):
            for _ in range(50):
                stream.rest()
                time.sleep(0.1)
        stream.close()


def test_latest_is_for_everybody_and_control_for_one() -> None:
    with tl.launch(scene(), worlds=3, watch_worlds=2) as sim:
        onlooker = tl.attach(sim.name)
        assert onlooker.info["watch_worlds"] == 2
        sim.step()
        assert onlooker.controller() == os.getpid()
        frame = onlooker.latest(2.0)
        assert frame is not None
        assert frame.joint_q.shape[0] == 2
        assert onlooker.latest() is None
        with pytest.raises(tl.LeaseHeld):
            onlooker.step()
        sim.release()
        assert onlooker.step().step[0] >= 1
        with pytest.raises(tl.LeaseHeld):
            sim.step()
        onlooker.release()
        sim.step()
        for wrong in ("soon", -1.0, float("nan")):
            with pytest.raises(tl.ArgumentError, match="timeout"):
                onlooker.latest(wrong)  # type: ignore[arg-type]
        onlooker.close()


def test_wrong_questions_are_refused_by_name(unique: Callable[[], str]) -> None:
    with pytest.raises(tl.UnknownDaemon):
        Live(unique())
    with tl.launch(scene(), worlds=1) as sim:
        with pytest.raises(tl.UnknownField, match="elbow_grease"):
            Live(sim.name, fields=("elbow_grease",))
        with pytest.raises(tl.ArgumentError, match="worlds"):
            Live(sim.name, worlds=0)
        source = Live(sim.name, fields=("body_q",))
        shown = source.poll(2.0)
        assert shown is not None
        with pytest.raises(tl.UnknownField, match=r"joint_qdd.*body_q"):
            _ = shown.joint_qdd
        os.kill(sim.pid, signal.SIGKILL)
        with pytest.raises(tl.DaemonLost):
            for _ in range(100):
                source.poll(0.1)


def test_a_recording_is_played_back_frame_by_frame(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    path = tmp_path / "run.tlrec"
    frames = []
    with tl.launch(scene(), worlds=9, fields=("joint_q", "body_q", "contact_count")) as sim:
        command = [sys.executable, "-m", "tightloop", "record", sim.name, str(path), "--frames", "41"]
        recorder = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
        assert recorder.stderr is not None
        assert "recording" in recorder.stderr.readline()
        target = np.zeros(len(sim.dof_names))
        for count in range(40):
            target[:9] = START + rng.normal(0, 0.1, 9)
            frames.append(sim.step(joint_target_q=target).copy())
            if count == 20:
                frames.append(sim.reset(mask=np.arange(9) < 3, seed=5).copy())
        assert recorder.wait(30) == 0, recorder.stderr.read()
    played = Recorded(path, worlds=4, fields=("joint_q", "body_q", "contact_count", "contact_force"))
    assert (played.worlds, played.info["worlds"], played.end) == (4, 9, None)
    for frame in frames:
        shown = played.poll()
        assert shown is not None
        assert np.isfinite(shown.contact_force).all()
        for name in ("joint_q", "body_q", "contact_count", "step", "time"):
            np.testing.assert_array_equal(getattr(shown, name), getattr(frame, name)[:4], err_msg=name)
    assert played.poll() is None
    assert played.poll() is None
    assert played.end


def test_what_is_no_recording_is_refused(tmp_path: Path) -> None:
    (tmp_path / "text").write_text("not a recording at all")
    for path, reason in [("text", "no recording"), ("missing", "cannot be read"), (".", "is no file")]:
        with pytest.raises(tl.RecordingError, match=reason):
            Recorded(tmp_path / path)
