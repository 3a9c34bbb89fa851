"""Every command that documents, workflows and hooks name exists: make targets, cargo targets, scripts, subcommands."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import named_commands
import pytest
from named_commands import documents, errors_of, makefile, sources

from conftest import REPOSITORY

# Targets that others need and nobody runs by hand.
INNER_TARGETS = {"browser", "llvm-cov", "vulkan"}


def test_commands_that_are_named_exist():
    found = {name: errors_of(name, text) for name, text in documents().items()}
    assert [error for _, errors in found.values() for error in errors] == []
    # each kind of text is read
    for name in ("README.md", "CONTRIBUTING.md", "Makefile", ".ci/run", ".pre-commit-config.yaml"):
        assert found[name][0] > 0, name
    assert sum(count for count, _ in found.values()) > 80


BAD = """
Run `make tests` or `make demo PLANETS=3`, then `TIGHTLOOP_NOTHING=1 make test`. Not a command: `make`, `Makefile`.

```sh title="needs a checkout"
cargo tset                            # cargo nothing
cd x && cargo nextest run --release --test nowhere
cargo test --release -p sim-nothing
cargo nextest run --release -p sim-picture no_test_has_this_name
cargo run --release --example nothing; target/release/examples/nothing 3
.venv/bin/python -m tightloop.nothing serve &
python -m pytest tests/python/test_nothing.py
python -m pytest tests/python/docs/test_commands.py::test_nothing -k nothing_of_that_name_either
python -m benches nothing --rounds 3
python examples/nothing.py --flag \\
  tests/nothing/
tightloop swerve scene.toml | tightloop serve scene.toml --wolds 3
```
"""
WRONG = [
    "no make target tests",
    "the Makefile reads no variable PLANETS",
    "nothing reads TIGHTLOOP_NOTHING",
    "no command cargo tset",
    "no --test nowhere of any crate asked for",
    "no crate sim-nothing",
    "no Rust test no_test_has_this_name",
    "no --example nothing of any crate asked for",
    "nothing builds target/release/examples/nothing",
    "no module tightloop.nothing",
    "no file tests/python/test_nothing.py",
    "no test test_nothing in tests/python/docs/test_commands.py",
    "no Python test nothing_of_that_name_either",
    "no bench nothing",
    "no file examples/nothing.py",
    "no file tests/nothing/",
    "no command tightloop swerve",
    "tightloop serve has no --wolds",
]
GOOD = """
`make demo WORLDS=256` and `make check test`, `cargo nextest run --release --test params velocities`, `tightloop list`,
`.venv/bin/python -m pytest tests/python/docs/test_commands.py::test_wrong_commands_are_found`,
`python -m benches round_trip`, `TIGHTLOOP_FUZZ=9 make test`.
"""
WORKFLOW = """
        target: [test, publish]
      - run: make all
"""


def test_wrong_commands_are_found(monkeypatch):
    # this file names them, and must not count as a reader of a variable
    own = {path: text for path, text in sources(".py").items() if path != Path(__file__)}
    monkeypatch.setattr(named_commands, "sources", lambda ending: own if ending == ".py" else sources(ending))
    _, errors = errors_of("BAD.md", BAD)
    assert sorted(errors) == sorted(f"BAD.md: {error}" for error in WRONG)
    assert errors_of("GOOD.md", GOOD) == (7, [])
    assert errors_of("w.yml", WORKFLOW)[1] == ["w.yml: no make target all", "w.yml: no make target publish"]


def run_benches(*words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "benches", *words]
    return subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=False)


def test_each_bench_that_the_makefile_runs_is_listed_with_what_it_measures():
    listed = dict(re.findall(r"^  (\w+) +(\S.+)$", run_benches().stdout, re.MULTILINE))
    named = set(re.findall(r"-m benches (\w+)", makefile()))
    assert len(named) > 10 and named <= set(listed)
    # each has a file of its own, and parts of benches are not listed
    assert all(len(list((REPOSITORY / "benches").glob(f"*/{name}.py"))) == 1 for name in listed)
    assert "ik" in listed and "ik_side" not in listed


def test_a_bench_gets_its_arguments_and_ends_as_by_its_path():
    by_path = [sys.executable, "benches/daemon/picture.py", "--rounds", "no"]
    alone = subprocess.run(by_path, cwd=REPOSITORY, capture_output=True, text=True, check=False)
    done = run_benches("picture", "--rounds", "no")
    assert (done.returncode, done.stderr) == (alone.returncode, alone.stderr)
    assert done.returncode == 2 and "invalid int value: 'no'" in done.stderr


def test_a_bench_that_does_not_exist_is_refused_with_the_nearest_names():
    refused = run_benches("round_trp")
    assert (refused.returncode, refused.stderr) == (2, "no bench is called `round_trp`; nearest: round_trip\n")
    assert run_benches("zzz").stderr == "no bench is called `zzz`; `python -m benches` lists all\n"


def test_links_between_files_of_the_root_lead_somewhere():
    for path in REPOSITORY.glob("*.md"):
        targets = re.findall(r"\]\(([\w./-]+)(?:#[\w-]*)?\)", path.read_text())
        assert [target for target in targets if not (REPOSITORY / target).exists()] == [], path


def test_make_help_lists_every_target():
    phony = re.search(r"^\.PHONY: (.+)", makefile().replace("\\\n", " "), re.MULTILINE)
    assert phony
    names = {name for name in phony.group(1).split() if re.fullmatch(r"[a-z0-9-]+", name)} - INNER_TARGETS
    done = subprocess.run(["make", "-s", "help"], cwd=REPOSITORY, capture_output=True, text=True, check=True)
    assert names == {line.split()[1] for line in done.stdout.splitlines()}


def test_an_announcement_names_what_is_missing_and_nothing_else():
    def announced(requirements: str, packages: str) -> str:
        command = [REPOSITORY / ".ci/announce", "test", requirements, packages]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout

    assert announced("", "") == ""
    assert announced("no-such-list", "").endswith("requirements-no-such-list.txt\n")
    assert "no-such-package" in announced("", "no-such-package") or not Path("/usr/bin/dpkg").exists()


def test_workflows_and_hooks_run_make_targets_only():
    yaml = pytest.importorskip("yaml", reason="PyYAML comes with the site's tools: make docs")
    for path in (REPOSITORY / ".github/workflows").glob("*.yml"):
        jobs = yaml.safe_load(path.read_text())["jobs"].values()
        lines = [step["run"] for job in jobs for step in job["steps"] if "run" in step]
        assert lines and all(line.startswith("make ") for line in lines), path
    hooks = yaml.safe_load((REPOSITORY / ".pre-commit-config.yaml").read_text())["repos"][0]["hooks"]
    assert all(hook["entry"].startswith("make ") for hook in hooks)


def test_the_citation_has_the_version_of_the_workspace():
    version = re.search(r'^version = "(.+)"', (REPOSITORY / "Cargo.toml").read_text(), re.MULTILINE)
    assert version and f"\nversion: {version.group(1)}\n" in (REPOSITORY / "CITATION.cff").read_text()
