"""A daemon at full speed for hours, with observers, recorders, resets, parameters, snapshots and kills.

    python -m benches soak --hours 1

Prints a line per sample: memory, descriptors and threads of both sides, files in shared memory, and how long a step
takes. Writes the samples into benches/results without ``--dry-run``. Ends with 1 when memory or descriptors grow: when
the last quarter of the samples has more than the second one.
"""

from __future__ import annotations

import argparse
import os
import random
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import tightloop as tl

sys.path.insert(0, str(Path(__file__).parents[1]))
from record import REPOSITORY, write_results

sys.path.insert(0, str(REPOSITORY / "examples"))
from franka_lesson import FRAMES, scene, targets

WORLDS = 64
SAMPLES, SAMPLE_SECONDS = 120, 2.5
# the daemon looks for dead clients every 0.1 s and for files without an owner every 0.5 s, twice; on busy cores later
SETTLE_SECONDS = 10.0
# growth that counts as none: allocators and caches breathe, and the daemon has two sockets to each of three guests
# until it next wakes one
SLACK = {"daemon_kib": 4096, "client_kib": 4096, "daemon_descriptors": 6}
OBSERVER = """
import sys, time, tightloop as tl
with tl.attach(sys.argv[1]) as sim:
    end = time.monotonic() + float(sys.argv[2])
    while time.monotonic() < end:
        sim.latest(0.1)
"""
GROWING = ("daemon_kib", "daemon_descriptors", "daemon_threads", "client_kib", "client_descriptors", "shared_files")


class Guests:
    """Observers and recorders that come and go, some of them by kill -9."""

    def __init__(self, sim: tl.Sim, folder: Path, draw: random.Random) -> None:
        self.sim, self.folder, self.draw = sim, folder, draw
        self.ends: dict[subprocess.Popen[bytes], float] = {}
        self.joined = self.killed = 0

    def tend(self) -> None:
        """Start a guest if there are fewer than three, and end those whose time has come."""
        now = time.monotonic()
        for process, end in list(self.ends.items()):
            if now > end and process.poll() is None:
                process.kill()
                self.killed += 1
            if process.poll() is not None:
                process.wait()
                del self.ends[process]
        if len(self.ends) < 3:
            self._invite(now)

    def _invite(self, now: float) -> None:
        seconds = self.draw.uniform(0.5, 4.0)
        if self.draw.random() < 0.5:
            arguments = ["-c", OBSERVER, self.sim.name, str(seconds)]
        else:
            out = str(self.folder / "soak.tlrec")
            arguments = ["-m", "tightloop", "record", self.sim.name, out, "--force", f"--seconds={seconds}"]
        process = subprocess.Popen([sys.executable, *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        # every other one is killed before it would end
        self.ends[process] = now + (seconds if self.draw.random() < 0.5 else 30.0)
        self.joined += 1

    def close(self) -> None:
        """End all that are left."""
        for process in self.ends:
            self.killed += process.poll() is None
            process.kill()
            process.wait()
        self.ends.clear()


def of_process(pid: int) -> tuple[int, int, int]:
    """Memory of a process without what it shares [KiB], its descriptors, and its threads."""
    status = dict(line.split(":", 1) for line in Path(f"/proc/{pid}/status").read_text().splitlines())
    anonymous = int(status["RssAnon"].split()[0])
    return anonymous, len(list(Path(f"/proc/{pid}/fd").iterdir())), int(status["Threads"])


def shared_files(sim: tl.Sim) -> int:
    """Files of the daemon in shared memory while no guest is there."""
    maps = Path(f"/proc/{sim.pid}/maps").read_text()
    stems = tuple(set(re.findall(r"/dev/shm/(tl[0-9a-f]{16})", maps)))
    folders = [path for path in Path("/dev/shm").iterdir() if path.name.startswith(stems)]
    return sum(len(names) for folder in folders for _, _, names in os.walk(folder))


def settle(sim: tl.Sim, files: int) -> None:
    """Step until the daemon has as few files as without guests, or for as long as it may take to clean up."""
    end = time.monotonic() + SETTLE_SECONDS
    while True:
        sim.step()
        time.sleep(0.1)
        if shared_files(sim) <= files or time.monotonic() > end:
            return


def work(sim: tl.Sim, guests: Guests, seconds: float, steps: Iterator[int]) -> list[float]:
    """Step for so long; return how long each step took [us]."""
    clock, took = time.perf_counter_ns, []
    end = time.monotonic() + seconds
    for step in steps:
        action = targets(step % FRAMES, np.ones(WORLDS))
        start = clock()
        sim.step(joint_target_q=action)
        took.append((clock() - start) / 1e3)
        if step % 500 == 0:
            sim.reset(mask=np.arange(WORLDS) % 2 == 0)
        if step % 1000 == 1:
            sim.params.gravity = (0.0, 0.0, guests.draw.uniform(-10.0, -9.0))
        if step % 2000 == 2:
            sim.restore(sim.snapshot())
        if step % 100 == 3:
            guests.tend()
        if time.monotonic() > end:
            break
    return took


def soak(seconds: float) -> list[dict[str, str]]:
    """Run, and return the samples."""
    rows: list[dict[str, str]] = []
    draw, steps, began = random.Random(1), iter(range(1, sys.maxsize)), time.monotonic()
    with (
        tempfile.TemporaryDirectory() as folder,
        tl.launch(scene(driven=True), worlds=WORLDS, params=("gravity",)) as sim,
    ):
        sim.step()
        files, guests = shared_files(sim), Guests(sim, Path(folder), draw)
        try:
            while time.monotonic() - began < seconds:
                took = work(sim, guests, max(seconds / SAMPLES, SAMPLE_SECONDS), steps)
                # what guests take is no growth
                guests.close()
                settle(sim, files)
                daemon, client = of_process(sim.pid), of_process(os.getpid())
                row = {
                    "seconds": f"{time.monotonic() - began:.0f}",
                    "steps": str(len(took)),
                    "p50_us": f"{np.percentile(took, 50):.1f}",
                    "p99_us": f"{np.percentile(took, 99):.1f}",
                    "daemon_kib": str(daemon[0]),
                    "daemon_descriptors": str(daemon[1]),
                    "daemon_threads": str(daemon[2]),
                    "client_kib": str(client[0]),
                    "client_descriptors": str(client[1]),
                    "shared_files": str(shared_files(sim)),
                    "guests": str(guests.joined),
                    "killed": str(guests.killed),
                }
                if not rows:
                    print(*row, sep="\t")
                print(*row.values(), sep="\t", flush=True)
                rows.append(row)
        finally:
            guests.close()
    return rows


def grown(rows: list[dict[str, str]]) -> list[str]:
    """What every sample of the last quarter has more of than any of the second one."""
    quarter = max(len(rows) // 4, 1)
    found = []
    for column in GROWING:
        early = max(int(row[column]) for row in rows[quarter : 2 * quarter])
        late = min(int(row[column]) for row in rows[-quarter:])
        if late > early + SLACK.get(column, 0):
            found.append(f"{column} grew from {early} to {late}")
    return found


def main() -> int:
    """Soak, and judge."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hours", type=float, default=1.0)
    parser.add_argument("--dry-run", action="store_true", help="write no results")
    options = parser.parse_args()
    rows = soak(3600.0 * options.hours)
    if not options.dry_run:
        command = f"python -m benches soak --hours {options.hours:g}"
        write_results("soak", rows, {"command": command, "worlds": WORLDS})
    problems = grown(rows)
    print("\n".join(problems) or "flat: memory, descriptors, threads, files")
    return int(bool(problems))


if __name__ == "__main__":
    sys.exit(main())
