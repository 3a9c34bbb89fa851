"""What it costs a loop over 4096 worlds that somebody looks at it.

    python benches/viewer.py

The target demo of the lesson, each world with targets of its own, as fast as it goes, in turns: without a viewer, with
one that no page is open of, and with one whose page of 256 worlds is drawn on another machine. The page is a process
that takes what a browser would and draws nothing, since a browser without a GPU takes all of a processor that it gets,
which no simulation can help. Viewer and page have the last core for themselves, the simulation the others. Before and
after each turn comes one without a viewer, which it is compared with: a machine that changes its speed changes both.
What a frame takes of the daemon's processor, as Linux counts it, is what looking costs the simulation; the time of a
step is what the caller sees; each with one standard error. Writes benches/results/MACHINE/viewer.csv with the load of
the machine, and ends with 1 when the loop loses more than the 2 % asked, by more than chance.
"""

from __future__ import annotations

import argparse
import os
import re
import select
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from record import REPOSITORY, print_table, write_results
from tqdm import tqdm

import tightloop as tl

sys.path[:0] = [str(REPOSITORY / "examples")]
from franka_lesson import FRAMES, scene, targets  # noqa: E402  (the examples are no package)

WORLDS = 4096
ASKED_PERCENT = 2.0
# Times that a page says how many frames it shows, five a second over the last two seconds, before they count.
BEGIN = 12
KINDS = ("viewer, no page", "viewer and page")


def processor_ms(pid: int) -> float:
    """Time that all threads of a process have had on a processor [ms]."""
    threads = Path(f"/proc/{pid}/task").iterdir()
    return sum(int((thread / "schedstat").read_text().split()[0]) for thread in threads) / 1e6


class Page:
    """A page that is drawn on another machine: a process that takes all that the viewer sends."""

    def __init__(self, url: str) -> None:
        command = [sys.executable, str(Path(__file__).resolve()), "--take", url]
        self._process = subprocess.Popen(command, stdout=subprocess.PIPE, stdin=subprocess.PIPE, text=True)
        self.pid = self._process.pid

    def is_shown(self) -> bool:
        """Whether it has the meshes, which are sent once, and frames come."""
        if self._process.poll() is not None:
            raise SystemExit("the page ended: see above")
        assert self._process.stdout is not None
        return bool(select.select([self._process.stdout], [], [], 0.0)[0])

    def close(self) -> float:
        """End it; the frames a second that the viewer said it showed."""
        return float(self._process.communicate()[0].split()[-1])


def take(url: str) -> None:
    """What a page does, but for drawing, until stdin ends."""
    import msgspec
    import viser
    import zstandard
    from viser._messages import ViewerCameraMessage
    from websockets.sync.client import connect

    place = url.replace("http://", "ws://")
    camera = ViewerCameraMessage((1, 0, 0, 0), (3, 3, 3), 0.8, 0.01, 1000, 600, 800, (0, 0, 0), (0, 0, 1))
    rates: list[float] = []
    unpack = zstandard.ZstdDecompressor()
    with connect(place, subprotocols=[f"viser-v{viser.__version__}"], max_size=None) as page:  # type: ignore[list-item]
        page.send(msgspec.msgpack.encode(camera.as_serializable_dict()))
        os.set_blocking(0, False)
        while sys.stdin.buffer.read() is None:
            message = page.recv()
            assert isinstance(message, bytes)
            size = int.from_bytes(message[8:16], "little")  # of messages, which are packed; arrays follow as they are
            for rate in re.findall(rb"(\d+) frames/s", unpack.decompress(message[16 : 16 + size])):
                rates.append(float(rate))
                if len(rates) == BEGIN:
                    print("shown", flush=True)
    print(rates[-1] if rates else 0.0)


class Turns:
    """What frames of one kind took beside those without a viewer."""

    def __init__(self) -> None:
        self.step_ms: list[float] = []
        self.step_ratio: list[float] = []
        self.daemon_ms: list[float] = []
        self.daemon_ratio: list[float] = []
        self.viewer_percent: list[float] = []
        self.shown_hz: list[float] = []

    def add(self, plain: list[NDArray[np.float64]], own: NDArray[np.float64]) -> None:
        """Take step and daemon times [ms] of a turn, and of those before and after it."""
        step, daemon = np.mean(plain, axis=0)
        self.step_ms.append(own[0])
        self.daemon_ms.append(own[1])
        self.step_ratio.append(own[0] / step)
        self.daemon_ratio.append(own[1] / daemon)


def turn(sim: tl.Sim, commands: list[NDArray[np.float32]], frames: int) -> NDArray[np.float64]:
    """Time of a step as the caller sees it, and of the daemon's processor [ms]."""
    before, began = processor_ms(sim.pid), time.perf_counter()
    for frame in range(frames):
        sim.step(joint_target_q=commands[frame % FRAMES])
    seconds = time.perf_counter() - began
    return np.array([1e3 * seconds, processor_ms(sim.pid) - before]) / frames


def on_the_last_core(pid: int) -> None:
    """Let a process and its threads run there only."""
    for thread in Path(f"/proc/{pid}/task").iterdir():
        os.sched_setaffinity(int(thread.name), {(os.cpu_count() or 1) - 1})


def measure(rounds: int, frames: int) -> list[dict[str, str | int]]:
    """Both kinds, in turns with none."""
    cores = os.cpu_count() or 1
    os.sched_setaffinity(0, set(range(max(cores - 1, 1))))
    amplitudes = np.random.default_rng(1).uniform(0.5, 1.5, WORLDS)
    commands = [targets(frame, amplitudes) for frame in range(FRAMES)]
    seen = {kind: Turns() for kind in KINDS}
    # a core for the caller, one for viewer and page, the others for the daemon
    with tl.launch(scene(driven=True), worlds=WORLDS, threads=max(cores - 2, 1)) as sim:
        turn(sim, commands, 10 * FRAMES)  # warms caches and clocks
        plain = turn(sim, commands, frames)
        for _ in tqdm(range(rounds), desc=f"{WORLDS} worlds", disable=None):
            for kind in KINDS:
                viewer = sim.view(port=8400)
                on_the_last_core(viewer.pid)
                page = None if kind == KINDS[0] else Page(viewer.url)
                if page is None:
                    time.sleep(0.5)  # until it looks away
                else:
                    on_the_last_core(page.pid)
                    patience = time.monotonic() + 60
                    while not page.is_shown():
                        if time.monotonic() > patience:
                            raise SystemExit("the page shows no frames")
                        turn(sim, commands, FRAMES)
                turn(sim, commands, FRAMES)
                before = processor_ms(viewer.pid)
                own = turn(sim, commands, frames)
                seconds = own[0] * frames / 1e3
                seen[kind].viewer_percent.append((processor_ms(viewer.pid) - before) / (10 * seconds))
                if page is not None:
                    seen[kind].shown_hz.append(page.close())
                viewer.close()
                turn(sim, commands, FRAMES)
                after = turn(sim, commands, frames)
                seen[kind].add([plain, after], own)
                plain = after
    return [row(kind, seen[kind]) for kind in KINDS]


def row(kind: str, seen: Turns) -> dict[str, str | int]:
    """One line of the table."""

    def percent(ratios: list[float]) -> tuple[str, str]:
        """The median of what is lost, and how far a median of so many is off by chance (one standard error)."""
        spread = 1.2533 * np.std(ratios, ddof=1) / np.sqrt(len(ratios)) if len(ratios) > 1 else np.nan
        return f"{100 * (np.median(ratios) - 1):.1f}", f"{100 * spread:.1f}"

    (slower, slower_error), (cost, cost_error) = percent(seen.step_ratio), percent(seen.daemon_ratio)
    return {
        "what": kind,
        "worlds": WORLDS,
        "step_ms": f"{np.median(seen.step_ms):.3f}",
        "slower_percent": slower,
        "slower_error": slower_error,
        "asked_percent": f"{ASKED_PERCENT:.0f}",
        "daemon_cpu_ms": f"{np.median(seen.daemon_ms):.3f}",
        "daemon_cost_percent": cost,
        "daemon_cost_error": cost_error,
        "viewer_cpu_percent": f"{np.median(seen.viewer_percent):.0f}",
        "shown_hz": f"{np.median(seen.shown_hz):.0f}" if seen.shown_hz else "–",
    }


def loads() -> str:
    """How many threads wanted a processor in the last minute."""
    return f"{os.getloadavg()[0]:.1f} of {os.cpu_count()} cores"


def main() -> int:
    """Measure, print and write the results; 0 when looking is as cheap as asked."""
    parser = argparse.ArgumentParser(description="Cost of a viewer.")
    parser.add_argument("--rounds", type=int, default=30, help="turns of each kind (default 30)")
    parser.add_argument("--frames", type=int, default=500, help="frames of a turn (default 500)")
    parser.add_argument("--take", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.take is not None:
        take(given.take)
        return 0
    load = loads()
    rows = measure(given.rounds, given.frames)
    print_table(rows)
    command = f"python benches/viewer.py --rounds {given.rounds} --frames {given.frames}"
    write_results("viewer", rows, {"command": command, "load_before": load, "load_after": loads()})
    failed = 0
    for row in rows:
        lost, error = float(row["slower_percent"]), float(row["slower_error"])
        if lost - 2 * error > ASKED_PERCENT:
            print(f"{row['what']}: the loop loses {lost} % (± {error}), asked {ASKED_PERCENT:.0f}")
            failed = 1
        elif lost + 2 * error > ASKED_PERCENT:
            print(f"{row['what']}: {lost} % (± {error}) is too noisy to tell whether it is below {ASKED_PERCENT:.0f}")
    return failed


if __name__ == "__main__":
    sys.exit(main())
