"""Tests of the mjlab adapter that run without mjlab; tests/mjlab has the others."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import PackageNotFoundError

import pytest

import tightloop as tl
from tightloop.adapters import mjlab
from tightloop.adapters.mjlab import patching


def test_without_mjlab_the_error_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> str:
        raise PackageNotFoundError(name)

    monkeypatch.setattr(patching, "version", missing)
    with pytest.raises(tl.MissingLibrary, match=r"mjlab is not installed: pip install 'mjlab==1\.6\.\*'"):
        mjlab.install()


@pytest.mark.parametrize("found", ["1.5.9", "1.7.0", "2.0"])
def test_another_version_is_refused(monkeypatch: pytest.MonkeyPatch, found: str) -> None:
    monkeypatch.setattr(patching, "version", lambda name: found)
    with pytest.raises(tl.ArgumentError, match=rf"mjlab is {found}, .* 1\.6 to below 1\.7: pip install"):
        mjlab.install()


@pytest.mark.parametrize(("words", "code"), [([], 2), (["fly"], 2), (["--help"], 0)])
def test_the_command_names_its_scripts(words: list[str], code: int) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "tightloop.mjlab", *words], capture_output=True, text=True, check=False
    )
    assert done.returncode == code
    assert "usage: python -m tightloop.mjlab {train,play,list-envs,viz-nan}" in done.stdout + done.stderr
    assert ("mjlab has no script `fly`" in done.stderr) == (words == ["fly"])


def test_the_adapter_imports_neither_mjlab_nor_torch() -> None:
    code = "import sys, tightloop.adapters.mjlab, tightloop.mjlab; print({'mjlab', 'torch', 'warp'} & set(sys.modules))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "set()\n"
