"""The browser viewer of a simulation, in a process of its own so that it does not slow the loop."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import threading
import weakref
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

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
        world: The world that users follow on the page.
        choice: What users chose last of what `offer` offers; None before they did.
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
        command += [f"--parent={os.getpid()}", "--linked", *(["--open"] if open else [])]
        # the viewer shares our stderr; Ctrl-C in a terminal goes to this process, which decides when the viewer ends
        process = system.start_apart(command, stdin=subprocess.PIPE)
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
        self.world = 0
        self.choice: str | None = None
        self._process = process
        self._rest = b""  # of messages that the page did not take yet
        self._end = weakref.finalize(self, _end, process, os.getpid())
        # it refers to the viewer weakly, so that a viewer without other references still ends
        threading.Thread(target=_listen, args=(process, weakref.ref(self)), name="viewer", daemon=True).start()

    @property
    def open(self) -> bool:
        """Whether the viewer runs."""
        return self._end.alive and self._process.poll() is None

    def offer(self, choices: Sequence[str]) -> None:
        """Let users choose a policy by its name; ``choice`` is what they chose last, None until they do.

        Args:
            choices: Names, the first of which is chosen at first.

        Raises:
            ArgumentError: They are no names.
        """
        if isinstance(choices, str) or not choices or not all(isinstance(choice, str) for choice in choices):
            raise ArgumentError(f"offer: choices is {choices!r:.80}; give a list of names")
        self.choice = None
        self._send({"choices": [*choices]})

    def plot(self, world: int, time: float, values: Mapping[str, float]) -> None:
        """Add to the chart of the page, such as terms of a reward. Values that the page cannot take now are left out.

        Args:
            world: The world, of which only the followed one is shown.
            time: Time since its reset [s].
            values: Its values, by name.
        """
        self._send_rest()
        if not self._rest:
            numbers = {name: float(value) for name, value in values.items()}
            self._send({"world": world, "time": float(time), "values": numbers})

    def _send(self, message: dict[str, Any]) -> None:
        self._rest += json.dumps(message).encode() + b"\n"
        self._send_rest()

    def _send_rest(self) -> None:
        """Write what is left to write, as far as the page takes it: the loop never waits for the page."""
        assert self._process.stdin is not None
        try:
            self._rest = self._rest[system.write_at_once(self._process.stdin, self._rest) :]
        except (OSError, ValueError):  # it has ended, or was closed
            self._rest = b""

    def close(self) -> None:
        """End the viewer; the simulation continues."""
        self._end()

    def _repr_html_(self) -> str:
        return f'<iframe src="{escape(self.url)}" width="100%" height="600" style="border:0"></iframe>'

    def __repr__(self) -> str:
        return f"Viewer({self.url!r}, pid={self.pid}{'' if self.open else ', closed'})"


def _listen(process: subprocess.Popen[bytes], reference: weakref.ref[Viewer]) -> None:
    """Take what the page says until its process ends."""
    assert process.stdout is not None
    with process.stdout as lines:
        for line in lines:
            viewer = reference()
            if viewer is None:
                return
            with contextlib.suppress(ValueError):  # what some other program wrote
                message = json.loads(line)
                viewer.world = message.get("world", viewer.world)
                viewer.choice = message.get("choice", viewer.choice)
            del viewer


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
    # the thread that reads its output closes that
    if process.stdin is not None:
        with contextlib.suppress(OSError):
            process.stdin.close()
