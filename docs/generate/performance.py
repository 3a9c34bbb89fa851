"""The performance page and the README's table of speed, from the committed results of the benches.

    cd docs && python -m generate.performance     # rewrites the page and the table of README.md

Both files are committed, so that a forge shows them. ``tests/python/docs/test_docs.py`` holds them to the results.
"""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path

from generate.benches import BENCHES, Bench
from generate.rust import REPOSITORY
from generate.summary import INTRODUCTION, SUMMARY
from generate.tables import table

RESULTS = REPOSITORY / "benches/results"
PAGE = REPOSITORY / "docs/pages/reference/performance.md"
README = REPOSITORY / "README.md"
_MARKED = re.compile(r"(?<=<!-- speed: docs/generate/performance\.py -->\n\n).*?(?=\n<!-- end -->)", re.DOTALL)


@dataclass
class Result:
    """A file of ``benches/results``.

    Attributes:
        path: The file.
        facts: What its head says, in order: machine, commit, date, command and others.
        rows: Its rows by column.
    """

    path: Path
    facts: dict[str, str] = field(default_factory=dict)
    rows: list[dict[str, str]] = field(default_factory=list)


def read(path: Path) -> Result:
    """Read a file of results; facts of one name are joined."""
    lines = path.read_text().splitlines()
    made = Result(path)
    for line in lines:
        name, separator, value = line.removeprefix("# ").partition(": ")
        if line.startswith("#") and separator:
            made.facts[name] = f"{made.facts[name]}; {value}" if name in made.facts else value
    made.rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    return made


def page(*, every: bool = False) -> str:
    """The page: the newest table of each topic, or with ``every`` those of all machines, as the site has them."""
    parts = [INTRODUCTION, summary()]
    for stem, paths in groupby(measured(), key=lambda path: path.stem):
        bench = BENCHES.get(stem, Bench(stem.replace("_", " ").capitalize(), ""))
        results = [read(path) for path in paths]
        parts.append(f"## {bench.title}\n\n{bench.text}")
        parts += [section(result, bench) for result in results] if every else [newest(results, bench)]
    return "\n".join(parts)


def measured() -> list[Path]:
    """The files of results in the order of the page."""
    return sorted(RESULTS.glob("*/*.csv"), key=_order)


def newest(results: list[Result], bench: Bench) -> str:
    """The newest of a topic's results: its rows, where they come from, and the files of other machines."""
    last = max(results, key=lambda result: result.facts.get("date", ""))
    others = ", ".join(f"{_link(result)} ({_machine(result)})" for result in results if result is not last)
    return _with_source(last, bench) + (f"\nOther machines: {others}.\n" if others else "")


def section(result: Result, bench: Bench) -> str:
    """A file: its rows, then where they come from."""
    return f"### {bench.title.partition(',')[0]}: {_machine(result)}\n\n{_with_source(result, bench)}"


def _with_source(result: Result, bench: Bench) -> str:
    facts = dict(result.facts)
    machine = facts.pop("cpu", result.path.parent.name)
    known = {"machine": machine, "results": _link(result), "commit": facts.pop("commit", "unknown")}
    known["command"] = f"`{_command_today(facts.pop('command', 'unknown'))}`"
    source = table(["source", ""], [[name, value] for name, value in (known | facts).items()])
    return f"{_rows(result, bench)}\n{source}"


def _rows(result: Result, bench: Bench) -> str:
    columns = bench.columns or {name: name.replace("_", " ") for name in result.rows[0]}
    rows = [[_readable(bench.words.get(row[name], row[name])) for name in columns] for row in result.rows]
    return table(list(columns.values()), rows)


def _machine(result: Result) -> str:
    """The GPU, or the processor with its cores."""
    return result.facts.get("adapter", result.facts.get("cpu", result.path.parent.name))


def _link(result: Result) -> str:
    return f"[`{result.path.name}`](../../../{result.path.relative_to(REPOSITORY)})"


def _command_today(recorded: str) -> str:
    """Return a command that still works: files of results hold those of their commit, when benches lay elsewhere."""
    renamed = recorded.replace("benches/gpu/peers.py", "benches/gpu/gpu_peers.py")
    return re.sub(r"(?:python3? )?benches/(?:gpu/)?(\w+)\.py", r"python -m benches \1", renamed)


def summary() -> str:
    """The table that the README shows, too."""
    return table(
        ["workload", "compared with", "its steps/s", "tightloop, steps/s", "ratio"],
        [
            [
                line.workload,
                line.peer,
                _readable(theirs[line.theirs]),
                _readable(ours[line.ours]),
                f"**{ratio(line.file, line.ratio):.0f}×**",
            ]
            for line in SUMMARY
            for theirs, ours in [(_row(line.file, line.their_row), _row(line.file, line.our_row))]
        ],
    )


def ratio(file: str, where: dict[str, str]) -> float:
    """A ratio of the summary: the one number of that row whose column says what."""
    chosen = dict(where)
    column = chosen.pop("column")
    return float(_row(file, chosen)[column])


def _row(file: str, chosen: dict[str, str]) -> dict[str, str]:
    rows = [row for row in read(RESULTS / file).rows if chosen.items() <= row.items()]
    if len(rows) != 1:
        raise LookupError(f"benches/results/{file} has {len(rows)} rows with {chosen}; give what names one")
    return rows[0]


def _order(path: Path) -> tuple[int, str, str]:
    names = list(BENCHES)
    place = names.index(path.stem) if path.stem in names else len(names)
    return place, path.stem, path.parent.name


def _readable(cell: str) -> str:
    """Whole numbers in groups of three; anything else as it stands."""
    return f"{int(cell):,}" if cell.isdigit() and len(cell) > 4 else cell


def readme() -> str:
    """The README with the newest table."""
    text, count = _MARKED.subn(lambda _: summary(), README.read_text())
    if count != 1:
        raise LookupError("README.md has no place for the table: put it between `<!-- speed: … -->` and `<!-- end -->`")
    return text


if __name__ == "__main__":
    PAGE.write_text(page())
    README.write_text(readme())
