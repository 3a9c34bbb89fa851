"""The policies in ``examples/trained`` do what they were trained for."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import onnxruntime
import pytest

from tightloop import demo
from tightloop.demo.policy import Policy

EXAMPLES = Path(__file__).parents[2] / "examples"
sys.path.insert(0, str(EXAMPLES))

from evaluation import evaluate  # noqa: E402  (examples are no package)

# Marks: error [m] at most, success at least
MARKS = {
    "CartPoleSwingUp": ("success", 0.95),
    "FrankaReach": ("error", 0.02),
    "FrankaPushCube": ("success", 0.9),
    "FrankaPickCube": ("success", 0.8),
}


@pytest.mark.parametrize("task", MARKS)
def test_a_trained_policy_meets_its_mark(task: str) -> None:
    policy = onnxruntime.InferenceSession(EXAMPLES / "trained" / f"{task}.onnx", providers=["CPUExecutionProvider"])
    found = evaluate(task, lambda obs: policy.run(["action"], {"obs": obs})[0], threads=1)
    name, mark = MARKS[task]
    assert found[name] <= mark if name == "error" else found[name] >= mark, found


def test_the_demos_policy_is_the_trained_one() -> None:
    policy = onnxruntime.InferenceSession(EXAMPLES / "trained/FrankaPickCube.onnx", providers=["CPUExecutionProvider"])
    obs = np.random.default_rng(0).normal(size=(50, 42)).astype(np.float32)
    (action,) = policy.run(["action"], {"obs": obs})
    own = Policy(Path(demo.__file__).with_name("pick_cube.npz"))(obs)
    # some hundred roundings of float32 in each of three layers
    np.testing.assert_allclose(own, action, rtol=1e-4, atol=1e-4)
