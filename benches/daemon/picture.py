"""Time that a picture takes: the arm at its table, alone and in many worlds.

    python -m benches picture

640 × 480 pixels without a display, on all cores: what `tightloop film` draws. Each picture has another pose. Beside it
the same picture of 16 × 16 pixels, which shows what poses and triangles cost, and the time of all threads together.
Writes benches/results/MACHINE/picture.csv, and ends with 1 where a median is above what was asked.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np

import tightloop as tl
from tightloop.view import Picture
from tightloop.view.parts import parts

sys.path.insert(0, str(Path(__file__).parents[1]))
from record import REPOSITORY, print_table, write_results

URDF = REPOSITORY / "examples/assets/fr3/fr3_franka_hand.urdf"
READY = np.array([0.0, -0.6, 0.0, -2.2, 0.0, 1.7, 0.8, 0.03, 0.03])
# Worlds, and the median that was asked for [ms]
ASKED = {1: 20.0, 16: None, 64: 300.0, 256: None}
POSES = 8


def main() -> int:
    """Measure, print and write the results; 0 where they are as fast as asked."""
    parser = argparse.ArgumentParser(description="Time of pictures.")
    parser.add_argument("--rounds", type=int, default=40, help="pictures that count (default 40)")
    rounds = parser.parse_args().rounds
    scene = tl.Scene(dt=1 / 480, substeps=8)
    scene.add_urdf(URDF, name="arm")
    scene.add_table()
    dynamics = tl.Dynamics(scene)
    look = parts(scene.to_toml(), "/", dynamics.body_names)
    faces = sum(len(part.mesh.faces) for part in look.of("visual"))
    rows: list[dict[str, str | int]] = []
    late = False
    for worlds, asked in ASKED.items():
        turns = 0.4 * np.sin(np.arange(POSES * worlds).reshape(POSES, worlds, 1) + np.arange(9))
        frames = [SimpleNamespace(body_q=dynamics.forward_kinematics(READY + turn * (READY != 0.03))) for turn in turns]
        times: dict[str, list[float]] = {"whole": [], "small": [], "threads": []}
        pictures = {"whole": Picture(look), "small": Picture(look, 16, 16)}
        # the first tenth warms caches and clocks
        for number in range(rounds + rounds // 10):
            for what, picture in pictures.items():
                begin, used = time.perf_counter(), time.process_time()
                picture.render(frames[number % POSES])
                if number >= rounds // 10:
                    times[what].append(1e3 * (time.perf_counter() - begin))
                    if what == "whole":
                        times["threads"].append(1e3 * (time.process_time() - used))
        median = float(np.median(times["whole"]))
        late |= asked is not None and median > asked
        rows.append(
            {
                "worlds": worlds,
                "triangles": faces * worlds,
                "median_ms": f"{median:.1f}",
                "p99_ms": f"{np.percentile(times['whole'], 99):.1f}",
                "small_median_ms": f"{np.median(times['small']):.1f}",
                "threads_median_ms": f"{np.median(times['threads']):.1f}",
                "asked_ms": "–" if asked is None else f"{asked:.0f}",
            }
        )
    print_table(rows)
    write_results("picture", rows, {"command": f"python -m benches picture --rounds {rounds}"})
    return int(late)


if __name__ == "__main__":
    sys.exit(main())
