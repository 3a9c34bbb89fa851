"""How long Python takes to import tightloop, and from its start to the first step of 4096 arms.

    .venv/bin/python -m benches newcomer_start             # 15 processes of each

Every sample is a process of its own. The time of the first step begins before that process is started, so it holds the
start of Python, the imports of tightloop and NumPy, the robot file, the daemon's start, and one step. Exit code 1: the
median is slower than asked.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from pathlib import Path
from statistics import median

sys.path.insert(0, str(Path(__file__).parents[1]))
from record import print_table, write_results

ASKED = {"import": 0.05, "first step of 4096 arms": 0.3}  # [s]
# The clock of `time.perf_counter` is the machine's: both processes read the same one.
PROGRAM = """
import time
begun = time.perf_counter()
import tightloop as tl
imported = time.perf_counter() - begun
scene = tl.Scene(dt=1 / 480, substeps=8)
arm = scene.add_urdf(tl.assets.FR3, name="arm")
arm.joint_q = [0, 0, 0, -2.4, 0, 2.4, 0.8, 0.04, 0.04]
with tl.launch(scene, worlds=4096) as sim:
    assert sim.step().joint_q.shape == (4096, 9)
    stepped = time.perf_counter()
    print(imported, stepped)
"""


def start() -> dict[str, float]:
    """Seconds of the import, and from before the process to its first step."""
    begun = time.perf_counter()
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True)
    imported, stepped = map(float, done.stdout.split())
    return dict(zip(ASKED, (imported, stepped - begun), strict=True))


def main() -> None:
    """Measure, print, and keep the result."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--samples", type=int, default=15, help="processes to start (default: 15)")
    args = parser.parse_args()
    start()  # files come from the disk the first time
    load = os.getloadavg()[0]
    samples = [start() for _ in range(args.samples)]
    rows = []
    for what, asked in ASKED.items():
        times = sorted(sample[what] for sample in samples)
        row = {"what": what, "median_s": f"{median(times):.3f}", "least_s": f"{times[0]:.3f}"}
        rows.append(row | {"most_s": f"{times[-1]:.3f}", "asked_s": f"{asked:g}"})
    print_table(rows)
    command = f"python -m benches newcomer_start --samples {args.samples}"
    write_results("newcomer_start", rows, {"command": command, "load_before": f"{load:.1f} of {os.cpu_count()} cores"})
    if any(float(row["median_s"]) > float(row["asked_s"]) for row in rows):
        sys.exit(1)


if __name__ == "__main__":
    main()
