"""Tables of what card.sh has measured, in short.

    python card_report.py RESULTS

It needs nothing but Python, since it runs where nothing can be installed.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Sequence
from pathlib import Path

Row = dict[str, str]


def read(path: Path) -> list[Row]:
    """Rows of a file without the lines of its head; none if there is no file. Of rows of one key the last counts."""
    if not path.exists():
        return []
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    columns = ("scene", "worlds", "side", "world_threads", "kernel_size", "dispatch_price")
    found = {}
    for row in csv.DictReader(lines):
        # a row of the GPU and one of the CPU are two
        side = row.get("steps_per_s", "") == "–"
        found[tuple(row.get(name, "") for name in columns), side] = row
    return list(found.values())


def facts(path: Path) -> Row:
    """The head of a file."""
    lines = path.read_text().splitlines() if path.exists() else []
    pairs = (line[2:].split(": ", 1) for line in lines if line.startswith("# ") and ": " in line)
    return dict(pairs)


def pieces(results: Path) -> dict[str, str]:
    """The last state of each piece."""
    lines = (results / "pieces.csv").read_text().splitlines()
    return {key: state for state, key, *_ in (line.split(",") for line in lines)}


def show(title: str, rows: list[Row], columns: Sequence[str]) -> None:
    """Prints a table."""
    if not rows:
        print(f"\n{title}: none")
        return
    print(f"\n{title}")
    widths = [max(len(row.get(name, "")) for row in [*rows, {name: name}]) for name in columns]
    for row in [dict(zip(columns, columns, strict=True)), *rows]:
        cells = zip((row.get(name, "") for name in columns), widths, strict=True)
        print("  ".join(f"{cell:>{width}}" for cell, width in cells))


def summary(results: Path) -> None:
    """Prints what there is, and names what is wrong and what is missing."""
    states = pieces(results)
    speed = read(results / "speed.csv")
    gpu = [row for row in speed if row["steps_per_s"] != "–"]
    cpu = {(row["scene"], row["worlds"]): row["cpu_steps_per_s"] for row in speed if row["steps_per_s"] == "–"}
    for row in gpu:
        row["cpu_steps_per_s"] = cpu.get((row["scene"], row["worlds"]), "–")
        if row["cpu_steps_per_s"] != "–":
            row["gpu_over_cpu"] = f"{float(row['steps_per_s']) / float(row['cpu_steps_per_s']):.2f}"
    columns = (
        "scene worlds kernels build_s steps_per_s steps_per_s_whole energy_uj frame_p50_ms cpu_steps_per_s gpu_over_cpu"
    )
    show("speed", gpu, columns.split())
    columns = "scene worlds world_threads kernel_size dispatch_price kernels dispatches build_s steps_per_s"
    show("threads per world, cuts of kernels", read(results / "splits.csv"), columns.split())
    reason = facts(results / "tensors.csv").get("not measured")
    if reason:
        print(f"\ntensors: not measured: {reason}")
    else:
        show("tensors, time of a frame", read(results / "tensors.csv"), ("worlds", "views_us", "tensors_us"))
    peers = read(results / "peers.csv")
    if peers:
        show("peers", peers, ("scene", "worlds", "side", "device", "steps_per_s", "energy_uj"))
    else:
        title = "peers: not measured here; published for other scenes and cards"
        show(title, read(results / "published.csv"), ("engine", "scene", "card", "worlds", "steps_per_s"))
    wrong = [key for key, state in states.items() if key.startswith("1/") and state != "done"]
    for key in wrong:
        print(f"\nchecks: {key[2:]} is {states[key]}; its rates are not those of right results")
    missing = [f"{key} ({state})" for key, state in states.items() if state != "done"]
    print(f"\npieces: {len(states) - len(missing)} done" + (f"; not: {', '.join(missing)}" if missing else ""))


def main() -> int:
    """Prints the tables of the folder that the command line names."""
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    summary(Path(sys.argv[1]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
