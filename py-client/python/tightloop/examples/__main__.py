"""``python -m tightloop.examples``: lists the examples, copies them, or runs one."""

from __future__ import annotations

import argparse
import sys
import textwrap
from collections.abc import Sequence
from pathlib import Path

from tightloop import examples
from tightloop.errors import ArgumentError


def main(arguments: Sequence[str]) -> int:
    """Run the command line; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m tightloop.examples",
        description="List, copy and run the examples; without a command, list them.",
    )
    commands = parser.add_subparsers(dest="command")
    commands.add_parser("list", help="print each program and what it does")
    copying = commands.add_parser("copy", help="copy a program with all that it needs into a folder")
    copying.add_argument("name", help="the program, or all")
    copying.add_argument("folder", nargs="?", type=Path, default=Path("examples"), help="default: examples")
    running = commands.add_parser("run", help="run a program, such as: run play --help", add_help=False)
    running.add_argument("name", help="the program")
    running.add_argument("arguments", nargs=argparse.REMAINDER, help="its arguments")
    given = parser.parse_args(arguments)
    try:
        if given.command == "run":
            examples.run(given.name, given.arguments)
        elif given.command == "copy":
            copied = examples.copy(given.name, given.folder)
            print(
                f"{given.folder}: {len(copied)} files; run `python {given.folder / copied[0].name}`"
                if len(copied) == 1
                else f"{given.folder}: {len(copied)} files"
            )
        else:
            _print()
    except ArgumentError as problem:
        parser.exit(2, f"error: {problem}\n")
    except OSError as problem:
        parser.exit(1, f"error: {problem}\n")
    return 0


def _print() -> None:
    for name, does in examples.programs().items():
        print(textwrap.fill(does, 110, initial_indent=f"{name:18} ", subsequent_indent=" " * 19))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
