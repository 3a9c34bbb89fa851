"""The two tiers of tests: `make test` leaves nothing out as a whole, and both tell how long they take."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from conftest import REPOSITORY
from tiers import sweep

FOLDERS = ("py-client/tests", "tests/python")
# A whole demo, of which the daily tier has what comes before the first touch: `tests/reference.rs`
NIGHTLY = {Path("tests/python/mujoco/contacts/test_torque_demo.py")}


def recipe(target: str) -> str:
    """The commands of a target."""
    command = ["make", "--dry-run", "--no-print-directory", target]
    return subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=True).stdout


def selected(*arguments: str) -> list[str]:
    """The tests that pytest selects."""
    command = [sys.executable, "-m", "pytest", "-c", "py-client/pyproject.toml", "--rootdir", ".", *arguments]
    command += ["--collect-only", "-q", "-p", "no:cacheprovider", *FOLDERS]
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=True)
    return [line for line in done.stdout.splitlines() if "::" in line]


def test_each_file_of_tests_has_a_test_in_the_daily_tier():
    there = {path.relative_to(REPOSITORY) for folder in FOLDERS for path in (REPOSITORY / folder).rglob("test_*.py")}
    daily = {Path(line.split("::")[0]) for line in selected("-m", "not nightly")}
    assert len(there) > 150 and there - daily == NIGHTLY


def test_the_daily_tier_is_without_the_nightly_tests_and_the_lints_of_other_systems():
    both = [line for line in recipe("test-all").splitlines() if "announce" not in line and "duration" not in line]
    daily = recipe("test").splitlines()
    runs = [line for line in daily if "pytest" in line]
    assert len(runs) == 1 and runs[0].replace(' -m "not nightly"', " ") in both and runs[0] not in both
    assert [line for line in daily if "nextest" in line] == [line for line in both if "nextest" in line] != []
    assert not any("apple-darwin" in line for line in daily) and any("apple-darwin" in line for line in both)


def test_a_sweep_has_its_first_cases_in_both_tiers():
    first, second, third = sweep([(1, "a"), (2, "b"), (3, "c")], daily=1)
    assert first == (1, "a")
    assert [(param.values, [mark.name for mark in param.marks]) for param in (second, third)] == [
        ((2, "b"), ["nightly"]),
        ((3, "c"), ["nightly"]),
    ]
    assert sweep(range(2), daily=5) == [0, 1]
    with pytest.raises(AssertionError, match="marked as a whole"):
        sweep(range(2), daily=0)


def test_workflows_run_the_daily_tier_on_a_push_and_both_at_night_and_for_a_release():
    def targets(workflow: str) -> list[str]:
        text = (REPOSITORY / f".github/workflows/{workflow}.yml").read_text()
        (found,) = re.findall(r"target: \[(.+)\]", text)
        return found.split(", ")

    assert "test" in targets("fast") and "check-systems" not in targets("fast")
    assert "test-all" in targets("nightly") and "test" not in targets("nightly")
    assert "- run: make test-all\n" in (REPOSITORY / ".github/workflows/release.yml").read_text()


def test_a_target_says_at_its_start_how_long_it_takes(tmp_path: Path):
    (tmp_path / ".ci").mkdir()
    script = shutil.copy(REPOSITORY / ".ci/duration", tmp_path / ".ci")
    (tmp_path / "cores").mkdir()
    cores = tmp_path / "cores/nproc"
    environment = os.environ | {"PATH": f"{cores.parent}:{os.environ['PATH']}"}
    environment.pop("CARGO_TARGET_DIR", None)

    def said(*arguments: str, count: int = 2) -> str:
        cores.write_text(f"#!/bin/sh\necho {count}\n")
        cores.chmod(0o755)
        command = [script, *arguments]
        return subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout

    begin = ("begin", "test", "15", "9")
    compiling = "and up to 9 more to compile what the next run finds compiled"
    assert said(*begin) == f"make test takes up to 15 minutes here, on 2 cores, {compiling}\n"
    # another target has compiled what it needs, which is not all
    (tmp_path / "target/release/deps").mkdir(parents=True)
    assert compiling in said(*begin)
    # a run that compiles everything tells nothing about the next one
    assert said("end", "test") == ""
    assert said(*begin) == "make test takes up to 15 minutes here, on 2 cores\n"
    assert said(*begin, count=1) == "make test takes up to 30 minutes here, on 1 core\n"
    began = tmp_path / "out/duration/test.began"
    began.write_text(str(int(began.read_text()) - 601))
    assert said("end", "test") == ""
    assert said(*begin) == "make test takes about 11 minutes here, as the last time\n"
    # a run that failed is not kept, and one target says nothing about another
    began.unlink()
    assert said("end", "test") == "" and said(*begin) == "make test takes about 11 minutes here, as the last time\n"
    assert "up to 30 minutes" in said("begin", "test-all", "30", "9")
