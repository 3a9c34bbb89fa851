"""``launch(cpu_bits=True)``: frames of a GPU have the bits of the CPU, so a recording of one replays on the other."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import tightloop as tl
from tightloop.errors import ArgumentError

ROOT = Path(__file__).parents[3]
URDF = ROOT / "examples/assets/fr3/fr3_franka_hand.urdf"
WORLDS = 9
# What the loader of Vulkan calls it now, and did before
NO_DRIVER = {"VK_DRIVER_FILES": "/nonexistent", "VK_ICD_FILENAMES": "/nonexistent"}
FIELDS = ("joint_q", "joint_qd", "joint_qdd", "body_q", "body_qd", "mass_matrix", "joint_q_measured")


@pytest.fixture
def arm() -> tl.Scene:
    """An arm with drives, whose starts and friction are drawn."""
    scene = tl.Scene(dt=1 / 480, substeps=8)
    robot = scene.add_urdf(URDF, name="arm")
    robot.joint_q = [0.0, 0.0, 0.0, -2.4, 0.0, 2.4, 0.8, 0.04, 0.04]
    robot.joint_target_ke, robot.joint_target_kd = 400.0, 40.0
    some = {"arm/fr3_joint1": tl.Uniform(-0.1, 0.1), "arm/fr3_joint4": tl.Normal(0.0, 0.05)}
    scene.randomize(joint_q=some, params={"joint_friction": {"arm/fr3_joint2": tl.Uniform(0.0, 0.2)}})
    return scene


def targets(frame: int) -> np.ndarray:
    """Drive targets [rad or m], shape ``(WORLDS, 9)``."""
    start = np.array([0.0, 0.0, 0.0, -2.4, 0.0, 2.4, 0.8, 0.04, 0.04])
    return start + 0.02 * frame * np.sin(np.arange(WORLDS))[:, None]


def frames(scene: tl.Scene, device: str) -> list[bytes]:
    """The bytes of all fields of some frames."""
    params = ("joint_q_noise", "joint_target_q_noise")
    with tl.launch(scene, worlds=WORLDS, device=device, fields=FIELDS, params=params, cpu_bits=True) as sim:
        sim.params.write(joint_q_noise=0.01, joint_target_q_noise=0.01)
        assert sim.info["cpu_bits"]
        assert sim.device.startswith(device)
        assert ("bits of the CPU" in sim.device) == (device == "gpu")
        seen = sim.reset(seed=3)
        shown = []
        for frame in range(12):
            shown += [np.ascontiguousarray(getattr(seen, name)).tobytes() for name in FIELDS]
            seen = sim.step(joint_target_q=targets(frame))
        assert not seen.status.any()
        return shown


def test_frames_of_a_gpu_have_the_bytes_of_the_cpu(arm):
    assert frames(arm, "gpu") == frames(arm, "cpu")


def test_a_recording_of_a_gpu_replays_on_the_cpu_of_a_machine_without_one(arm, tmp_path):
    path = tmp_path / "run.tlrec"
    with tl.launch(arm, worlds=WORLDS, device="gpu", cpu_bits=True) as sim, sim.record(path, fields=["joint_q"]):
        sim.reset(seed=5)
        for frame in range(20):
            sim.step(joint_target_q=targets(frame))
    command = [sys.executable, "-m", "tightloop", "replay", str(path)]
    env = {"PATH": "/usr/bin:/bin", **NO_DRIVER}
    done = subprocess.run(command, env=env, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.search(r"\b2[01] frames", done.stdout), done.stdout


BALLS = "".join(
    f'<body pos="{0.099 * k:.3f} 0 0.0499"><freejoint/>'
    f'<geom size="0.05" pos="0 {0.01 * k} 0" condim="6" friction="0.8 0.02 0.01"/></body>'
    for k in range(2)
)
PENDULUM = (
    '<body pos="0 0 0.25"><joint type="hinge" axis="0 1 0" damping="0.01"/>'
    '<geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.02"/>'
    '<body pos="0 0 -0.2"><joint type="ball"/><geom size="0.04" pos="0 0 -0.012"/></body></body>'
)


@pytest.mark.parametrize(("option", "bodies"), [('cone="elliptic"', BALLS), ('integrator="RK4"', PENDULUM)])
def test_models_of_mujoco_have_the_bits_of_the_cpu(option, bodies, tmp_path):
    pytest.importorskip("mujoco")
    path = tmp_path / "model.xml"
    plane = '<geom type="plane" size="5 5 1"/>'
    path.write_text(f'<mujoco><option timestep="0.002" {option}/><worldbody>{plane}{bodies}</worldbody></mujoco>')
    seen = {}
    for device in ("cpu", "gpu"):
        scene = tl.Scene.from_mujoco(path, substeps=2)
        fields = ("joint_q", "joint_qd", "contact_count", "contact_force")
        with tl.launch(scene, worlds=3, device=device, fields=fields, cpu_bits=True) as sim:
            frame = sim.reset()
            sim.write(joint_qd=np.sin(np.arange(frame.joint_qd.size)).reshape(frame.joint_qd.shape))
            for _ in range(10):
                frame = sim.step()
            assert frame.contact_count.any()
            seen[device] = b"".join(np.array(getattr(frame, name)).tobytes() for name in fields)
    assert seen["gpu"] == seen["cpu"]


def test_single_precision_alone_has_them(arm):
    with pytest.raises(ArgumentError, match="single precision"):
        tl.launch(arm, worlds=2, device="gpu", precision="f64", cpu_bits=True)
    # the CPU has its own bits in any precision
    with tl.launch(arm, worlds=2, device="cpu", precision="f64", cpu_bits=True) as sim:
        assert np.isfinite(sim.step().joint_q).all()
