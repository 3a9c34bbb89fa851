"""The help texts of the command line."""

from __future__ import annotations

import subprocess
import sys


def commands() -> list[str]:
    """Names of the commands, in the order of the help."""
    _, _, rest = help_of().partition("Commands:\n")
    names = [line.split()[0] for line in rest.partition("\n\n")[0].splitlines()]
    return [name for name in names if name != "help"]


def help_of(*command: str) -> str:
    """The help of the program or of one of its commands."""
    line = [sys.executable, "-m", "tightloop", *command, "--help"]
    return subprocess.run(line, check=True, capture_output=True, text=True).stdout


def parts() -> dict[str, str]:
    """Parts of the page `reference/command-line.md`."""
    texts = ["```text\n" + help_of() + "```\n"]
    texts += [f"## tightloop {name}\n\n```text\n{help_of(name).rstrip()}\n```\n" for name in commands()]
    return {"commands": "\n".join(texts)}
