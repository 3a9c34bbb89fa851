"""The policies in ``examples/trained`` do what they were trained for."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import onnxruntime
import pytest

from tightloop import assets

EXAMPLES = Path(__file__).parents[2] / "examples"
sys.path.insert(0, str(EXAMPLES))

from evaluation import evaluate  # noqa: E402  (examples are no package)

# Marks: error [m or m/s] at most, success or return at least
MARKS = {
    "CartPoleSwingUp": ("success", 0.95),
    "FrankaReach": ("error", 0.02),
    "FrankaPushCube": ("success", 0.9),
    "FrankaPickCube": ("success", 0.8),
    "QuadrupedVelocityFlat": ("velocity_error", 0.15),
    "HumanoidVelocityFlat": ("velocity_error", 0.15),
    "Ant-v5": ("return", 3000.0),
}


@pytest.mark.parametrize("task", MARKS)
def test_a_trained_policy_meets_its_mark(task: str) -> None:
    policy = onnxruntime.InferenceSession(EXAMPLES / "trained" / f"{task}.onnx", providers=["CPUExecutionProvider"])
    found = evaluate(task, lambda obs: policy.run(["action"], {"obs": obs.astype(np.float32)})[0], threads=1)
    name, mark = MARKS[task]
    assert found[name] <= mark if name.endswith("error") else found[name] >= mark, found


def test_a_quadruped_walks_in_mujoco_as_well() -> None:
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / "sim2sim.py"), str(EXAMPLES / "trained/QuadrupedVelocityFlat.onnx")],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    apart = [float(number) for number in re.findall(r"joints are (\S+) rad apart", done.stdout)]
    seen = [float(number) for number in re.findall(r"observations (\S+)$", done.stdout, re.M)]
    errors = np.array(
        [[float(n) for n in row.split(" m/s")[:2]] for row in re.findall(r"([\d.]+ m/s +[\d.]+ m/s)", done.stdout)]
    )
    # a second of contacts in float64 doubles a rounding some twenty times
    assert len(apart) == 5 and max(apart) < 2.0**-30
    # fifty additions to a phase of 2π·2.5 in float32, and velocities of some ten rad/s
    assert len(seen) == 5 and max(seen) < 64 * 16.0 * 2.0**-24
    assert errors.shape == (6, 2) and errors.max() < 0.15 and np.abs(errors[:, 0] - errors[:, 1]).max() < 0.01


@pytest.mark.parametrize("task", assets.POLICIES)
def test_a_policy_of_the_wheel_is_the_trained_one(task: str) -> None:
    policy = onnxruntime.InferenceSession(EXAMPLES / f"trained/{task}.onnx", providers=["CPUExecutionProvider"])
    obs = np.random.default_rng(0).normal(size=(50, policy.get_inputs()[0].shape[1])).astype(np.float32)
    (action,) = policy.run(["action"], {"obs": obs})
    # some hundred roundings of float32 in each of three layers
    np.testing.assert_allclose(assets.policy(task)(obs), action, rtol=1e-4, atol=1e-4)
