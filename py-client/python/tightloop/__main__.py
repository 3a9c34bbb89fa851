"""The command line, `tightloop serve …`; also how `tightloop.launch` starts its daemon."""

from __future__ import annotations

import importlib
import os
import signal
import sys
from pathlib import Path

# Commands that are carried out here; all others are Rust's.
_IN_PYTHON = {
    "demo": "tightloop.demo.command",
    "export": "tightloop.datasets.command",
    "film": "tightloop.view.film_command",
    "view": "tightloop.view.command",
}


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
    if arguments[:1] in (["serve"], ["bench"], ["compile"]):
        from tightloop.files import scenes as scene_files

        arguments = [scene_files.scene_file(argument) for argument in arguments]
    if arguments[:1] == ["inspect"]:
        arguments = _with_compiled(arguments)
    # Rust does the work and never returns to the interpreter in between: Python's own handler would only set a flag.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _core.command_line(["tightloop", *arguments])


def _with_compiled(arguments: list[str]) -> list[str]:
    """Return the arguments of ``inspect``; if they name an MJCF file, with the model that MuJoCo compiles from it."""
    from tightloop.files import scenes as scene_files

    for argument in arguments[1:]:
        if scene_files.kind_of(Path(argument)) == "mujoco":
            return [*arguments, "--exported", scene_files.exported_file(argument)]
    return arguments


if __name__ == "__main__":
    if not __package__:
        # `launch` runs this file by its path, with `-I -S`: no site packages, no surprises from the working directory.
        sys.path.append(str(Path(__file__).parents[1]))
    sys.exit(main())
