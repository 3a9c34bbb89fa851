"""The built wheel is for every Python from 3.10 on, and whole; `make packages` tries it on all that there are."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from conftest import REPOSITORY

sys.path.insert(0, str(REPOSITORY / "tests/packaging"))
from pythons import smoke

SOURCES = REPOSITORY / "py-client/python/tightloop"


@pytest.fixture(scope="module")
def wheel() -> Path:
    found = sorted((REPOSITORY / ".venv/wheels").glob("*.whl"))
    assert len(found) == 1, "make wheel"
    return found[0]


def test_it_asks_for_no_more_than_the_stable_interface(wheel):
    assert wheel.name.startswith("tightloop_sim-") and "-cp310-abi3-" in wheel.name
    # exit code 1: a symbol that is not of the abi3 of Python 3.10
    done = subprocess.run(
        [sys.executable, "-m", "abi3audit", "--strict", "--verbose", str(wheel)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "1 extensions scanned" in " ".join((done.stdout + done.stderr).split())


def test_it_holds_what_the_package_holds(wheel):
    with zipfile.ZipFile(wheel) as archive:
        inside = {name for name in archive.namelist() if name.startswith("tightloop/")}
        entry = next(name for name in archive.namelist() if name.endswith("entry_points.txt"))
        assert "tightloop=tightloop.__main__:main" in archive.read(entry).decode().replace(" ", "")
    sources = {f"tightloop/{path.relative_to(SOURCES)}" for path in SOURCES.rglob("*") if path.is_file()}
    sources = {name for name in sources if "__pycache__" not in name and not name.endswith(".so")}
    # a link to the examples, of which the wheel has what programs need
    examples = {name for name in inside if name.startswith("tightloop/examples/files/")}
    assert {Path(name).suffix for name in examples} == {".py", ".onnx", ".csv", ".urdf", ".xml", ".safetensors"}
    assert inside - examples == sources | {"tightloop/_core.abi3.so"}
    size = wheel.stat().st_size
    print(f"{wheel.name}: {size / 1e6:.1f} MB")
    # PyPI takes 100 MB; debug information left in would be ten times of what it is
    assert size < 30e6


def test_it_works_from_a_folder_of_its_own(wheel, tmp_path):
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "install", "--quiet", "--no-deps", "--no-index"]
    subprocess.run([*pip, "--target", str(tmp_path), str(wheel)], check=True)
    environment = os.environ | {"PYTHONPATH": str(tmp_path)}
    assert smoke(Path(sys.executable), environment)["tightloop"]
    where = "import tightloop; print(tightloop.__file__)"
    done = subprocess.run([sys.executable, "-c", where], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.startswith(str(tmp_path))
