"""A short version of `make soak`: neither side grows while guests come, go and are killed."""

from __future__ import annotations

import subprocess
import sys

from conftest import REPOSITORY


def test_nothing_grows():
    process = subprocess.run(
        [sys.executable, "-m", "benches", "soak", "--hours=0.008", "--dry-run"],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert process.returncode == 0, process.stdout + process.stderr
    head, *samples = (line.split("\t") for line in process.stdout.splitlines() if "\t" in line)
    last = dict(zip(head, samples[-1], strict=True))
    assert int(last["guests"]) > 0 and int(last["killed"]) > 0, last
