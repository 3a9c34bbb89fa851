"""What it costs a loop over 4096 worlds that somebody looks at it.

    python benches/viewer.py

The target demo of the lesson, each world with targets of its own, as fast as it goes, in turns: without a viewer, with
one that no page is open of, and with a page in headless Chromium that shows 256 worlds. Viewer and page have the last
core for themselves, the simulation the others: a browser without a GPU draws in software and takes all that it gets,
which no simulation can help. What a frame takes of the daemon's processor, as Linux counts it, is what looking costs
the simulation; beside it the time of a step as the caller sees it, and what the viewer takes and shows. Writes
benches/results/MACHINE/viewer.csv with the load of the machine, and ends with 1 when looking costs more than the 2 %
asked.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from contextlib import ExitStack
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from record import REPOSITORY, print_table, write_results
from tqdm import tqdm

import tightloop as tl

sys.path[:0] = [str(REPOSITORY / "examples"), str(REPOSITORY / "tests/python")]
from franka_lesson import FRAMES, scene, targets  # noqa: E402

from browser import View, chromium  # noqa: E402  (neither is a package)

WORLDS = 4096
ASKED_PERCENT = 2.0
KINDS = ("no viewer", "viewer, no page", "viewer and page")


def processor_ms(pid: int) -> float:
    """Time that all threads of a process have had on a processor [ms]."""
    threads = Path(f"/proc/{pid}/task").iterdir()
    return sum(int((thread / "schedstat").read_text().split()[0]) for thread in threads) / 1e6


class Turn:
    """What the frames of turns of one kind took."""

    def __init__(self) -> None:
        self.step_ms: list[float] = []
        self.daemon_ms: list[float] = []
        self.viewer_ms: list[float] = []
        self.shown_hz: list[float] = []

    def measure(
        self, sim: tl.Sim, commands: list[NDArray[np.float32]], frames: int, viewer: int | None, view: View | None
    ) -> None:
        """One turn; ``viewer`` is the viewer's process."""
        pids = [sim.pid] + ([viewer] if viewer else [])
        before, began = [processor_ms(pid) for pid in pids], time.perf_counter()
        for frame in range(frames):
            sim.step(joint_target_q=commands[frame % FRAMES])
        seconds = time.perf_counter() - began
        taken = [processor_ms(pid) - start for pid, start in zip(pids, before, strict=True)]
        self.step_ms.append(1e3 * seconds / frames)
        self.daemon_ms.append(taken[0] / frames)
        self.viewer_ms += [used / seconds for used in taken[1:]]
        if view is not None:
            self.shown_hz.append(float(view.text.split("frames/s")[0].split("·")[-1]))


def on_the_last_core(pids: list[int]) -> None:
    """Let processes and their threads run there only."""
    for pid in pids:
        for thread in Path(f"/proc/{pid}/task").iterdir():
            os.sched_setaffinity(int(thread.name), {(os.cpu_count() or 1) - 1})


def measure(rounds: int, frames: int) -> list[dict[str, str | int]]:
    """All kinds, in turns."""
    cores = os.cpu_count() or 1
    amplitudes = np.random.default_rng(1).uniform(0.5, 1.5, WORLDS)
    commands = [targets(frame, amplitudes) for frame in range(FRAMES)]
    turns = {kind: Turn() for kind in KINDS}
    with ExitStack() as stack:
        os.sched_setaffinity(0, {cores - 1})
        browser = stack.enter_context(chromium())  # it inherits the last core
        os.sched_setaffinity(0, set(range(max(cores - 1, 1))))
        threads = max(cores - 1, 1)
        sim = stack.enter_context(tl.launch(scene(driven=True), worlds=WORLDS, threads=threads))
        Turn().measure(sim, commands, FRAMES, None, None)  # warms caches and clocks
        for _ in tqdm(range(rounds), desc=f"{WORLDS} worlds", disable=None):
            turns[KINDS[0]].measure(sim, commands, frames, None, None)
            viewer = sim.view(port=8400)
            on_the_last_core([viewer.pid])
            time.sleep(2.0)
            turns[KINDS[1]].measure(sim, commands, frames, viewer.pid, None)
            view = View(browser, viewer.url)
            # meshes are sent once, then frames
            Turn().measure(sim, commands, frames, None, None)
            turns[KINDS[2]].measure(sim, commands, frames, viewer.pid, view)
            view.page.close()
            viewer.close()
    plain = turns[KINDS[0]]
    rows: list[dict[str, str | int]] = []
    for kind, turn in turns.items():
        cost = 100 * (np.median(np.array(turn.daemon_ms) / plain.daemon_ms) - 1)
        slower = 100 * (np.median(np.array(turn.step_ms) / plain.step_ms) - 1)
        rows.append(
            {
                "what": kind,
                "worlds": WORLDS,
                "daemon_cpu_ms": f"{np.median(turn.daemon_ms):.3f}",
                "cost_percent": f"{cost:.1f}",
                "asked_percent": f"{ASKED_PERCENT:.0f}",
                "step_ms": f"{np.median(turn.step_ms):.3f}",
                "slower_percent": f"{slower:.1f}",
                "viewer_cpu_percent": f"{np.median(turn.viewer_ms) / 10:.0f}" if turn.viewer_ms else "–",
                "shown_hz": f"{np.median(turn.shown_hz):.0f}" if turn.shown_hz else "–",
            }
        )
    return rows


def loads() -> str:
    """How many threads wanted a processor in the last minute."""
    return f"{os.getloadavg()[0]:.1f} of {os.cpu_count()} cores"


def main() -> int:
    """Measure, print and write the results; 0 when looking is as cheap as asked."""
    parser = argparse.ArgumentParser(description="Cost of a viewer.")
    parser.add_argument("--rounds", type=int, default=10, help="turns of each kind (default 10)")
    parser.add_argument("--frames", type=int, default=1500, help="frames of a turn (default 1500)")
    given = parser.parse_args()
    load = loads()
    rows = measure(given.rounds, given.frames)
    print_table(rows)
    command = f"python benches/viewer.py --rounds {given.rounds} --frames {given.frames}"
    write_results("viewer", rows, {"command": command, "load_before": load, "load_after": loads()})
    costs = max(float(row["cost_percent"]) for row in rows)
    if costs > ASKED_PERCENT:
        print(f"a viewer costs {costs} %, asked {ASKED_PERCENT:.0f}")
    return int(costs > ASKED_PERCENT)


if __name__ == "__main__":
    sys.exit(main())
