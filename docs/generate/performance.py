"""Results of the benches, as they are committed."""

from __future__ import annotations

import csv
from pathlib import Path

from generate.rust import REPOSITORY
from generate.tables import table

RESULTS = REPOSITORY / "benches/results"

INTRODUCTION = """# Performance

Every table is a file of `benches/results`, written by the command above it on the machine that its heading names, and
made into this page when the site is built. `–` is what was not measured or has no number to reach; `asked` columns
are what the project wanted to reach, whether it did or not. Steps are physics steps of all worlds together.

Read with care: MuJoCo computes in double precision, world after world; tightloop in single precision, 16 worlds in a
register. `make bench`, `make bench-env` and `make bench-gpu` measure your machine.
"""
# What the files measure, in the order of the page; others follow by their names.
TITLES = {
    "peers": "An arm without contacts, beside MuJoCo C on one thread",
    "contacts": "An arm with contacts, beside MuJoCo C on one thread",
    "legged": "Floating robots, beside MuJoCo C on one thread",
    "round_trip": "One world: how long a control frame takes",
    "env": "Environments, beside envpool and gymnasium's",
    "groups": "Two groups of worlds and a policy in NumPy",
    "tasks": "Observations and rewards of tasks",
    "libraries": "Training with libraries of reinforcement learning",
    "gpu": "Worlds on a GPU",
    "viewer": "With a viewer attached",
    "newcomer": "From a clean checkout to the first picture",
    "snapshot": "Snapshots",
    "recording": "With a recorder",
}


def page() -> str:
    """The page."""
    files = sorted(RESULTS.glob("*/*.csv"), key=_order)
    parts, last = [INTRODUCTION], ""
    for path in files:
        if path.stem != last:
            parts.append(f"## {TITLES.get(path.stem, path.stem.replace('_', ' ').capitalize())}\n")
            last = path.stem
        parts.append(section(path))
    return "\n".join(parts)


def _order(path: Path) -> tuple[int, str, str]:
    titles = list(TITLES)
    place = titles.index(path.stem) if path.stem in titles else len(titles)
    return place, path.stem, path.parent.name


def section(path: Path) -> str:
    """A file: its machine, what it says of itself, its rows."""
    text = path.read_text().splitlines()
    facts = [line.removeprefix("# ") for line in text if line.startswith("#")]
    rows = list(csv.reader(line for line in text if not line.startswith("#")))
    said = dict(fact.split(": ", 1) for fact in facts if ": " in fact)
    machine = said.pop("cpu", path.parent.name)
    others = "; ".join(f"{what}: {value}" for what, value in said.items() if what != "command")
    return f"### {machine}: {path.name}\n\n`{said.get('command', 'command unknown')}`  \n{others}\n\n" + table(
        [name.replace("_", " ") for name in rows[0]], [[_readable(cell) for cell in row] for row in rows[1:]]
    )


def _readable(cell: str) -> str:
    """Whole numbers in groups of three; anything else as it stands."""
    return f"{int(cell):,}" if cell.isdigit() and len(cell) > 4 else cell
