"""A recording of a simulation, written by a process of its own that the daemon never waits for."""

from __future__ import annotations

import os
import subprocess
import sys
import warnings
import weakref
from collections.abc import Sequence
from pathlib import Path

from tightloop import system
from tightloop.checks import arguments as checks
from tightloop.checks.signatures import checked_calls
from tightloop.errors import ArgumentError, RecordingError, TightloopWarning

_PROGRAM = Path(__file__).parents[1] / "__main__.py"
# A recorder writes what waits, some milliseconds; a slow disk may take longer [s].
_STOP_SECONDS = 30.0


@checked_calls
class Recording:
    """A recording, started by `Sim.record`. It ends with ``close``, a ``with`` block, the simulation, or this process.

    Attributes:
        path: The file.
        pid: Process id of the recorder.
        summary: What is in the file, such as ``"run.tlrec: 60 frames, 0.1 MB, no gaps; …"``; empty until it ended.
    """

    def __init__(self, name: str, path: str | os.PathLike[str], *, fields: Sequence[str], force: bool) -> None:
        self.path = checks.path("record: path", path, error=ArgumentError)
        if isinstance(fields, str) or not isinstance(fields, Sequence) or not all(isinstance(f, str) for f in fields):
            raise ArgumentError(f"record: fields is {fields!r}; give a list of field names, such as ['joint_q']")
        force = checks.flag("record: force", force, error=ArgumentError)
        self.summary = ""
        command = [sys.executable, "-I", "-S", str(_PROGRAM), "record", name, f"--parent={os.getpid()}"]
        command += [f"--fields={','.join(fields)}"] if fields else []
        command += ["--force"] if force else []
        try:
            process = system.start_apart([*command, "--", str(self.path)], stderr=subprocess.PIPE)
        except OSError as problem:
            raise RecordingError(f"record: the recorder cannot be started: {problem.strerror}") from problem
        assert process.stderr is not None
        # it says that it has begun, once the state of all worlds is there; or why it cannot
        try:
            line = process.stderr.readline().decode(errors="replace").strip().removeprefix("tightloop: ")
        except BaseException:
            # an interrupt: it would have no owner
            process.kill()
            process.communicate()
            raise
        if not line.startswith("recording "):
            process.communicate()
            raise RecordingError(f"record: {line or 'the recorder ended'}".replace("--force", "force=True"))
        self.pid = process.pid
        self._process = process
        self._end = weakref.finalize(self, _end, process, os.getpid())

    @property
    def open(self) -> bool:
        """Whether it records."""
        return self._end.alive and self._process.poll() is None

    @property
    def closed(self) -> bool:
        """Whether `close` was called, by itself or by what it ends with."""
        return not self._end.alive

    def close(self) -> None:
        """End the recording; the file then has every command that was sent before. A second call does nothing.

        Warns:
            TightloopWarning: The recorder was too slow, and left a gap.

        Raises:
            RecordingError: The file could not be written to its end.
        """
        # None: ended before, or in another process
        if (ended := self._end()) is None:
            return
        code, self.summary, news = ended
        if code != 0:
            raise RecordingError(f"record: {news or f'the recorder ended with exit code {code}'}")
        if news:
            warnings.warn(f"record: {news}", TightloopWarning, stacklevel=2)

    def __enter__(self) -> Recording:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Recording({str(self.path)!r}, pid={self.pid}{'' if self.open else ', closed'})"


def _end(process: subprocess.Popen[bytes], owner: int) -> tuple[int, str, str] | None:
    # a forked child must not end its parent's recording
    if os.getpid() != owner:
        return None
    system.ask_to_end(process)
    try:
        said, news = process.communicate(timeout=_STOP_SECONDS)
    except subprocess.TimeoutExpired:
        process.kill()
        said, news = process.communicate()
    lines = news.decode(errors="replace").splitlines()
    return (
        process.returncode,
        said.decode(errors="replace").strip(),
        "; ".join(line.removeprefix("tightloop: ") for line in lines),
    )
