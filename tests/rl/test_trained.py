"""The policies in ``examples/trained`` do what they were trained for."""

from __future__ import annotations

import sys
from pathlib import Path

import onnxruntime
import pytest

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
