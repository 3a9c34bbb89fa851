"""The daemon process of `launch`: its start, its readiness and its end."""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from tightloop import _core, errors, system
from tightloop.errors import LaunchError

_PROGRAM = Path(__file__).parents[1] / "__main__.py"
# A daemon stops within milliseconds; after this time it is killed [s].
_STOP_SECONDS = 3.0
# What to do where the system starts no process, by the error number.
_CURES = {
    errno.EAGAIN: "allow this user more processes (`ulimit -u`)",
    errno.EMFILE: "allow this process more open files (`ulimit -n`)",
    errno.ENOMEM: "free memory",
}


class Daemon:
    """A daemon process that this process started."""

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
            users: Number of users, each of which will `leave`.

        Raises:
            TightloopError: The error that the daemon reported, as the exception of its kind.
        """
        if not sys.executable:
            raise LaunchError("this Python does not know its own executable; start `tightloop serve` and attach")
        flags = [f"--{flag}" if value is True else f"--{flag}={value}" for flag, value in arguments.items()]
        try:
            # Ctrl-C in a terminal goes to the caller, which decides whether the daemon stops
            process = system.start_apart(
                # without site packages and environment variables: the daemon needs only this package, and starts faster
                [sys.executable, "-I", "-S", str(_PROGRAM), "serve", "-", f"--parent={os.getpid()}", *flags],
                stdin=subprocess.PIPE,
            )
        except OSError as error:
            cure = _CURES.get(error.errno or 0, "let this user run that file")
            raise LaunchError(
                f"the daemon's process {sys.executable!r} cannot be started: {error.strerror}; {cure}, or start "
                "`tightloop serve` elsewhere and attach"
            ) from error
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
        except OSError as problem:
            # where the daemon ended before it read the scene, its answer has the reason
            if not system.is_broken_pipe(problem):
                raise
        # a driver may print lines of its own before the daemon's only one
        answer = next(filter(None, map(_answer, self.process.stdout)), None)
        if answer is None:
            raise LaunchError(f"the daemon {self._end()} before it was ready; launch again with log=FILE")
        if "error" in answer:
            raise getattr(errors, answer["error"]["kind"], LaunchError)(answer["error"]["message"])

    def _end(self) -> str:
        """Describe the end of a daemon that did not answer."""
        try:
            code = self.process.wait(_STOP_SECONDS)
        except subprocess.TimeoutExpired:
            return "closed its standard output"
        return f"was killed by signal {-code}" if code < 0 else f"ended with exit code {code}"

    def leave(self) -> None:
        """Remove a user; `stop` after the last one."""
        self._users -= 1
        if self._users == 0:
            self.stop()

    def stop(self) -> None:
        """Stop the daemon, kill it if it does not stop, and remove the files of a killed one."""
        process = self.process
        try:
            system.ask_to_end(process)
            # a stopped one ends only when it continues
            system.resume(process)
            process.wait(_STOP_SECONDS)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        finally:
            if process.stdout is not None:
                process.stdout.close()
        _core.sweep(self.name)


def _answer(line: bytes) -> dict[str, Any] | None:
    """Return the daemon's answer if a line is one."""
    try:
        answer = json.loads(line)
    except ValueError:
        return None
    return answer if isinstance(answer, dict) and ("ready" in answer or "error" in answer) else None
