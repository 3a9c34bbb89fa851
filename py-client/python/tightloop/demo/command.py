"""The subcommand `tightloop demo`."""

from __future__ import annotations

import argparse
import signal
import sys
from pathlib import Path

from tightloop.demo.any_file import FileScene
from tightloop.demo.scenes import SCENES, DemoScene
from tightloop.demo.tour import Plan, tour
from tightloop.errors import TightloopError

_EPILOG = """stops:
  {stops}

examples:
  tightloop demo                           all stops, with a line and a picture each
  tightloop demo --view                    the same in the browser, in real time
  tightloop demo --stop grasp --seconds 60 --view
  tightloop demo robot.urdf --view         a robot of your own, whose joints follow waves"""

# Of a file's demo.
_WORLDS = 16


def parser() -> argparse.ArgumentParser:
    """The command line."""
    width = max(len(stop.name) for stop, _ in SCENES) + 2
    stops = "\n  ".join(f"{stop.name:<{width}}{worlds} {stop.title}" for stop, worlds in SCENES)
    made = argparse.ArgumentParser(
        prog="tightloop demo",
        description="Tour the features of tightloop. Each stop prints a line of numbers and writes a picture.",
        epilog=_EPILOG.format(stops=stops),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    names = [stop.name for stop, _ in SCENES]
    made.add_argument(
        "file", nargs="?", type=Path, metavar="FILE", help="show this URDF, MJCF or scene file instead of the tour"
    )
    made.add_argument(
        "--stop", action="append", choices=names, metavar="NAME", help="show only this stop; can be repeated"
    )
    made.add_argument("--seconds", type=_positive, help="seconds at each stop (default: one round)")
    made.add_argument("--worlds", type=_count, help="number of worlds of every stop (default: see below)")
    made.add_argument("--view", action="store_true", help="show the tour in the browser, in real time")
    made.add_argument(
        "--port", type=_count, default=8080, help="port of the page; the next free port if it is taken (default 8080)"
    )
    made.add_argument("--out", type=Path, default=Path("demo"), help="folder for the pictures (default demo)")
    made.add_argument("--device", default="auto", help="where the physics runs: cpu, gpu or auto (default auto)")
    made.add_argument("--threads", type=_count, help="most threads of a step (default: all cores)")
    return made


def main(arguments: list[str]) -> int:
    """Run the subcommand; returns its exit code: 0 done, 1 failed, 2 misused, 130 ended by Ctrl-C."""
    given = parser().parse_args(arguments)
    if given.out.exists() and not given.out.is_dir():
        print(f"tightloop: --out {given.out} is a file; give a folder for the pictures", file=sys.stderr)
        return 1
    plan = Plan(given.out, given.seconds, given.view, given.port, given.device, given.threads)
    try:
        if given.file is not None:
            chosen: list[DemoScene] = [FileScene(given.file, given.worlds or _WORLDS)]
        else:
            stops = [entry for entry in SCENES if not given.stop or entry[0].name in given.stop]
            chosen = [stop(given.worlds or worlds) for stop, worlds in stops]
        tour(chosen, plan)
    except (TightloopError, OSError) as problem:
        print(f"tightloop: {problem}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 128 + signal.SIGINT
    return 0


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text!r} is not above 0; give a number of seconds")
    return value


def _count(text: str) -> int:
    try:
        value = int(text)
    except ValueError:
        value = 0
    if value < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not at least 1; give a whole number")
    return value
