"""The command line, `tightloop serve …`; also how `tightloop.launch` starts its daemon."""

from __future__ import annotations

import signal
import sys
from pathlib import Path


def main() -> int:
    """Run the command line of this process; returns its exit code."""
    if sys.argv[1:2] == ["view"]:
        from tightloop.view.command import main as view

        return view(sys.argv[2:])
    from tightloop import _core

    # Rust does the work and never returns to the interpreter in between: Python's own handler would only set a flag.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _core.command_line(["tightloop", *sys.argv[1:]])


if __name__ == "__main__":
    if not __package__:
        # `launch` runs this file by its path, with `-I -S`: no site packages, no surprises from the working directory.
        sys.path.append(str(Path(__file__).parents[1]))
    sys.exit(main())
