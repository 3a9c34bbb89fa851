"""Export of a recording into a dataset."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from tightloop.checks import arguments as checks
from tightloop.checks.attributes import suggestion
from tightloop.checks.signatures import checked_calls
from tightloop.datasets.choices import FIELDS, layout
from tightloop.datasets.reading import PerStep, Reader, with_rewards
from tightloop.datasets.writers import Writer, check_place
from tightloop.errors import ArgumentError
from tightloop.scene.scene import Scene

#: Writers of the formats: module, class, and endings of a name; a LeRobot dataset is a folder.
_WRITERS: dict[str, tuple[str, str, tuple[str, ...]]] = {
    "hdf5": ("hdf5", "Hdf5Writer", (".hdf5", ".h5")),
    "lerobot": ("lerobot", "LeRobotWriter", ()),
    "mcap": ("mcap", "McapWriter", (".mcap",)),
    "rerun": ("rerun", "RerunWriter", (".rrd",)),
}
# A process that is killed loses the episodes of so many seconds.
_COMMIT_SECONDS = 1.0

Progress = Callable[[int, int], bool]


@dataclass(frozen=True)
class Export:
    """A finished dataset.

    Attributes:
        path: The file, or the folder.
        episodes: Number of episodes.
        steps: Number of steps in all of them.
        notes: What a reader of the dataset should know.
    """

    path: Path
    episodes: int
    steps: int
    notes: tuple[str, ...]


@checked_calls
def export(
    recording: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    to: str,
    fields: Sequence[str] = FIELDS,
    action: str | Sequence[str] | None = None,
    joints: Sequence[str] | None = None,
    worlds: int | Sequence[int] | None = None,
    fps: float | None = None,
    min_steps: int = 1,
    cameras: Scene | None = None,
    task: str | None = None,
    rewards: PerStep | None = None,
    dones: PerStep | None = None,
    progress: Progress | None = None,
) -> Export:
    """Turn a recording into a dataset of episodes, by a replay.

    The dataset has the name ``NAME.part…`` until it is complete. If the process is killed, that file or folder stays,
    and has all episodes that ended more than about a second before. After an error there is no dataset.

    Args:
        recording: Path of the recording, as `Sim.record` or ``tightloop record`` wrote it.
        out: The new file, which ends in ``.hdf5`` or ``.h5``, ``.mcap`` or ``.rrd``; of LeRobot, the new folder.
        to: Format: ``"hdf5"`` (robomimic's layout), ``"lerobot"``, ``"mcap"`` or ``"rerun"``.
        fields: As of `episodes`.
        action: As of `episodes`.
        joints: As of `episodes`.
        worlds: As of `episodes`.
        fps: As of `episodes`.
        min_steps: As of `episodes`.
        cameras: As of `episodes`.
        task: What the robot does, in words; the name of the recording if left out.
        rewards: Rewards of each step: a function of an `Episode`, or an array ``(steps,)`` for each episode. They are 0
            if left out.
        dones: The same for ends. The last step of an episode is one if left out.
        progress: Called with the number of replayed control frames and of episodes, after each episode. The dataset
            ends there if it returns False.

    Raises:
        ArgumentError: An argument is not valid; the message names it.
        MissingLibrary: The library of the format is not installed.
        OutputError: The dataset cannot be written.
        RecordingError: The recording cannot be read.
        UnknownField: There is no such field.
    """
    if not isinstance(to, str) or to not in _WRITERS:
        raise ArgumentError(f"export: to is {to!r:.80}; {suggestion(str(to), [*_WRITERS])}")
    module, name, endings = _WRITERS[to]
    path = checks.path("export: out", out, error=ArgumentError)
    if endings and path.suffix not in endings:
        raise ArgumentError(
            f"export: out is {path.name!r}; give a file of format {to!r} a name in {' or '.join(endings)}"
        )
    check_place(path)
    least = checks.integer("export: min_steps", min_steps, least=1, error=ArgumentError)
    source = checks.path("export: recording", recording, error=ArgumentError)
    task = source.stem if task is None else checks.text("export: task", task, error=ArgumentError)
    chosen = layout(source, fields=fields, action=action, joints=joints, worlds=worlds, fps=fps, cameras=cameras)
    reader = Reader(source, chosen, least)
    writer: Writer = getattr(import_module(f"tightloop.datasets.{module}"), name)(path, chosen, task)
    try:
        count, steps = _write(reader, writer, rewards, dones, progress)
        if not count:
            raise ArgumentError(f"export: {source} has no episode of {least} or more steps; nothing is written")
        writer.close()
    except BaseException:
        writer.discard()
        raise
    notes = [reader.note] if reader.note else []
    if reader.end is not None and ("missing" in reader.end or "damaged" in reader.end):
        notes.append(f"the recording: {reader.end}")
    return Export(path, count, steps, tuple(notes))


def _write(reader: Reader, writer: Writer, rewards: Any, dones: Any, progress: Progress | None) -> tuple[int, int]:
    """Write all episodes; return their number, and that of their steps."""
    count = steps = 0
    committed = time.monotonic()
    for plain in reader.episodes():
        episode = with_rewards(plain, rewards, dones)
        writer.add(episode)
        count, steps = count + 1, steps + episode.steps
        if time.monotonic() - committed > _COMMIT_SECONDS:
            writer.commit()
            committed = time.monotonic()
        if progress is not None and not progress(reader.frames, count):
            break
    return count, steps
