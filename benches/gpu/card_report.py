"""Tables of what card.sh has measured: beside the predictions, and all in short.

    python card_report.py predicted RESULTS
    python card_report.py summary RESULTS

It needs nothing but Python, since it runs where nothing can be installed.
"""

from __future__ import annotations

import csv
import os
import re
import sys
from collections.abc import Sequence
from pathlib import Path

HERE = Path(__file__).resolve().parent
PREDICTIONS = HERE.parent / "results/gpu_offline/predictions.csv"
# Patterns of adapters' names, and the architecture that their kernels are compiled for. The RTX 5000 is older.
ARCHITECTURES = {r"\bH[12]00\b": "sm_90", r"\bA100\b": "sm_80", r"\bRTX 50[5-9]0\b": "sm_120"}
UNPREDICTED = "no prediction for this card"
# A prediction that is off by more is named
FACTOR_MAX = 1.5
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


def architecture(adapter: str) -> str | None:
    """The architecture whose predictions are compared: of the environment or of the adapter; None of another card."""
    named = (arch for pattern, arch in ARCHITECTURES.items() if re.search(pattern, adapter))
    return os.environ.get("CARD_ARCH") or next(named, None)


def predictions(arch: str) -> dict[tuple[str, str], Row]:
    """The latest prediction of each scene and number of worlds."""
    with PREDICTIONS.open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["arch"] == arch]
    if not rows:
        raise SystemExit(f"CARD_ARCH={arch}: no predictions in {PREDICTIONS}; give sm_80, sm_90 or sm_120")
    return {(row["scene"], row["worlds"]): row for row in rows}


def pieces(results: Path) -> dict[str, str]:
    """The last state of each piece."""
    return {key: state for key, (state, _) in last(results).items()}


def last(results: Path) -> dict[str, tuple[str, str]]:
    """The last state of each piece and its date."""
    lines = (results / "pieces.csv").read_text().splitlines()
    return {key: (state, date[:10]) for state, key, _, date, *_ in (line.split(",") for line in lines)}


def beside(measured: str, one: Row | None) -> Row:
    """The columns of a prediction, beside a measured rate [steps/s]."""
    if one is None:
        names = ("prediction_commit", "predicted_steps_per_s", "measured_over_predicted", "beyond")
        return {"predicted_for": UNPREDICTED, **dict.fromkeys(names, "–")}
    predicted = 1e6 * float(one["steps_per_s_million"])
    factor = float(measured) / predicted
    return {
        "predicted_for": one["card"],
        "prediction_commit": one["commit"],
        "predicted_steps_per_s": f"{predicted:.0f}",
        "measured_over_predicted": f"{factor:.3g}",
        "beyond": "no" if 1 / FACTOR_MAX <= factor <= FACTOR_MAX else "yes",
    }


def predict(results: Path) -> list[Row]:
    """Measured rates of whole runs over predicted ones."""
    speed = results / "speed.csv"
    head = facts(speed)
    adapter = head.get("adapter", "unknown")
    arch = architecture(adapter)
    expected = predictions(arch) if arch else {}
    states = last(results)
    rows = []
    for row in read(speed):
        one = expected.get((row["scene"], row["worlds"]))
        if row["steps_per_s"] == "–" or (arch and one is None):
            continue
        _, date = states.get(f"2/{row['scene']}-{row['worlds']}", ("", head.get("date", "unknown")))
        checked, _ = states.get(f"1/{row['scene']}", ("", ""))
        rows.append(
            {
                "scene": row["scene"],
                "worlds": row["worlds"],
                "adapter": adapter,
                "commit": head.get("commit", "unknown"),
                "date": date,
                "measured_steps_per_s": row["steps_per_s_whole"],
                **beside(row["steps_per_s_whole"], one),
                "checked": "yes" if checked == "done" else "no",
            }
        )
    return rows


def write_predicted(results: Path) -> None:
    """Writes predicted.csv below the facts of the measured rates."""
    rows = predict(results)
    if not rows:
        print("nothing is measured that was predicted")
        return
    with (results / "predicted.csv").open("w", newline="") as file:
        file.writelines(f"# {name}: {value}\n" for name, value in facts(results / "speed.csv").items())
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    beside_one = [row for row in rows if row["predicted_for"] != UNPREDICTED]
    print(f"{len(beside_one)} rates beside predictions")
    if len(beside_one) < len(rows):
        print(f"{rows[0]['adapter']}: {UNPREDICTED}; CARD_ARCH compares it with that of another")


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
    """Prints what there is, and names what is wrong, what is missing, and which predictions are far off."""
    states = pieces(results)
    speed = read(results / "speed.csv")
    gpu = [row for row in speed if row["steps_per_s"] != "–"]
    cpu = {(row["scene"], row["worlds"]): row["cpu_steps_per_s"] for row in speed if row["steps_per_s"] == "–"}
    for row in gpu:
        row["cpu_steps_per_s"] = cpu.get((row["scene"], row["worlds"]), "–")
        if row["cpu_steps_per_s"] != "–":
            row["gpu_over_cpu"] = f"{float(row['steps_per_s']) / float(row['cpu_steps_per_s']):.2f}"
    columns = "scene worlds kernels build_s steps_per_s steps_per_s_whole frame_p50_ms cpu_steps_per_s gpu_over_cpu"
    show("speed", gpu, columns.split())
    columns = "scene worlds world_threads kernel_size dispatch_price kernels dispatches build_s steps_per_s"
    show("threads per world, cuts of kernels", read(results / "splits.csv"), columns.split())
    compared = [row for row in read(results / "predicted.csv") if row["predicted_for"] != UNPREDICTED]
    far = [row for row in compared if row["beyond"] == "yes"]
    columns = "scene worlds adapter predicted_for predicted_steps_per_s measured_steps_per_s measured_over_predicted"
    show(f"of {len(compared)} predictions, off by more than {FACTOR_MAX}", far, columns.split())
    reason = facts(results / "tensors.csv").get("not measured")
    if reason:
        print(f"\ntensors: not measured: {reason}")
    else:
        show("tensors, time of a frame", read(results / "tensors.csv"), ("worlds", "views_us", "tensors_us"))
    peers = read(results / "peers.csv")
    if peers:
        show("peers", peers, ("scene", "worlds", "side", "device", "steps_per_s"))
    else:
        title = "peers: not measured here; published for other scenes and cards"
        show(title, read(results / "published.csv"), ("engine", "scene", "card", "worlds", "steps_per_s"))
    wrong = [key for key, state in states.items() if key.startswith("1/") and state != "done"]
    for key in wrong:
        print(f"\nchecks: {key[2:]} is {states[key]}; its rates are not those of right results")
    missing = [f"{key} ({state})" for key, state in states.items() if state != "done"]
    print(f"\npieces: {len(states) - len(missing)} done" + (f"; not: {', '.join(missing)}" if missing else ""))


def main() -> int:
    """Does what the command line names."""
    actions = {"predicted": write_predicted, "summary": summary}
    if len(sys.argv) != 3 or sys.argv[1] not in actions:
        print(__doc__, file=sys.stderr)
        return 2
    actions[sys.argv[1]](Path(sys.argv[2]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
