"""The browser viewer of a simulation, in a process of its own so that it does not slow the loop."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import weakref
from collections.abc import Sequence
from html import escape

from tightloop import errors, system
from tightloop.checks import arguments as checks
from tightloop.checks.signatures import checked_calls
from tightloop.errors import ArgumentError, LaunchError

_STOP_SECONDS = 3.0


@checked_calls
class Viewer:
    """A viewer, started by `Sim.view`. It ends with the simulation, with this process, or by ``close``.

    Attributes:
        url: Address of the page. Its token lets anyone who has it control the worlds.
        pid: Process id of the viewer.
    """

    def __init__(self, name: str, *, port: int, worlds: int, open: bool, hosts: Sequence[str] = ()) -> None:
        checks.text("view: name", name, error=ArgumentError)
        port = checks.integer("view: port", port, error=ArgumentError)
        worlds = checks.integer("view: worlds", worlds, error=ArgumentError)
        open = checks.flag("view: open", open, error=ArgumentError)
        if isinstance(hosts, str) or not isinstance(hosts, Sequence) or not all(isinstance(h, str) for h in hosts):
            raise ArgumentError(f"view: hosts is {hosts!r}; give a list of host names")
        command = [sys.executable, "-m", "tightloop", "view", name, f"--port={port}", f"--worlds={worlds}"]
        command += [f"--allow-host={host}" for host in hosts]
        command += [f"--parent={os.getpid()}", *(["--open"] if open else [])]
        # the viewer shares our stderr; Ctrl-C in a terminal goes to this process, which decides when the viewer ends
        process = system.start_apart(command)
        assert process.stdout is not None
        line = process.stdout.readline().decode().strip()
        if not line:
            try:
                code: int | None = process.wait(_STOP_SECONDS)
            except subprocess.TimeoutExpired:
                process.kill()
                code = process.wait()
            raise LaunchError(f"the viewer ended with exit code {code}; stderr says why")
        if line.startswith("{"):
            process.wait(_STOP_SECONDS)
            problem = json.loads(line)["error"]
            message = problem["message"].replace("--allow-host", "hosts")
            raise getattr(errors, problem["kind"], LaunchError)(f"view: {message}")
        self.url = line
        self.pid = process.pid
        self._process = process
        self._end = weakref.finalize(self, _end, process, os.getpid())

    @property
    def open(self) -> bool:
        """Whether the viewer runs."""
        return self._end.alive and self._process.poll() is None

    def close(self) -> None:
        """End the viewer; the simulation continues."""
        self._end()

    def _repr_html_(self) -> str:
        return f'<iframe src="{escape(self.url)}" width="100%" height="600" style="border:0"></iframe>'

    def __repr__(self) -> str:
        return f"Viewer({self.url!r}, pid={self.pid}{'' if self.open else ', closed'})"


def _end(process: subprocess.Popen[bytes], owner: int) -> None:
    # a forked child must not end its parent's viewer
    if os.getpid() != owner:
        return
    system.ask_to_end(process)
    try:
        process.wait(_STOP_SECONDS)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    if process.stdout is not None:
        process.stdout.close()
