"""The package as it is installed: what it exports, and what it does not import."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import tightloop as tl
from tightloop import _core, errors

PACKAGE = Path(tl.__file__).parent


def test_everything_exported_is_there():
    assert all(hasattr(tl, name) for name in tl.__all__)
    assert set(tl.__all__) == set(dir(tl))
    with pytest.raises(AttributeError, match="lunch"):
        _ = tl.lunch  # pyright: ignore[reportAttributeAccessIssue]


def test_every_exception_is_exported_and_a_tightloop_error_or_warning():
    classes = [
        value for value in vars(errors).values() if isinstance(value, type) and value.__module__ == errors.__name__
    ]
    assert {error.__name__ for error in classes} <= set(tl.__all__)
    assert all(issubclass(error, tl.TightloopError | tl.TightloopWarning) and error.__doc__ for error in classes)


def test_every_exception_that_rust_raises_exists():
    text = "".join(path.read_text() for path in (Path(__file__).parents[1] / "src").glob("*.rs"))
    endings = ("Error", "Lost", "Held", "Refused", "Closed", "Mismatch")
    named = {word for word in text.split('"') if word.isidentifier() and word.endswith(endings)}
    assert named and all(hasattr(errors, name) for name in named)


def test_the_daemon_starts_without_numpy():
    code = "import sys; import tightloop.__main__, tightloop._core; print('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "False\n"


def test_the_command_line_speaks():
    for command in ([sys.executable, "-m", "tightloop"], [str(Path(sys.executable).with_name("tightloop"))]):
        done = subprocess.run([*command, "serve", "--help"], capture_output=True, text=True, check=False)
        assert done.returncode == 0 and "--worlds" in done.stdout
        done = subprocess.run([*command, "serve"], capture_output=True, text=True, check=False)
        assert done.returncode == 2 and "SCENE" in done.stderr


def test_stubs_and_module_name_the_same_things():
    stubs = ast.parse((PACKAGE / "_core.pyi").read_text())
    named = {node.name for node in stubs.body if isinstance(node, ast.ClassDef | ast.FunctionDef)}
    assert named == {name for name in vars(_core) if not name.startswith("_")}


def test_the_package_is_typed():
    assert (PACKAGE / "py.typed").exists() and (PACKAGE / "_core.pyi").exists()
