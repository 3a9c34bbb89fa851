"""The command line, in its own words."""

from __future__ import annotations

import subprocess
import sys

INTRODUCTION = """# Command line

What `tightloop --help` and `tightloop COMMAND --help` say. `tightloop completions bash` (or `zsh`, `fish`) prints
what a shell needs to complete them, `tightloop man FOLDER` writes manual pages;
[installing](install.md#shell-completions-and-manual-pages) says where they go. Exit codes: 0 done, 1 failed, 2
misused.
"""


def commands() -> list[str]:
    """Names of the commands, in the order of the help."""
    _, _, rest = help_of().partition("Commands:\n")
    names = [line.split()[0] for line in rest.partition("\n\n")[0].splitlines()]
    return [name for name in names if name != "help"]


def help_of(*command: str) -> str:
    """The help of the program or of one of its commands."""
    line = [sys.executable, "-m", "tightloop", *command, "--help"]
    return subprocess.run(line, check=True, capture_output=True, text=True).stdout


def page() -> str:
    """The page."""
    parts = [INTRODUCTION, "```text\n" + help_of() + "```\n"]
    parts += [f"## tightloop {name}\n\n```text\n{help_of(name).rstrip()}\n```\n" for name in commands()]
    return "\n".join(parts)
