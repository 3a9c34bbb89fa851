"""The command line, `tightloop serve …`; also how `tightloop.launch` starts its daemon."""

from __future__ import annotations

import importlib
import os
import re
import signal
import sys
from pathlib import Path

# Commands that are carried out here; all others are Rust's.
_IN_PYTHON = {
    "demo": "tightloop.demo.command",
    "film": "tightloop.view.film_command",
    "view": "tightloop.view.command",
}
# The first element of a robot file begins within so many bytes.
_HEAD_BYTES = 1 << 16
_BEFORE_ELEMENTS = re.compile(r"\s+|<\?.*?\?>|<!--.*?-->|<!DOCTYPE[^>]*>", re.DOTALL)
_MJCF = re.compile(r"<mujoco[\s>/]")


def main() -> int:
    """Run the command line of this process; returns its exit code."""
    home = _IN_PYTHON.get(sys.argv[1]) if len(sys.argv) > 1 else None
    if home is not None:
        code = importlib.import_module(home).main(sys.argv[2:])
        if sys.argv[1] == "view":
            # It has let go of everything; to take the interpreter apart takes a busy machine seconds
            sys.stdout.flush()
            os._exit(code)
        return code
    from tightloop import _core

    arguments = sys.argv[1:]
    if arguments[:1] in (["serve"], ["bench"]):
        arguments = [_scene_file(argument) for argument in arguments]
    if arguments[:1] == ["inspect"]:
        arguments = _with_compiled(arguments)
    # Rust does the work and never returns to the interpreter in between: Python's own handler would only set a flag.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _core.command_line(["tightloop", *arguments])


def _scene_file(argument: str) -> str:
    """Return the scene file of an MJCF file; any other argument stays as it is."""
    if not argument.endswith(".xml") or not Path(argument).is_file():
        return argument
    from tightloop.mujoco import serve

    return serve.scene_file(argument)


def _with_compiled(arguments: list[str]) -> list[str]:
    """Return the arguments of ``inspect``; if they name an MJCF file, with the model that MuJoCo compiles from it."""
    for argument in arguments[1:]:
        if _is_mjcf(Path(argument)):
            from tightloop.mujoco import serve

            return [*arguments, "--exported", serve.exported_file(argument)]
    return arguments


def _is_mjcf(path: Path) -> bool:
    """Return whether this is a file whose first element is MJCF's."""
    try:
        if not path.is_file():
            return False
        with path.open("rb") as file:
            text = file.read(_HEAD_BYTES).decode("utf-8-sig", errors="replace")
    except (OSError, ValueError):  # an option's value that is too long for a path, or a file that Rust reports
        return False
    at = 0
    while skipped := _BEFORE_ELEMENTS.match(text, at):
        at = skipped.end()
    return _MJCF.match(text, at) is not None


if __name__ == "__main__":
    if not __package__:
        # `launch` runs this file by its path, with `-I -S`: no site packages, no surprises from the working directory.
        sys.path.append(str(Path(__file__).parents[1]))
    sys.exit(main())
