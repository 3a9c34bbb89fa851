"""``examples/mpc.py``: both planners swing the pole up, and only an arm that plans evades the ball."""

from __future__ import annotations

import subprocess
import sys

import pytest

from conftest import REPOSITORY
from tiers import nightly


def run(*arguments: str) -> str:
    """Return the last line of a run of one seed."""
    command = [sys.executable, str(REPOSITORY / "examples/mpc.py"), *arguments, "--seeds", "1"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()[-1]


@pytest.mark.parametrize(
    ("problem", "planner", "succeed"),
    [
        ("cartpole", "sampling", 1),
        ("cartpole", "ilqr", 1),
        ("cartpole", "none", 0),
        ("arm", "none", 0),
        # `test_examples.py` runs the same program
        nightly("arm", "sampling", 1),
    ],
)
def test_a_planner_succeeds_and_no_planner_does_not(problem, planner, succeed):
    assert run(problem, "--planner", planner) == f"{succeed} of 1 seeds succeed"


def test_a_planner_without_residuals_is_refused():
    command = [sys.executable, str(REPOSITORY / "examples/mpc.py"), "arm", "--planner", "ilqr"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2 and "choose --planner sampling" in done.stderr
