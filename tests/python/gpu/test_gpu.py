"""Worlds on a GPU through the daemon: lavapipe, Mesa's software Vulkan, is one. It is required."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import tightloop as tl

ROOT = Path(__file__).parents[3]
URDF = ROOT / "examples/assets/fr3/fr3_franka_hand.urdf"
WORLDS = 130


def scene() -> tl.Scene:
    scene = tl.Scene(dt=1 / 480, substeps=8)
    arm = scene.add_urdf(URDF, name="arm")
    arm.joint_q = [0.0, 0.0, 0.0, -2.4, 0.0, 2.4, 0.8, 0.04, 0.04]
    arm.joint_target_ke, arm.joint_target_kd = 400.0, 40.0
    return scene


def targets(frame: int) -> np.ndarray:
    """Drive targets [rad or m], shape ``(WORLDS, 9)``."""
    start = np.array([0.0, 0.0, 0.0, -2.4, 0.0, 2.4, 0.8, 0.04, 0.04])
    return start + 0.01 * frame * np.sin(np.arange(WORLDS))[:, None]


def test_worlds_are_those_of_the_cpu_and_frames_come_without_a_copy():
    seen = {}
    for device in ("cpu", "gpu"):
        with tl.launch(scene(), worlds=WORLDS, device=device, fields=("joint_q", "joint_qd", "body_q")) as sim:
            assert sim.device.startswith(device)
            delivery = sim.info["delivery"]
            last = sim.reset()
            frames = [last]
            frames += [sim.step(joint_target_q=targets(frame)) for frame in range(3)]
            # more frames than slots of shared memory: each slot is written again
            del frames
            for frame in range(3, 20):
                last = sim.step(joint_target_q=targets(frame))
            seen[device] = [np.copy(x) for x in (last.joint_q, last.joint_qd, last.body_q, last.time, last.step)]
    assert delivery == "imported"
    for cpu, gpu in zip(seen["cpu"], seen["gpu"], strict=True):
        np.testing.assert_allclose(gpu, cpu, atol=2e-5)
    np.testing.assert_array_equal(seen["cpu"][3], seen["gpu"][3])
    np.testing.assert_array_equal(seen["cpu"][4], seen["gpu"][4])


@pytest.mark.parametrize("field", ["qpos", "qvel"])
def test_a_field_made_of_the_state_needs_no_other_field(field):
    seen = {}
    for device in ("cpu", "gpu"):
        with tl.launch(scene(), worlds=3, device=device, fields=(field,)) as sim:
            last = sim.reset()
            for frame in range(3):
                last = sim.step(joint_target_q=targets(frame)[:3])
            seen[device] = np.array(getattr(last, field))
    assert np.abs(seen["cpu"]).max() > 1e-3
    np.testing.assert_allclose(seen["gpu"], seen["cpu"], atol=1e-5)


def test_a_new_client_gets_frames_in_memory_of_its_own():
    with tl.launch(scene(), worlds=WORLDS, device="gpu") as sim:
        sim.step(joint_target_q=targets(0))
        for _ in range(2):
            # a controller that comes and is killed: its lease and its memory go with it
            code = (
                f"import tightloop as tl, os\n"
                f"sim = tl.attach({sim.name!r})\n"
                f"frame = sim.step()\n"
                f"print(frame.step[0], flush=True)\n"
                f"os.kill(os.getpid(), 9)\n"
            )
            subprocess.run([sys.executable, "-c", code], capture_output=True, check=False, timeout=60)
        assert np.isfinite(sim.step(joint_target_q=targets(1)).joint_q).all()


def test_parameters_snapshots_and_seeds_work_there(tmp_path):
    drawn = scene()
    drawn.randomize(joint_q={"arm/fr3_joint1": tl.Uniform(-0.1, 0.1)})
    with tl.launch(drawn, worlds=WORLDS, device="gpu", params=("gravity",)) as sim:
        start = np.copy(sim.reset(seed=3).joint_q)
        kept = sim.snapshot()
        assert np.ptp(start[:, 0]) > 0.1
        sim.params.gravity = np.tile([0.0, 0.0, -1.0], (WORLDS, 1))
        moved = sim.step(joint_target_q=targets(0))
        for frame in range(1, 4):
            moved = sim.step(joint_target_q=targets(frame))
        assert np.abs(np.copy(moved.joint_q) - start).max() > 1e-3
        sim.restore(kept)
        np.testing.assert_array_equal(sim.forward().joint_q, start)
        np.testing.assert_array_equal(sim.params.gravity[0], np.array([0.0, 0.0, -9.81], np.float32).astype(float))
        mask = np.arange(WORLDS) % 2 == 0
        again = sim.reset(mask=mask, seed=3)
        np.testing.assert_array_equal(again.joint_q[mask], start[mask])


def test_an_environment_runs_there():
    pytest.importorskip("gymnasium")
    from tightloop.env import VectorEnv

    env = VectorEnv("CartPoleSwingUp", 70, device="gpu")
    try:
        observed, _ = env.reset(seed=1)
        env.action_space.seed(2)
        reward = np.zeros(70)
        for _ in range(30):
            observed, reward, *_ = env.step(env.action_space.sample())
        assert np.isfinite(observed).all() and np.isfinite(reward).all()
        assert env.sim.device.startswith("gpu")
    finally:
        env.close()


def test_a_recording_of_a_gpu_replays_on_it_bit_for_bit(tmp_path):
    out = tmp_path / "run.tlrec"
    command = Path(sys.executable).with_name("tightloop")
    with tl.launch(scene(), worlds=9, device="gpu") as sim:
        recorder = subprocess.Popen([command, "record", sim.name, out, "--frames", "12"], stderr=subprocess.PIPE)
        try:
            for _ in range(2000):
                sim.step(joint_target_q=targets(0)[:9])
                if recorder.poll() is not None:
                    break
            assert recorder.wait(30) == 0
        finally:
            recorder.kill()
    replayed = subprocess.run([command, "replay", out], capture_output=True, text=True, timeout=120, check=False)
    assert replayed.returncode == 0, replayed.stdout + replayed.stderr


def test_devices_are_listed():
    command = Path(sys.executable).with_name("tightloop")
    listed = subprocess.run([command, "devices"], capture_output=True, text=True, timeout=60, check=True)
    assert listed.stdout.startswith("0  ") and "vulkan" in listed.stdout
