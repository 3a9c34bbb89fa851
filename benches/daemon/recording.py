"""What it costs to record 4096 worlds, and whether anything is lost.

    python -m benches recording

The target demo of the lesson, each world with targets of its own, through `tightloop.launch`. First 60 frames a second,
in turns with and without `tightloop record`: what the daemon's process takes more of the processor for a frame, as
Linux counts it, is what recording costs the simulation; other programs do not count there. Beside it the time of a step
as the caller sees it, to which they do, and what the recorder takes for a frame. Then as fast as it goes, in 4096 and
in 64 worlds: frames that were lost are counted from what the recorder says. The last recording of each kind is
replayed, unless it has a gap. Writes benches/results/MACHINE/recording.csv with the load of the machine, and ends with
1 when recording costs more than the 3 % asked or a replay is not equal.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

import tightloop as tl

sys.path.insert(0, str(Path(__file__).parents[1]))
from record import REPOSITORY, print_table, write_results

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


def processor_ms(pid: int) -> float:
    """Time that all threads of a process have had on a processor [ms]."""
    threads = Path(f"/proc/{pid}/task").iterdir()
    return sum(int((thread / "schedstat").read_text().split()[0]) for thread in threads) / 1e6


class Times:
    """What frames took with or without a recorder: of the caller, of the daemon's processor, of the recorder's."""

    def __init__(self) -> None:
        self.step_ms: list[float] = []
        self.daemon_ms: list[float] = []
        self.recorder_ms: list[float] = []

    def measure(
        self,
        sim: tl.Sim,
        commands: list[NDArray[np.float32]],
        frames: int,
        *,
        rate_hz: float | None,
        recorder: Recorder | None = None,
    ) -> None:
        """One turn."""
        pids = [sim.pid] + ([recorder.process.pid] if recorder else [])
        before = [processor_ms(pid) for pid in pids]
        for frame in range(frames):
            begin = time.perf_counter()
            sim.step(joint_target_q=commands[frame % FRAMES])
            end = time.perf_counter()
            self.step_ms.append(1e3 * (end - begin))
            if rate_hz:
                time.sleep(max(0.0, begin + 1 / rate_hz - end))
        taken = [(processor_ms(pid) - start) / frames for pid, start in zip(pids, before, strict=True)]
        self.daemon_ms.append(taken[0])
        self.recorder_ms += taken[1:]


def replay(out: Path) -> bool:
    """Whether the recording is equal when it is run again."""
    done = subprocess.run([*COMMAND, "replay", str(out)], capture_output=True, text=True, check=False)
    print((done.stdout or done.stderr).strip().replace(str(out), out.name))
    return done.returncode == 0


def measure(worlds: int, *, rounds: int, frames: int, rate_hz: float | None) -> tuple[dict[str, str | int], bool]:
    """One kind of run, for people and files, and whether its last recording replays."""
    amplitudes = np.random.default_rng(1).uniform(0.5, 1.5, worlds)
    commands = [targets(frame, amplitudes) for frame in range(FRAMES)]
    plain, recorded = Times(), Times()
    kept = lost = missing = 0
    megabytes = 0.0
    what = "as fast as it goes" if rate_hz is None else f"{rate_hz:.0f} frames/s"
    with tempfile.TemporaryDirectory() as folder, tl.launch(scene(driven=True), worlds=worlds) as sim:
        out = Path(folder) / "run.tlrec"
        Times().measure(sim, commands, FRAMES, rate_hz=None)  # warms caches and clocks
        for _ in tqdm(range(rounds), desc=f"{worlds} worlds, {what}", disable=None):
            plain.measure(sim, commands, frames, rate_hz=rate_hz)
            recorder = Recorder(sim, out)
            recorded.measure(sim, commands, frames, rate_hz=rate_hz, recorder=recorder)
            in_file, missing, size = recorder.stop()
            kept, lost, megabytes = kept + in_file, lost + missing, megabytes + size
        # what is lost shows as a gap, at which a replay stops: there is nothing to compare behind it
        equal = bool(missing) or replay(out)
    cost = np.median(np.array(recorded.daemon_ms) / plain.daemon_ms)
    row: dict[str, str | int] = {
        "what": what,
        "worlds": worlds,
        "daemon_cpu_ms": f"{np.median(plain.daemon_ms):.3f}",
        "recorded_cpu_ms": f"{np.median(recorded.daemon_ms):.3f}",
        "cost_percent": f"{100 * (cost - 1):.1f}",
        "asked_percent": f"{ASKED_PERCENT:.0f}" if rate_hz else "–",
        "recorder_cpu_ms": f"{np.median(recorded.recorder_ms):.3f}",
        "step_ms": f"{np.median(plain.step_ms):.3f}",
        "recorded_step_ms": f"{np.median(recorded.step_ms):.3f}",
        "frames": kept + lost,
        "lost": lost,
        "kB_a_frame": f"{1e3 * megabytes / max(kept, 1):.1f}",
    }
    return row, equal


def loads() -> str:
    """How many threads wanted a processor in the last minute."""
    return f"{os.getloadavg()[0]:.1f} of {os.cpu_count()} cores"


def main() -> int:
    """Measure, print and write the results; 0 when recording is as cheap as asked and replays are equal."""
    parser = argparse.ArgumentParser(description="Cost of recording.")
    parser.add_argument("--rounds", type=int, default=10, help="turns with and without a recorder (default 10)")
    rounds = parser.parse_args().rounds
    kinds = [(4096, 120, RATE_HZ), (4096, 500, None), (64, 10_000, None)]
    rows, equal, load = [], True, loads()
    for worlds, frames, rate_hz in kinds:
        row, is_equal = measure(worlds, rounds=rounds, frames=frames, rate_hz=rate_hz)
        rows.append(row)
        equal &= is_equal
    print_table(rows)
    facts = {"command": f"python -m benches recording --rounds {rounds}", "load_before": load, "load_after": loads()}
    write_results("recording", rows, facts)
    costs = float(rows[0]["cost_percent"])
    if costs > ASKED_PERCENT:
        print(f"recording at {RATE_HZ:.0f} frames/s costs {costs} %, asked {ASKED_PERCENT:.0f}")
    return int(costs > ASKED_PERCENT or not equal)


if __name__ == "__main__":
    sys.exit(main())
