"""Run a bench by the name of its file, or list the benches where none is named.

    python -m benches                         # their names, and what each measures
    python -m benches picture --rounds 5      # from the root of the repository; arguments go to the bench

A bench is a Python file one folder below this one whose docstring names this command. Other files are parts of benches.
"""

from __future__ import annotations

import ast
import difflib
import re
import runpy
import sys
from pathlib import Path

FOLDER = Path(__file__).resolve().parent


def benches() -> dict[str, tuple[Path, str]]:
    """Return the file of each bench and the first line of its docstring, by name, in the order of their paths."""
    found: dict[str, tuple[Path, str]] = {}
    for path in sorted(FOLDER.glob("*/*.py")):
        text = ast.get_docstring(ast.parse(path.read_text())) or ""
        if re.search(rf"-m benches {path.stem}\b", text):
            assert path.stem not in found, f"two benches are called {path.stem}"
            found[path.stem] = path, text.splitlines()[0]
    return found


def listing() -> str:
    """Return the names of all benches with what they measure, below the folder of each."""
    lines, folder = ["usage: python -m benches NAME [ARGUMENTS]"], ""
    for name, (path, line) in benches().items():
        if path.parent.name != folder:
            folder = path.parent.name
            lines += ["", f"{folder}:"]
        lines.append(f"  {name:<22}{line}")
    return "\n".join(lines)


def main(arguments: list[str]) -> None:
    """Run the bench that the first argument names.

    Raises:
        SystemExit: No bench has that name, or the bench ends.
    """
    if not arguments or arguments[0] in ("-h", "--help"):
        print(listing())
        return
    name, known = arguments[0], benches()
    if name not in known:
        near = difflib.get_close_matches(name, known, n=3)
        cure = f"nearest: {', '.join(near)}" if near else "`python -m benches` lists all"
        print(f"no bench is called `{name}`; {cure}", file=sys.stderr)
        raise SystemExit(2)
    path, _ = known[name]
    # as `python FILE` does, so that a bench finds the files beside it
    sys.path[0], sys.argv = str(path.parent), [str(path), *arguments[1:]]
    runpy.run_path(str(path), run_name="__main__")


if __name__ == "__main__":
    main(sys.argv[1:])
