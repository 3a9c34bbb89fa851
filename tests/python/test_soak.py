"""A short version of `make soak`: neither side grows while guests come, go and are killed."""

from __future__ import annotations

import subprocess
import sys

from conftest import REPOSITORY


def test_nothing_grows():
    process = subprocess.run(
        [sys.executable, "benches/soak.py", "--hours=0.008", "--dry-run"],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        check=False,
    )
    assert process.returncode == 0, process.stdout + process.stderr
    assert "killed" in process.stdout.splitlines()[0]
