"""Which robots `make published` tries, and the table at its end: a plugin, since options must be known early.

It is no conftest.py, which `make test` would load in place of the one above.
"""

from __future__ import annotations

import os

import pytest

ROWS = pytest.StashKey[dict[str, dict[str, str]]]()
COLUMNS = "dofs M bias qacc frames motion".split()


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("published robots")
    given = [path for path in os.environ.get("TIGHTLOOP_URDF", "").split(os.pathsep) if path]
    group.addoption("--urdf", action="append", default=given, metavar="FILE", help="try these robots instead")
    folders = [path for path in os.environ.get("TIGHTLOOP_PACKAGES", "").split(os.pathsep) if path]
    group.addoption("--package-dir", action="append", default=folders, metavar="FOLDER", help="holds their packages")


def pytest_configure(config: pytest.Config) -> None:
    config.stash[ROWS] = {}


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """How far each robot agreed, and for how many frames it was compared."""
    rows = config.stash[ROWS]
    if not rows:
        return
    width = max(map(len, rows))
    lines = [f"{'robot':{width}}  " + "  ".join(f"{name:>9}" for name in COLUMNS)]
    lines += [f"{name:{width}}  " + "  ".join(f"{row.get(c, '–'):>9}" for c in COLUMNS) for name, row in rows.items()]
    terminalreporter.section("published robots")
    terminalreporter.write_line("\n".join(lines))
