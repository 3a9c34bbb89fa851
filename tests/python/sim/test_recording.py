"""Recordings of real daemons: everything that Python can ask for is replayed bit for bit, from the command line."""

from __future__ import annotations

import os
import queue
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import tightloop as tl

WORLDS = 21
COMMAND = [sys.executable, "-m", "tightloop"]


class Recorder:
    """`tightloop record`, once it has begun."""

    def __init__(self, sim: tl.Sim, out: Path, *flags: str) -> None:
        command = [*COMMAND, "record", sim.name, str(out), *flags]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert self.process.stderr is not None
        said = self.process.stderr.readline()
        assert "recording" in said, said

    def finish(self) -> str:
        """What it said once it ended, as asked."""
        said, news = self.process.communicate(timeout=60)
        assert self.process.returncode == 0, news
        return said

    def stop(self, with_signal: int) -> str:
        """As `finish`, after a signal."""
        self.process.send_signal(with_signal)
        return self.finish()


def replay(out: Path, *flags: str) -> tuple[int, str]:
    """Exit code and all that was said."""
    done = subprocess.run(
        [*COMMAND, "replay", str(out), *flags], capture_output=True, text=True, timeout=60, check=False
    )
    return done.returncode, done.stdout + done.stderr


def act(sim: tl.Sim, snapshots: list[tl.Snapshot], count: int, seed: int) -> bool:
    """Commands of every kind; whether a world faulted."""
    rng = np.random.default_rng(seed)
    kinds: list[Callable[[], object]] = [
        lambda: sim.reset(mask=rng.random(WORLDS) > 0.5),
        lambda: sim.reset(seed=rng.integers(0, 100, WORLDS)),
        lambda: sim.reset(joint_q=rng.normal(size=(WORLDS, 2)), mask=rng.random(WORLDS) > 0.5),
        lambda: sim.write(joint_q=rng.normal(size=(WORLDS, 2)), mask=rng.random(WORLDS) > 0.5),
        lambda: sim.params.write(body_mass_scale=rng.uniform(0.5, 2, (WORLDS, 3))),
        lambda: sim.step(body_f=rng.normal(size=(WORLDS, 3, 6))),
        lambda: snapshots.append(sim.snapshot()),
        lambda: sim.restore(snapshots[-1], worlds=rng.random(WORLDS) > 0.5),
        lambda: sim.restore(snapshots[0], from_world=int(rng.integers(WORLDS))),
        sim.forward,
        # far beyond the bounds, in which a world is frozen and, where the run resets, reset
        lambda: sim.step(joint_f=rng.normal(size=(WORLDS, 2)) * 1e5 * (rng.random((WORLDS, 1)) > 0.9)),
    ]
    trouble = False
    for _ in range(count):
        kind = rng.integers(4 * len(kinds))
        done = kinds[kind]() if kind < len(kinds) else sim.step(joint_f=rng.normal(size=(WORLDS, 2)))
        trouble |= isinstance(done, tl.Frame) and bool(done.status.any())
    return trouble


@pytest.mark.parametrize("precision", ["f32", "f64"])
@pytest.mark.parametrize(
    "options",
    [
        {"on_fault": "freeze"},
        {"on_fault": "reset", "outputs_at": "last_substep"},
        {"on_fault": "reset", "draws": "seed"},
    ],
)
def test_everything_is_replayed_with_the_same_bits(pendulum, tmp_path, precision, options):
    pendulum.randomize(joint_q={"arm": tl.Uniform(-0.2, 0.2)})
    out = tmp_path / "run.tlrec"
    params, bounds = ("body_mass_scale", "body_f"), {"joint_qd": 50}
    with tl.launch(pendulum, worlds=WORLDS, precision=precision, params=params, bounds=bounds, **options) as sim:
        assert options.items() <= sim.info.items()
        snapshots = [sim.snapshot()]
        act(sim, snapshots, 50, seed=1)
        recorder = Recorder(sim, out, "--frames", "400", "--fields", "joint_q,body_q,status")
        assert act(sim, snapshots, 400, seed=2), "worlds went beyond the bounds"
        said = recorder.finish()
        assert "400 frames" in said and "no gaps" in said
    code, said = replay(out)
    assert code == 0 and "400 frames of 21 worlds are equal, bit for bit" in said, said
    assert replay(out, "--threads", "1", "--frames", "5")[1].count(" 5 frames of 21 worlds are equal") == 1


@pytest.mark.parametrize("worlds", [1, 300])
def test_states_much_larger_than_commands_are_recorded(pendulum, tmp_path, worlds):
    # with 700 frames of commands on their way; noise, delays and sensors are replayed too
    pendulum.command_delay_max = 700 * pendulum.substeps
    pendulum.add_site(body="arm/lower")
    pendulum.randomize(params={"command_delay": tl.Uniform(0, 700 * pendulum.substeps)})
    out = tmp_path / "run.tlrec"
    params, fields = ("joint_f_noise", "gyro_noise"), ("joint_q", "site_q", "gyro", "accelerometer")
    with tl.launch(pendulum, worlds=worlds, params=params, fields=fields) as sim:
        sim.params.write(joint_f_noise=0.3, gyro_noise=0.1)
        rng = np.random.default_rng(3)
        recorder = Recorder(sim, out, "--frames", "100")
        kept = sim.snapshot()
        for frame in range(100):
            sim.step(joint_f=rng.normal(size=(worlds, 2)))
            if frame == 50:
                sim.restore(kept)
        said = recorder.finish()
    assert "no gaps" in said, said
    code, said = replay(out)
    assert code == 0 and "100 frames" in said, said


def test_ctrl_c_ends_a_recording_and_another_may_take_its_place_when_forced(pendulum, tmp_path):
    out = tmp_path / "run.tlrec"
    with tl.launch(pendulum, worlds=WORLDS) as sim:
        recorder = Recorder(sim, out)
        for _ in range(30):
            sim.step()
        # at once: the last of them wait for the recorder still
        assert "30 frames" in recorder.stop(signal.SIGINT)
        again = [*COMMAND, "record", sim.name, str(out)]
        done = subprocess.run(again, capture_output=True, text=True, check=False)
        assert done.returncode == 1 and "is there already" in done.stderr
        assert "30 frames" in replay(out)[1]
        recorder = Recorder(sim, out, "--force", "--seconds", "0.5")
        for _ in range(7):
            sim.step()
        assert "7 frames" in recorder.finish()
        assert "7 frames" in replay(out)[1]


@pytest.mark.skipif(sys.platform != "linux", reason="a limit on the size of files stands for a full disk")
def test_a_forced_recording_that_is_not_whole_leaves_the_old_one(pendulum, tmp_path):
    import resource

    out, link = tmp_path / "run.tlrec", tmp_path / "link.tlrec"
    link.symlink_to(out)

    with tl.launch(pendulum, worlds=WORLDS) as sim:
        recorder = Recorder(sim, out, "--frames", "30")
        for _ in range(30):
            sim.step()
        recorder.finish()
        old = out.read_bytes()
        recorder = Recorder(sim, link, "--force")
        sim.step()
        recorder.process.kill()
        recorder.process.communicate()
        assert out.read_bytes() == old
        # what the killed one wrote is there, and readable
        assert {*tmp_path.glob("*.tlrec")} == {out, link, tmp_path / "run.part.tlrec"}
        limited = ["sh", "-c", "trap '' XFSZ; exec \"$@\"", "sh", *COMMAND]
        command = [*limited, "record", sim.name, str(link), "--force"]
        with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as full:
            assert full.stderr is not None and "recording" in full.stderr.readline()
            busy = subprocess.run(
                [*COMMAND, "record", sim.name, str(out), "--force"], capture_output=True, text=True, check=False
            )
            assert busy.returncode == 1 and "another recorder replaces it" in busy.stderr, busy.stderr
            # files of at most 16 kB; a write beyond is an error, as on a full disk
            resource.prlimit(full.pid, resource.RLIMIT_FSIZE, (1 << 14, 1 << 14))
            while full.poll() is None:
                sim.step(joint_f=np.random.default_rng(1).normal(size=(WORLDS, 2)))
            said = full.stderr.read()
        assert full.returncode == 1 and "the old recording stays; make room" in said, said
        assert out.read_bytes() == old
        assert {*tmp_path.glob("*.tlrec")} == {out, link}
        recorder = Recorder(sim, link, "--force", "--frames", "7")
        for _ in range(7):
            sim.step()
        recorder.finish()
    assert link.is_symlink() and "7 frames" in replay(out)[1]


def test_a_recording_under_a_loop_that_goes_on_ends_when_it_is_closed(pendulum, tmp_path):
    with tl.launch(pendulum, worlds=WORLDS) as sim:
        for flags, ending in (((), signal.SIGINT), (("--seconds", "0.3"), None)):
            recorder = Recorder(sim, tmp_path / f"{ending}.tlrec", *flags)
            for _ in range(200):
                sim.step()
            if ending is not None:
                recorder.process.send_signal(ending)
            steps = 0
            while recorder.process.poll() is None:
                sim.step()
                steps += 1
            said = recorder.finish()
            frames = int(said.split(" frames")[0].split()[-1])
            # 0.3 s may be over before the 200 steps are
            least = 1 if ending is None else 200
            assert "no gaps" in said and least <= frames <= 200 + steps, said
            code, told = replay(tmp_path / f"{ending}.tlrec")
            assert code == 0 and f"{frames} frames" in told, told


def test_a_recorder_that_stands_now_and_then_goes_on_and_the_steps_that_are_missing_are_named(pendulum, tmp_path):
    out, news = tmp_path / "run.tlrec", queue.Queue()
    with tl.launch(pendulum, worlds=WORLDS) as sim:
        recorder = Recorder(sim, out)
        errors = recorder.process.stderr
        assert errors is not None
        reader = threading.Thread(target=lambda: [news.put(line) for line in errors])
        reader.start()
        for _ in range(3):
            recorder.process.send_signal(signal.SIGSTOP)
            # far more than wait in shared memory
            for _ in range(12_000):
                sim.step(joint_f=np.ones(2))
            recorder.process.send_signal(signal.SIGCONT)
            # it has the state behind the gap once it reports it, under a loop that goes on
            limit = time.monotonic() + 60
            while news.empty() and time.monotonic() < limit:
                sim.step(joint_f=-np.ones(2))
            assert "a gap: " in news.get_nowait()
            for _ in range(100):
                sim.step(joint_f=np.ones(2))
        steps = int(sim.step().step[0])
        recorder.process.send_signal(signal.SIGINT)
        reader.join()
        assert recorder.process.stdout is not None
        said = recorder.process.stdout.read()
        assert recorder.process.wait() == 0
    frames = int(said.split(" frames")[0].split()[-1])
    assert "gaps of " in said and frames >= 100, said
    code, said = replay(out)
    assert code == 1 and f"{frames} frames are equal, bit for bit" in said, said
    missing = re.findall(r"of world 0 the steps (\d+) to (\d+)", said)
    assert len(missing) >= 3, said
    named = frames + sum(int(last) - int(first) + 1 for first, last in missing)
    # where others take the processor, there may be more gaps than are listed
    assert named == steps or (named < steps and "more gaps" in said), said


def test_a_killed_recorder_leaves_a_file_and_a_daemon_that_go_on(pendulum, tmp_path):
    out = tmp_path / "run.tlrec"
    with tl.launch(pendulum, worlds=WORLDS) as sim:
        recorder = Recorder(sim, out)
        for _ in range(2000):
            sim.step(joint_f=np.ones(2))
        recorder.process.kill()
        recorder.process.communicate()
        for _ in range(20):
            sim.step()
        code, said = replay(out)
        assert code == 0 and "its recorder was killed" in said, said


@pytest.mark.parametrize(
    ("content", "words"),
    [(b"", "is no recording"), (b"dt = 0.002\n", "is no recording"), (None, "No such file")],
)
def test_what_is_no_recording_is_refused_with_code_2(tmp_path, content, words):
    out = tmp_path / "run.tlrec"
    if content is not None:
        out.write_bytes(content)
    code, said = replay(out)
    assert code == 2 and words in said and "run.tlrec" in said


MODEL = """
<mujoco>
  <worldbody>
    <body name="hand" mocap="true" pos="0 0 1"/>
    <body name="held" pos="0 0 1"><freejoint/><geom size=".1"/>
      <body pos="0 0 .2"><joint name="hinge"/><geom size=".05" pos=".1 0 0"/></body></body>
  </worldbody>
  <equality><weld body1="hand" body2="held"/></equality>
  <actuator><general joint="hinge" dyntype="filter" dynprm=".1"/></actuator>
  <keyframe><key name="up" qpos="0 0 2 1 0 0 0 .3" act=".2"/></keyframe>
</mujoco>"""


def test_what_models_from_mujoco_hold_is_replayed_with_the_same_bits(tmp_path):
    mujoco = pytest.importorskip("mujoco")
    scene = tl.Scene.from_mujoco(mujoco.MjModel.from_xml_string(MODEL), name="m")
    scene.save(tmp_path / "scene.toml")
    rng, out = np.random.default_rng(0), tmp_path / "run.tlrec"
    with tl.launch(tl.Scene.load(tmp_path / "scene.toml"), worlds=3, fields=("qpos", "act", "eq_active")) as sim:
        recorder = Recorder(sim, out, "--frames", "60")
        sim.reset(keyframe="up")
        for number in range(59):
            active = (rng.random((3, 1)) < 0.5).astype(float)
            sim.step(eq_active=active, mocap_pos=rng.normal(0, 0.1, (3, 1, 3)), ctrl=rng.normal(size=(3, 1)))
            if number == 30:
                sim.reset(keyframe=0, mask=np.array([True, False, True]))
                sim.write(act=rng.normal(size=(3, 1)), eq_active=1.0 - active)
        recorder.finish()
    assert replay(out)[0] == 0


def test_a_simulation_records_itself_from_python(pendulum, tmp_path):
    out, rng = tmp_path / "run.tlrec", np.random.default_rng(5)
    with tl.launch(pendulum, worlds=3) as sim:
        sim.step(joint_f=rng.normal(size=(3, 2)))
        with sim.record(out, fields=["joint_q"]) as recording:
            assert recording.open and recording.path == out
            for _ in range(30):
                sim.step(joint_f=rng.normal(size=(3, 2)))
        assert not recording.open and "30 frames" in recording.summary and "no gaps" in recording.summary
        recording.close()
        sim.step()
        # the next one begins at the state that the first left
        again = sim.record(tmp_path / "again.tlrec")
        assert sim._companions == [again] and recording.closed
        sim.step()
    # the end of the simulation is that of its recordings
    assert not again.open
    for file, frames in ((out, 30), (tmp_path / "again.tlrec", 1)):
        code, said = replay(file)
        assert code == 0 and f" {frames} frames of 3 worlds are equal, bit for bit" in said, said


def test_what_cannot_be_recorded_is_refused_with_the_reason(pendulum, tmp_path):
    out = tmp_path / "run.tlrec"
    out.write_text("mine")
    with tl.launch(pendulum, worlds=2) as sim:
        with pytest.raises(tl.RecordingError, match=r"is there already.*force=True"):
            sim.record(out)
        assert out.read_text() == "mine"
        with pytest.raises(tl.RecordingError, match="nothing"):
            sim.record(tmp_path / "other.tlrec", fields=["nothing"])
        with pytest.raises(tl.RecordingError, match="no-folder"):
            sim.record(tmp_path / "no-folder" / "run.tlrec")
        with pytest.raises(tl.ArgumentError, match=r"fields is 'joint_q'; give a list"):
            sim.record(out, fields="joint_q")
        with sim.record(out, force=True):
            sim.step()
    assert replay(out)[0] == 0
    with pytest.raises(tl.SimClosed, match="record: the simulation was closed"):
        sim.record(out, force=True)


OWNER = """
import sys
import time
import tightloop as tl
sim = tl.attach(sys.argv[1])
recording = sim.record(sys.argv[2])
sim.step()
print(recording.pid, flush=True)
time.sleep(60)
"""


def test_a_recording_ends_with_a_killed_owner_and_can_be_replayed(pendulum, tmp_path):
    out = tmp_path / "run.tlrec"
    scene = tmp_path / "scene.toml"
    pendulum.save(scene)
    with subprocess.Popen(
        [*COMMAND, "serve", str(scene), f"--name=owned-{os.getpid()}"], stdout=subprocess.PIPE
    ) as serving:
        try:
            assert serving.stdout is not None and serving.stdout.readline()
            command = [sys.executable, "-c", OWNER, f"owned-{os.getpid()}", str(out)]
            with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as owner:
                assert owner.stdout is not None
                recorder = int(owner.stdout.readline())
                owner.kill()
            deadline = time.monotonic() + 10
            while Path(f"/proc/{recorder}").exists() and time.monotonic() < deadline:
                time.sleep(0.02)
            assert not Path(f"/proc/{recorder}").exists()
        finally:
            serving.terminate()
    code, said = replay(out)
    assert code == 0 and " 1 frames of 1 worlds are equal" in said, said
