"""Checks of processes: whether one runs, and which shared-memory files a daemon leaves behind."""

from __future__ import annotations

import os
import re
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any


@contextmanager
def started(command: Sequence[Any], **options: Any) -> Iterator[subprocess.Popen[Any]]:
    """Start a process that ends with the block, also where a check fails in it: `Popen` alone would wait for ever."""
    with subprocess.Popen(command, **options) as process:
        try:
            yield process
        finally:
            process.kill()


def stems_of(pid: int) -> set[str]:
    """Return the prefixes of a daemon's shared-memory files, read from the running process."""
    maps = Path(f"/proc/{pid}/maps").read_text()
    return set(re.findall(r"/dev/shm/(tl[0-9a-f]{16})", maps))


def left_of(stems: set[str]) -> list[str]:
    """Return the shared-memory files with these prefixes, and what is in those that are folders."""
    assert stems, "a running daemon has shared memory"
    found = [str(path) for path in Path("/dev/shm").iterdir() if path.name.startswith(tuple(stems))]
    # unlike Path.rglob, it passes over a folder that goes meanwhile
    inside = [f"{folder}/{name}" for top in found for folder, _, names in os.walk(top) for name in names]
    return sorted(found + inside)


def alive(pid: int) -> bool:
    """Return whether a process runs; a zombie does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def children_of(pid: int) -> list[int]:
    """Return the processes that a process started and that run, whichever of its threads started them."""
    found: list[int] = []
    # a process or a thread may end between two reads; a thread's children then go to another
    with suppress(FileNotFoundError):
        for task in Path(f"/proc/{pid}/task").iterdir():
            with suppress(FileNotFoundError, ProcessLookupError):
                found += map(int, (task / "children").read_text().split())
    return found


def command_of(pid: int) -> list[bytes]:
    """Return the words of a process's command line; none when it has ended."""
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
    except (FileNotFoundError, ProcessLookupError):
        return []


def stopped(pid: int) -> bool:
    """Return whether every thread of a process is stopped, which a SIGSTOP only asks for."""
    stats = [task.joinpath("stat").read_text() for task in Path(f"/proc/{pid}/task").iterdir()]
    return all(stat.rpartition(")")[2].split()[0] == "T" for stat in stats)


def wait_until(condition: Callable[[], bool], seconds: float) -> bool:
    """Poll until a condition holds; return whether it did in time."""
    deadline = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.01)
    return True
