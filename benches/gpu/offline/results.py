"""Keeps predictions: a row per commit, model, scene, worlds and architecture, and the kernels of the last commit."""

from __future__ import annotations

import csv
import subprocess
from pathlib import Path

from .constants import CARDS, MODEL
from .predict import Prediction
from .radv import Program

KEY = ("commit", "model", "scene", "worlds", "arch")
KERNELS_OF = 4096
"""Worlds of the runs whose kernels are kept one by one."""
Row = dict[str, str]


def commit(root: Path) -> str:
    """The last commit that changed the kernels, with `+` if they have changes that are not committed."""
    crates = (f"sim-core/{name}" for name in ("physics", "record", "stages", "model", "engine/src/backend/gpu"))
    places = [*crates, "benches/robots", "benches/gpu/scenes.rs"]

    def git(*arguments: str) -> str:
        done = subprocess.run(["git", *arguments, "--", *places], cwd=root, capture_output=True, text=True, check=True)
        return done.stdout.strip()

    return git("log", "-1", "--format=%h") + ("+" if git("status", "--porcelain") else "")


def summary(prediction: Prediction, of: str) -> Row:
    """The row of a run."""
    p = prediction
    compiled = [part.costs.compiled for part in p.parts.values()]
    found = {
        "commit": of,
        "model": MODEL,
        "scene": p.scene.name,
        "worlds": p.worlds,
        "arch": p.arch,
        "card": CARDS[p.arch].name,
        "steps_per_s_million": f"{p.rate / 1e6:.1f}",
        "frame_us": f"{p.seconds * 1e6:.0f}",
        "ends_us": f"{p.ends.seconds * 1e6:.0f}",
        "dispatches": p.dispatches,
        "kernels": len(p.parts),
        "largest_code_kb": f"{max(one.code for one in compiled) / 1024:.1f}",
        "largest_spill_bytes": max(one.spilled for one in compiled),
        "instructions_per_warp_step": f"{p.instructions:.0f}",
        "active_lanes": f"{p.lanes:.2f}",
        "bytes_loaded_per_world_step": f"{p.loaded:.0f}",
        "bytes_stored_per_world_step": f"{p.stored:.0f}",
        "lone_cycles_mean": f"{p.mean:.0f}",
        "lone_cycles_worst": f"{p.worst:.0f}",
    }
    return {name: str(value) for name, value in found.items()}


def kernels(prediction: Prediction, of: str) -> list[Row]:
    """The rows of a run's kernels."""
    p, found = prediction, []
    whole = sum(part.seconds for part in p.parts.values())
    for k, part in p.parts.items():
        compiled = part.costs.compiled
        row = {
            **dict(zip(KEY, (of, MODEL, p.scene.name, p.worlds, p.arch), strict=True)),
            "kernel": p.scene.file(k).removesuffix(".wgsl"),
            "dispatches": part.dispatches,
            "registers": compiled.registers,
            "stack_bytes": compiled.stack,
            "spill_bytes": compiled.spilled,
            "code_kb": f"{compiled.code / 1024:.1f}",
            "moved_percent": f"{100 * part.costs.unclear:.0f}",
            "share_percent": f"{100 * part.seconds / whole:.1f}",
            "bound": part.bound,
        }
        found.append({name: str(value) for name, value in row.items()})
    return found


def amd(found: list[Program], scene: str, family: str, of: str) -> list[Row]:
    """The rows of a scene's kernels for a card of AMD."""
    return [
        {
            "commit": of,
            "scene": scene,
            "family": family,
            "kernel": one.kernel,
            "wave": str(one.subgroup),
            "registers": str(one.registers),
            "spilled_registers": str(one.spilled),
            "spilled_scalars": str(one.spilled_scalars),
            "code_kb": f"{one.code / 1024:.1f}",
            "waves": str(one.waves),
            "cold_ms": f"{one.cold:.1f}",
            "cached_ms": f"{one.cached:.1f}",
        }
        for one in found
    ]


def read(path: Path) -> list[Row]:
    """The rows of a file, none if there is no file."""
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def write(path: Path, rows: list[Row]) -> None:
    """Writes a file anew."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def keep(predictions: list[Prediction], folder: Path, of: str) -> None:
    """Adds predictions to the files of a folder; earlier ones with the same key go."""
    rows = [summary(one, of) for one in predictions]
    merge(folder / "predictions.csv", rows, KEY)
    shown = [one for one in predictions if one.worlds == KERNELS_OF]
    merge(folder / "kernels.csv", [row for one in shown for row in kernels(one, of)], KEY, of)


def keep_amd(found: list[Program], scene: str, family: str, folder: Path, of: str) -> None:
    """Adds a scene's kernels for a card of AMD."""
    merge(folder / "amd.csv", amd(found, scene, family, of), ("commit", "scene", "family"), of)


def merge(path: Path, rows: list[Row], key: tuple[str, ...], of: str | None = None) -> None:
    """Adds rows to a file. Earlier ones with the same key go, and those of other commits than `of` if it is given."""
    new = {tuple(row[name] for name in key) for row in rows}
    old = [row for row in read(path) if tuple(row[name] for name in key) not in new]
    if kept := [row for row in old if of in (None, row["commit"])] + rows:
        write(path, kept)
