"""`.ci/needs` says in its first line what a machine lacks to build the project, before anything is downloaded."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from conftest import REPOSITORY

TOOLS = ("bash", "env", "sed", "dirname", "sort", "head", "grep", "printf")


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A checkout without an environment, and a PATH with nothing but basic tools and Python."""
    made = tmp_path / "checkout"
    shutil.copytree(REPOSITORY / ".ci", made / ".ci")
    shutil.copy(REPOSITORY / "rust-toolchain.toml", made)
    tools = tmp_path / "tools"
    tools.mkdir()
    for tool in TOOLS:
        found = shutil.which(tool)
        assert found is not None
        program(tools / tool, f'exec {found} "$@"')
    program(tools / "python3", f'exec {sys.executable} "$@"')
    return made


def program(path: Path, text: str) -> None:
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)


def said(checkout: Path, **environment: str) -> tuple[int, str]:
    tools = str(checkout.parent / "tools")
    kept = {name: value for name, value in os.environ.items() if "proxy" not in name.lower()}
    done = subprocess.run(
        [str(checkout / ".ci/needs"), "demo"],
        env=kept | {"PATH": tools} | environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert not done.stdout
    return done.returncode, done.stderr


def test_without_rust(checkout):
    code, text = said(checkout)
    assert code == 1 and text.startswith("make demo needs Rust 1.") and "rustup.rs" in text


def test_with_an_old_cargo_and_no_rustup(checkout):
    program(checkout.parent / "tools/cargo", "echo cargo 1.63.0")
    code, text = said(checkout)
    assert code == 1 and "and cargo is 1.63.0: install rustup" in text


def test_with_an_old_python(checkout):
    program(checkout.parent / "tools/python3", '[ "$1" = -V ] && echo Python 3.8.1; exit 1')
    code, text = said(checkout)
    assert code == 1 and text.startswith("make demo needs Python 3.10") and "Python 3.8.1" in text
    (checkout.parent / "tools/python3").unlink()
    code, text = said(checkout)
    assert code == 1 and "apt-get install python3" in text


def test_without_the_network(checkout):
    program(checkout.parent / "tools/cargo", "echo cargo 99.0.0")
    code, text = said(checkout, PIP_INDEX_URL="https://index.invalid/simple")
    assert code == 1 and text.startswith("make demo needs the network the first time") and "index.invalid" in text
    assert said(checkout, PIP_INDEX_URL="https://index.invalid/simple", HTTPS_PROXY="http://proxy") == (0, "")


def test_nothing_is_said_where_all_is_there(checkout):
    program(checkout.parent / "tools/cargo", "echo cargo 99.0.0")
    (checkout / ".venv").mkdir()
    (checkout / ".venv/.wheel").touch()
    assert said(checkout) == (0, "")
