"""The process behind `launch`: started with a scene, watched until it is ready, and never left behind."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from tightloop import _core, errors
from tightloop.errors import LaunchError

_PROGRAM = Path(__file__).with_name("__main__.py")
# A daemon that was told to stop needs milliseconds; after this it is killed.
_STOP_SECONDS = 3.0


class Daemon:
    """A daemon process of our own, and its name."""

    def __init__(self, process: subprocess.Popen[bytes], name: str, users: int) -> None:
        self.process = process
        self.name = name
        self._users = users

    @classmethod
    def start(cls, scene: str, arguments: dict[str, Any], users: int = 1) -> Daemon:
        """Start a daemon and wait until it is ready.

        Args:
            scene: The scene as TOML; paths inside are absolute.
            arguments: Values of the long flags of ``tightloop serve``.
            users: How many will `leave`.

        Raises:
            TightloopError: What the daemon said, as the exception of its kind.
        """
        if not sys.executable:
            raise LaunchError("this Python does not know its own executable; start `tightloop serve` and attach")
        flags = [f"--{flag}={value}" for flag, value in arguments.items()]
        process = subprocess.Popen(
            # No site packages and no environment: the daemon needs only this package, and starts at once
            [sys.executable, "-I", "-S", str(_PROGRAM), "serve", "-", f"--parent={os.getpid()}", *flags],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            # Ctrl-C in a terminal goes to the caller, who decides what becomes of the daemon
            start_new_session=True,
        )
        daemon = cls(process, arguments["name"], users)
        try:
            daemon._await_ready(scene)
        except BaseException:
            daemon.stop()
            raise
        return daemon

    def _await_ready(self, scene: str) -> None:
        assert self.process.stdin is not None and self.process.stdout is not None
        try:
            with self.process.stdin as stdin:
                stdin.write(scene.encode())
        except BrokenPipeError:
            pass  # it ended before reading the scene, and its line says why
        line = self.process.stdout.readline()
        try:
            answer = json.loads(line)
        except ValueError:
            raise LaunchError(f"the daemon {self._end()} before it was ready; launch again with log=FILE") from None
        if "error" in answer:
            raise getattr(errors, answer["error"]["kind"], LaunchError)(answer["error"]["message"])

    def _end(self) -> str:
        """How a daemon ended that closed its stdout, or wrote into it what it never does."""
        try:
            code = self.process.wait(_STOP_SECONDS)
        except subprocess.TimeoutExpired:
            return "was not understood"
        return f"was killed by signal {-code}" if code < 0 else f"ended with exit code {code}"

    def leave(self) -> None:
        """One user less; `stop` after the last."""
        self._users -= 1
        if self._users == 0:
            self.stop()

    def stop(self) -> None:
        """Wait for the daemon to end, make it end if it does not, and remove what a killed one leaves."""
        process = self.process
        try:
            process.terminate()
            process.wait(_STOP_SECONDS)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        finally:
            if process.stdout is not None:
                process.stdout.close()
        _core.sweep(self.name)
