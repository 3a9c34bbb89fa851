"""What it costs to record 4096 worlds, and whether anything is lost.

    python benches/recording.py

The target demo of the lesson, each world with targets of its own, through `tightloop.launch`. First 60 frames a second,
in turns with and without `tightloop record`: the difference of the median times of a step is what recording costs. Then
as fast as it goes, in 4096 and in 64 worlds: frames that were lost are counted from what the recorder says. The last
recording of each kind is replayed, unless it has a gap. Writes benches/results/MACHINE/recording.csv, and ends with 1
when recording costs more than the 3 % asked or a replay is not equal.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from record import REPOSITORY, print_table, write_results
from tqdm import tqdm

import tightloop as tl

sys.path[:0] = [str(REPOSITORY / "examples")]
from franka_lesson import FRAMES, scene, targets  # noqa: E402  (the examples are no package)

COMMAND = [sys.executable, "-m", "tightloop"]
RATE_HZ = 60.0
ASKED_PERCENT = 3.0


class Recorder:
    """`tightloop record` at work on a daemon."""

    def __init__(self, sim: tl.Sim, out: Path) -> None:
        self.command = [*COMMAND, "record", sim.name, str(out), "--force"]
        self.process = subprocess.Popen(self.command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert self.process.stderr is not None
        said = self.process.stderr.readline()
        if "recording" not in said:
            raise RuntimeError(said)

    def stop(self) -> tuple[int, int, float]:
        """Frames in the file, entries lost, and megabytes of the file."""
        time.sleep(0.3)  # so that what waits in shared memory is read
        self.process.terminate()
        said, news = self.process.communicate()
        if self.process.returncode:
            raise RuntimeError(news)
        found = re.search(r": (\d+) frames, ([\d.]+) MB, (?:no gaps|\d+ gaps? of (\d+))", said)
        if not found:
            raise RuntimeError(said)
        return int(found[1]), int(found[3] or 0), float(found[2])


def step(sim: tl.Sim, commands: list[NDArray[np.float32]], frames: int, *, rate_hz: float | None) -> list[float]:
    """Seconds of each step."""
    times = []
    for frame in range(frames):
        begin = time.perf_counter()
        sim.step(joint_target_q=commands[frame % FRAMES])
        end = time.perf_counter()
        times.append(end - begin)
        if rate_hz:
            time.sleep(max(0.0, begin + 1 / rate_hz - end))
    return times


def replay(out: Path) -> bool:
    """Whether the recording is equal when it is run again."""
    done = subprocess.run([*COMMAND, "replay", str(out)], capture_output=True, text=True, check=False)
    print((done.stdout or done.stderr).strip().replace(str(out), out.name))
    return done.returncode == 0


def measure(worlds: int, *, rounds: int, frames: int, rate_hz: float | None) -> tuple[dict[str, str | int], bool]:
    """One kind of run, for people and files, and whether its last recording replays."""
    rng = np.random.default_rng(1)
    amplitudes = rng.uniform(0.5, 1.5, worlds)
    commands = [targets(frame, amplitudes) for frame in range(FRAMES)]
    without: list[float] = []
    recorded: list[float] = []
    kept = lost = missing = 0
    megabytes = 0.0
    what = "as fast as it goes" if rate_hz is None else f"{rate_hz:.0f} frames/s"
    with tempfile.TemporaryDirectory() as folder, tl.launch(scene(driven=True), worlds=worlds) as sim:
        out = Path(folder) / "run.tlrec"
        step(sim, commands, FRAMES, rate_hz=None)  # warms caches and clocks
        for _ in tqdm(range(rounds), desc=f"{worlds} worlds, {what}", disable=None):
            without += step(sim, commands, frames, rate_hz=rate_hz)
            recorder = Recorder(sim, out)
            recorded += step(sim, commands, frames, rate_hz=rate_hz)
            in_file, missing, size = recorder.stop()
            kept, lost, megabytes = kept + in_file, lost + missing, megabytes + size
        # what is lost shows as a gap, at which a replay stops: there is nothing to compare behind it
        equal = bool(missing) or replay(out)
    plain, beside = 1e3 * np.median(without), 1e3 * np.median(recorded)
    row: dict[str, str | int] = {
        "what": what,
        "worlds": worlds,
        "median_ms": f"{plain:.3f}",
        "recorded_ms": f"{beside:.3f}",
        "cost_percent": f"{100 * (beside / plain - 1):.1f}",
        "asked_percent": f"{ASKED_PERCENT:.0f}" if rate_hz else "–",
        "frames": kept + lost,
        "lost": lost,
        "kB_a_frame": f"{1e3 * megabytes / max(kept, 1):.0f}",
    }
    return row, equal


def main() -> int:
    """Measure, print and write the results; 0 when recording is as cheap as asked and replays are equal."""
    parser = argparse.ArgumentParser(description="Cost of recording.")
    parser.add_argument("--rounds", type=int, default=10, help="turns with and without a recorder (default 10)")
    rounds = parser.parse_args().rounds
    kinds = [(4096, 120, RATE_HZ), (4096, 500, None), (64, 10_000, None)]
    rows, equal = [], True
    for worlds, frames, rate_hz in kinds:
        row, is_equal = measure(worlds, rounds=rounds, frames=frames, rate_hz=rate_hz)
        rows.append(row)
        equal &= is_equal
    print_table(rows)
    write_results("recording", rows, {"command": f"python benches/recording.py --rounds {rounds}"})
    costs = float(rows[0]["cost_percent"])
    if costs > ASKED_PERCENT:
        print(f"recording at {RATE_HZ:.0f} frames/s costs {costs} %, asked {ASKED_PERCENT:.0f}")
    return int(costs > ASKED_PERCENT or not equal)


if __name__ == "__main__":
    sys.exit(main())
