"""Where measurements go: one CSV a bench and machine, headed by what it takes to understand it later."""

from __future__ import annotations

import csv
import os
import re
import subprocess
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

REPOSITORY = Path(__file__).parents[1]


def write_results(name: str, rows: Sequence[Mapping[str, str | int]], facts: Mapping[str, str | int]) -> Path:
    """Write the rows to benches/results/MACHINE/NAME.csv, below facts such as the command; returns the file."""
    machine = f"{processor()}, {os.cpu_count()} cores"
    path = REPOSITORY / "benches/results" / re.sub(r"[^a-z0-9]+", "-", machine.lower()).strip("-") / f"{name}.csv"
    path.parent.mkdir(parents=True, exist_ok=True)
    head = {"cpu": machine, "commit": commit(), "date": time.strftime("%Y-%m-%d")} | dict(facts)
    with path.open("w", newline="") as file:
        file.writelines(f"# {what}: {value}\n" for what, value in head.items())
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    print(f"\nresults: {path.relative_to(REPOSITORY)}\n")
    return path


def print_table(rows: Sequence[Mapping[str, str | int]]) -> None:
    """The rows for people, a column as wide as its widest entry."""
    widths = {name: max(len(str(row[name])) for row in [*rows, {name: name}]) for name in rows[0]}
    print("  ".join(f"{name:>{width}}" for name, width in widths.items()))
    for row in rows:
        print("  ".join(f"{value:>{widths[name]}}" for name, value in row.items()))


def print_slow(rows: Sequence[Mapping[str, str | int]], what: str) -> bool:
    """Tell which rows, by their column `what`, are slower than asked; whether any is."""
    slow = [row for row in rows if row["asked_ratio"] != "–" and float(row["median_ratio"]) < float(row["asked_ratio"])]
    for row in slow:
        print(f"{row[what]}: {row['median_ratio']} times MuJoCo, asked {row['asked_ratio']}")
    return bool(slow)


def processor() -> str:
    """Name of the processor, as Linux has it."""
    return re.findall(r"^model name\s*: (.*)$", Path("/proc/cpuinfo").read_text(), re.MULTILINE)[0]


def commit() -> str:
    """What is measured: the commit, with ``-dirty`` for changes since."""
    command = ["git", "describe", "--always", "--dirty", "--exclude=*"]
    return subprocess.run(command, cwd=REPOSITORY, stdout=subprocess.PIPE, check=True, text=True).stdout.strip()
