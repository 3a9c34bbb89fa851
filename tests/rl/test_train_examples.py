"""``examples/train_sb3.py``, ``train_rsl_rl.py`` and ``train_skrl.py`` learn to balance, and leave a policy."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.parametrize(
    ("name", "unit", "files"),
    [
        ("train_sb3", "rollouts", ["model.zip", "normalize.pkl"]),
        ("train_rsl_rl", "iterations", ["model.pt", "policy.onnx"]),
        ("train_skrl", "updates", ["model.pt"]),
    ],
)
def test_it_learns_to_balance_and_leaves_a_policy(name, unit, files, tmp_path):
    command = [sys.executable, f"{EXAMPLES}/{name}.py", "CartPoleBalance", "--threads", "1", "--out", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    # a file or a pipe gets a line per evaluation, and no bar
    lines = re.findall(rf"^CartPoleBalance, (\d+) of (\d+) {unit}: return [\d.]+$", done.stdout, re.MULTILINE)
    assert len(lines) == 2 and lines[-1][0] == lines[-1][1] and "%|" not in done.stderr
    said = re.search(r"return ([\d.]+); ", done.stdout)
    # an untrained policy falls after some 40 steps of 500
    assert said and float(said.group(1)) > 400, done.stdout
    assert all((tmp_path / "CartPoleBalance-0" / file).stat().st_size > 10_000 for file in files)
