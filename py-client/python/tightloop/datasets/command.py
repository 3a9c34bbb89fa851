"""The subcommand `tightloop export`: a recording as a dataset of episodes."""

from __future__ import annotations

import argparse
import re
import signal
import sys
import threading

from tightloop import system
from tightloop.errors import TightloopError
from tightloop.terminal import printable

_EPILOG = """examples:
  tightloop export run.tlrec demos.hdf5 --to hdf5           all worlds, for robomimic
  tightloop export run.tlrec pick --to lerobot --fps 30     a folder for LeRobot
  tightloop export run.tlrec run.mcap --to mcap --fields joint_q,joint_qd,body_q --worlds 0-3
  tightloop export run.tlrec run.rrd --to rerun --action joint_target_q --joints 'arm/*'"""
# More than fit into any memory.
_WORLDS_END = 1 << 24
_FORMATS = ("hdf5", "lerobot", "mcap", "rerun")


def parser() -> argparse.ArgumentParser:
    """The command line."""
    made = argparse.ArgumentParser(
        prog="tightloop export",
        description="Turn a recording into a dataset of episodes: HDF5 in robomimic's layout, LeRobot, MCAP or Rerun.\n"
        "Until it is complete it is NAME.part, which opens with all episodes so far. Stop with Ctrl-C.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    made.add_argument("recording", metavar="RECORDING", help="recording, as `tightloop record` or sim.record writes it")
    made.add_argument("out", metavar="OUT", help="new file, or new folder of a LeRobot dataset")
    made.add_argument("--to", required=True, choices=_FORMATS, help="format of the dataset")
    made.add_argument(
        "--fields",
        type=_names,
        metavar="NAMES",
        default=("joint_q", "joint_qd"),
        help="fields of the observations, separated by commas (default joint_q,joint_qd)",
    )
    made.add_argument(
        "--action",
        type=_names,
        metavar="NAMES",
        help="commands that are the action, separated by commas (default: those that the recorded client sent first)",
    )
    made.add_argument(
        "--joints",
        type=_names,
        metavar="NAMES",
        help="joints or actuators whose commands are the action, as names or patterns such as arm/*, separated by "
        "commas (default: all but the dofs of free bodies)",
    )
    made.add_argument("--worlds", type=_worlds, help="worlds, such as 0-7,12 (default: all)")
    made.add_argument(
        "--fps",
        type=float,
        help="frames per second, of which the control rate is a multiple (default: the control rate)",
    )
    made.add_argument(
        "--min-steps",
        type=int,
        metavar="STEPS",
        default=1,
        help="fewest steps of an episode; shorter ones are left out (default 1)",
    )
    made.add_argument(
        "--cameras", metavar="FILE", help="scene file whose cameras see the replay, besides those of the recorded scene"
    )
    made.add_argument(
        "--task", metavar="TEXT", help="what the robot does, in words (default: the name of the recording)"
    )
    return made


def main(arguments: list[str]) -> int:
    """Run the subcommand; returns its exit code: 0 done, 1 failed, 2 misused."""
    given = parser().parse_args(arguments)
    shows = sys.stderr.isatty()
    stopped = threading.Event()
    for number in system.stop_signals():
        signal.signal(number, lambda *_: stopped.set())

    def tell(frames: int, episodes: int) -> bool:
        if shows:
            print(f"\r{frames} frames, {episodes} episodes", end="", file=sys.stderr, flush=True)
        return not stopped.is_set()

    try:
        from tightloop.datasets.exporting import export
        from tightloop.scene.scene import Scene

        made = export(
            given.recording,
            given.out,
            to=given.to,
            fields=given.fields,
            action=given.action,
            joints=given.joints,
            worlds=given.worlds,
            fps=given.fps,
            min_steps=given.min_steps,
            cameras=None if given.cameras is None else Scene.load(given.cameras),
            task=given.task,
            progress=tell,
        )
    except (TightloopError, OSError) as problem:
        print(printable(f"tightloop: {problem}"), file=sys.stderr)
        return 1
    if shows:
        print(file=sys.stderr)
    for note in made.notes:
        print(printable(f"tightloop: {note}"), file=sys.stderr)
    print(printable(f"{given.out}: {made.episodes} episodes, {made.steps} steps"))
    return 0


def _names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",") if name.strip()]


def _worlds(text: str) -> list[int]:
    chosen: list[int] = []
    for part in text.split(","):
        ends = re.fullmatch(r"(\d+)(?:-(\d+))?", part.strip())
        first, last = (int(ends[1]), int(ends[2] or ends[1])) if ends else (0, -1)
        if not first <= last < _WORLDS_END:
            raise argparse.ArgumentTypeError(f"{text!r} are no worlds; give them as 0-7,12")
        chosen += range(first, last + 1)
    return chosen
