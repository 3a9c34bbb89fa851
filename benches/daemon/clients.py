"""Round trips of the clients in Rust, C and Python: one free body, one thread, as fast as the daemon answers.

    cargo build --release --workspace --lib --example rust_client
    python -m benches clients

The clients take turns at one daemon, with the examples of Rust and C as they are. Asked is a median below 1 us. The
bench also prints how busy the machine was with other work. It ends with 1 when Rust or C is slower than asked.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

import tightloop as tl

sys.path.insert(0, str(Path(__file__).parents[1]))
from record import REPOSITORY, print_table, write_results

RELEASE = Path(os.environ.get("CARGO_TARGET_DIR", REPOSITORY / "target")) / "release"
ROUNDS = 9
STEPS = 50_000
ASKED_US = {"Rust": 1.0, "C": 1.0, "Python": 2.5}


def program_in_c(source: Path, folder: Path) -> Path:
    """A client in C, compiled."""
    program = folder / source.stem
    command = ["cc", "-O2", str(source), "-o", str(program)]
    command += [f"-I{REPOSITORY}/sim-daemon/client-c/include", f"-L{RELEASE}", "-ltightloop_client"]
    subprocess.run([*command, f"-Wl,-rpath,{RELEASE}"], check=True)
    return program


def by_program(program: Path, name: str) -> tuple[float, float]:
    """Median and 99th percentile of an example's round trips [us]."""
    done = subprocess.run([program, name, str(STEPS), "0"], stdout=subprocess.PIPE, text=True, check=True)
    found = re.search(r"p50 ([\d.]+) us, p99 ([\d.]+) us", done.stdout)
    assert found is not None, done.stdout
    return float(found[1]), float(found[2])


def by_python(sim: tl.Sim) -> tuple[float, float]:
    """The same of `Sim.step`."""
    force, trips = np.zeros((1, 6), np.float32), np.empty(STEPS)
    sim.reset()
    for step in range(STEPS):
        start = time.perf_counter_ns()
        sim.step(joint_f=force)
        trips[step] = (time.perf_counter_ns() - start) / 1e3
    sim.release()
    return float(np.percentile(trips, 50)), float(np.percentile(trips, 99))


def others_busy() -> float:
    """Cores that other programs kept busy during a second in which nothing here ran."""

    def busy() -> int:
        user, nice, system, _, _, irq, soft, *_ = map(int, Path("/proc/stat").read_text().split("\n")[0].split()[1:])
        return user + nice + system + irq + soft

    before = busy()
    time.sleep(1.0)
    return (busy() - before) / os.sysconf("SC_CLK_TCK")


def main() -> int:
    """Measure in turns; 0 when Rust and C are as fast as asked."""
    scene = tl.Scene(dt=1e-3, substeps=1)
    scene.add_box(body=scene.add_body(pos=(0, 0, 1), name="box"), half_extents=(0.05, 0.05, 0.05))
    trips: dict[str, list[tuple[float, float]]] = {"Rust": [], "C": [], "Python": []}
    load: list[float] = []
    folder = Path(tempfile.mkdtemp())
    try:
        program = program_in_c(REPOSITORY / "examples/c_client/client.c", folder)
        with tl.launch(scene, worlds=1, threads=1) as sim:
            sim.release()
            for _ in range(ROUNDS):
                load.append(others_busy())
                trips["Rust"].append(by_program(RELEASE / "examples/rust_client", sim.name))
                trips["C"].append(by_program(program, sim.name))
                trips["Python"].append(by_python(sim))
    finally:
        shutil.rmtree(folder)
    rows: list[dict[str, str | int]] = []
    for client, rounds in trips.items():
        p50, p99 = np.median(rounds, axis=0)
        row: dict[str, Any] = {
            "client": client,
            "p50_us": f"{p50:.2f}",
            "p50_us_best": f"{min(rounds)[0]:.2f}",
            "p99_us": f"{p99:.2f}",
        }
        rows.append({**row, "asked_p50_us": f"{ASKED_US[client]:g}"})
    print_table(rows)
    busy = f"{np.median(load):.2f} of {os.cpu_count()} cores, at most {max(load):.2f}"
    print(f"busy with other programs: {busy}")
    facts = {"command": "python -m benches clients", "worlds": 1, "threads": 1, "steps": STEPS, "rounds": ROUNDS}
    write_results("clients", rows, facts | {"other_load": busy, "priority": f"nice {os.nice(0)}"})
    return int(any(float(row["p50_us"]) > ASKED_US[str(row["client"])] for row in rows))


if __name__ == "__main__":
    sys.exit(main())
