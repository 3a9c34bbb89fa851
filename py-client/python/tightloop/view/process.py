"""A viewer beside a simulation: a process of its own, so that drawing and stepping share no interpreter."""

from __future__ import annotations

import os
import subprocess
import sys
import weakref

from tightloop.errors import LaunchError

_STOP_SECONDS = 3.0


class Viewer:
    """A viewer that `Sim.view` started; it ends with the simulation, with this process, or by ``close``.

    Attributes:
        url: Where the page is.
        pid: The viewer's process.
    """

    def __init__(self, name: str, *, port: int, worlds: int, open: bool) -> None:
        command = [sys.executable, "-m", "tightloop", "view", name, f"--port={port}", f"--worlds={worlds}"]
        command += [f"--parent={os.getpid()}", *(["--open"] if open else [])]
        # its news goes where ours goes; Ctrl-C in a terminal goes to us, who decide what becomes of it
        process = subprocess.Popen(command, stdout=subprocess.PIPE, start_new_session=True)
        assert process.stdout is not None
        line = process.stdout.readline().decode().strip()
        if not line:
            try:
                code: int | None = process.wait(_STOP_SECONDS)
            except subprocess.TimeoutExpired:
                process.kill()
                code = process.wait()
            raise LaunchError(f"the viewer ended with exit code {code}; stderr says why")
        self.url = line
        self.pid = process.pid
        self._process = process
        self._end = weakref.finalize(self, _end, process, os.getpid())

    @property
    def open(self) -> bool:
        """Whether it runs."""
        return self._end.alive and self._process.poll() is None

    def close(self) -> None:
        """End the viewer; the simulation goes on."""
        self._end()

    def __repr__(self) -> str:
        return f"Viewer({self.url!r}, pid={self.pid}{'' if self.open else ', closed'})"


def _end(process: subprocess.Popen[bytes], owner: int) -> None:
    # A forked child must not end what belongs to its parent
    if os.getpid() != owner:
        return
    process.terminate()
    try:
        process.wait(_STOP_SECONDS)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    if process.stdout is not None:
        process.stdout.close()
