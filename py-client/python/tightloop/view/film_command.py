"""The subcommand `tightloop film`: a daemon or a recording as PNG, GIF, MP4 or HTML."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import threading

from tightloop import system
from tightloop.errors import TightloopError
from tightloop.terminal import printable
from tightloop.view.cameras import PRESETS

_EPILOG = """examples:
  tightloop film franka out.mp4                           5 s of the daemon `franka`
  tightloop film run.tlrec run.gif --worlds 16 --fps 15   16 worlds, the whole recording
  tightloop film run.tlrec at3.png --at 3 --camera side   one picture, 3 s after the start
  tightloop film run.tlrec run.html --seconds 10          a page to rotate and zoom in a browser"""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    made = argparse.ArgumentParser(
        prog="tightloop film",
        description="Make pictures or a film of a daemon or a recording, without a display. Stop with Ctrl-C.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    made.add_argument("source", metavar="NAME|FILE.tlrec", help="name of a daemon, or a recording")
    made.add_argument(
        "out",
        metavar="OUT",
        help="a .png, .gif, .mp4 or .html file, which replaces an existing one once it is complete, or a new folder "
        "of PNG files",
    )
    made.add_argument(
        "--at", type=float, metavar="SECONDS", help="start of the film, or time of a .png [s] (default 0)"
    )
    made.add_argument(
        "--seconds",
        type=float,
        help="length of the film [s] (default: 5 s of real time of a daemon, or the whole recording)",
    )
    made.add_argument("--fps", type=float, default=30.0, help="pictures per second (default 30)")
    made.add_argument("--speed", type=float, default=1.0, help="simulated seconds per second of film (default 1)")
    made.add_argument(
        "--size", type=_size, default=(640, 480), metavar="WxH", help="size of the pictures (default 640x480)"
    )
    made.add_argument("--worlds", type=int, default=1, help="number of worlds to show, on a grid (default 1)")
    made.add_argument("--world", type=int, default=0, help="world to show alone, or to follow (default 0)")
    made.add_argument(
        "--camera",
        choices=list(PRESETS),
        help="camera position; follow moves with the robot (default follow for a single world whose robot floats, else "
        "three-quarter)",
    )
    made.add_argument("--collision", action="store_true", help="show collision shapes instead of visuals")
    made.add_argument(
        "--no-contacts",
        action="store_true",
        help="hide contact points and forces; above 4 worlds they are hidden",
    )
    return made


def main(arguments: list[str]) -> int:
    """Run the subcommand; returns its exit code: 0 done, 1 failed, 2 misused."""
    given = parser().parse_args(arguments)
    shows = sys.stderr.isatty()
    stopped = threading.Event()
    for number in system.stop_signals():
        signal.signal(number, lambda *_: stopped.set())

    def tell(seconds: float) -> bool:
        if shows:
            print(f"\r{seconds:8.2f} s", end="", file=sys.stderr, flush=True)
        return not stopped.is_set()

    try:
        from tightloop.view.films import film

        made = film(
            given.source,
            given.out,
            at=given.at,
            seconds=given.seconds,
            fps=given.fps,
            speed=given.speed,
            size=given.size,
            worlds=given.worlds,
            world=given.world,
            camera=given.camera,
            kind="collision" if given.collision else "visual",
            contacts=False if given.no_contacts else None,
            progress=tell,
        )
    except (TightloopError, OSError) as problem:
        print(printable(f"tightloop: {problem}"), file=sys.stderr)
        return 1
    if shows:
        print(file=sys.stderr)
    for note in made.notes:
        print(printable(f"tightloop: {note}"), file=sys.stderr)
    print(os.fspath(given.out))
    return 0


def _size(text: str) -> tuple[int, int]:
    width, _, height = text.partition("x")
    if not (width.isdigit() and height.isdigit()):
        raise argparse.ArgumentTypeError(f"{text!r} is no size; give it as 640x480")
    return int(width), int(height)
