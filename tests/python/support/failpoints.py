"""Failpoints at system calls of unchanged programs: the n-th of a kind that names a watched path fails with an error.

A filter of Linux (seccomp, user notification) hands each call to this process, which lets it pass or answers with an
error. Programs need no hooks for this, and a call that goes past the modules meant for it is found, too.
"""

from __future__ import annotations

import ctypes
import errno
import fcntl
import os
import platform
import re
import select
import socket
import struct
import subprocess
import sys
import threading
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

# A call: numbers on x86-64 and aarch64, indices of a descriptor and of a path, errors that its manual page lists.
# A path is relative to the descriptor before it. -1 where there is none.
_MAKES = (errno.ENOSPC, errno.EIO, errno.EACCES)
_OPENS = (*_MAKES, errno.EMFILE, errno.EINTR)
_WRITES = (errno.ENOSPC, errno.EIO, errno.EINTR)
_READS = (errno.EIO, errno.EINTR)
_LOOKS = (errno.EIO, errno.EACCES)
_CALLS: dict[str, tuple[int, int, int, int, tuple[int, ...]]] = {
    "open": (2, -1, -1, 0, _OPENS),
    "creat": (85, -1, -1, 0, _OPENS),
    "openat": (257, 56, 0, 1, _OPENS),
    "openat2": (437, 437, 0, 1, _OPENS),
    "read": (0, 63, 0, -1, _READS),
    "pread64": (17, 67, 0, -1, _READS),
    "write": (1, 64, 0, -1, _WRITES),
    "pwrite64": (18, 68, 0, -1, _WRITES),
    "writev": (20, 66, 0, -1, _WRITES),
    "copy_file_range": (326, 285, 2, -1, (errno.ENOSPC, errno.EIO)),
    "sendfile": (40, 71, 0, -1, (errno.EIO,)),
    "fsync": (74, 82, 0, -1, _WRITES),
    "fdatasync": (75, 83, 0, -1, _WRITES),
    "ftruncate": (77, 46, 0, -1, (errno.EIO, errno.EINTR)),
    "fallocate": (285, 47, 0, -1, _WRITES),
    "flock": (73, 32, 0, -1, (errno.EIO, errno.EINTR)),
    "mmap": (9, 222, 4, -1, (errno.EACCES, errno.ENOMEM)),
    "mkdir": (83, -1, -1, 0, _MAKES),
    "mkdirat": (258, 34, 0, 1, _MAKES),
    "rename": (82, -1, -1, 1, _MAKES),
    "renameat": (264, 38, 2, 3, _MAKES),
    "renameat2": (316, 276, 2, 3, _MAKES),
    "link": (86, -1, -1, 1, _MAKES),
    "linkat": (265, 37, 2, 3, _MAKES),
    "symlink": (88, -1, -1, 1, _MAKES),
    "symlinkat": (266, 36, 1, 2, _MAKES),
    "unlink": (87, -1, -1, 0, _LOOKS),
    "unlinkat": (263, 35, 0, 1, _LOOKS),
    "rmdir": (84, -1, -1, 0, _LOOKS),
    "chmod": (90, -1, -1, 0, _LOOKS),
    "fchmod": (91, 52, 0, -1, (errno.EIO,)),
    "fchmodat": (268, 53, 0, 1, _LOOKS),
    "fchmodat2": (452, 452, 0, 1, _LOOKS),
    "utimensat": (280, 88, 0, 1, _LOOKS),
    "stat": (4, -1, -1, 0, _LOOKS),
    "lstat": (6, -1, -1, 0, _LOOKS),
    "fstat": (5, 80, 0, -1, (errno.EIO,)),
    "newfstatat": (262, 79, 0, 1, _LOOKS),
    "statx": (332, 291, 0, 1, _LOOKS),
    "access": (21, -1, -1, 0, _LOOKS),
    "faccessat": (269, 48, 0, 1, _LOOKS),
    "faccessat2": (439, 439, 0, 1, _LOOKS),
    "readlink": (89, -1, -1, 0, _LOOKS),
    "readlinkat": (267, 78, 0, 1, _LOOKS),
    "getdents64": (217, 61, 0, -1, (errno.EIO,)),
    "statfs": (137, 43, -1, 0, _LOOKS),
    "fstatfs": (138, 44, 0, -1, (errno.EIO,)),
}
# of a Unix socket, the path is in its address
_ADDRESSES = {"bind": (49, 200, _MAKES), "connect": (42, 203, (errno.EACCES, errno.EINTR))}
# Calls without which nothing else can tidy up.
REMOVALS = {"unlink", "unlinkat", "rmdir"}

_ARM = platform.machine() == "aarch64"
_ROWS = [(name, row[:2]) for name, row in (*_CALLS.items(), *_ADDRESSES.items())]
_NUMBERS = {numbers[_ARM]: name for name, numbers in _ROWS if numbers[_ARM] >= 0}
# linux/audit.h, linux/seccomp.h, linux/filter.h
_ARCHITECTURE = 0xC00000B7 if _ARM else 0xC000003E
_SECCOMP = 277 if _ARM else 317
_RECEIVE, _SEND = 0xC0502100, 0xC0182101
_NOTIFY, _ALLOW = 0x7FC00000, 0x7FFF0000
_LOAD, _JUMP_IF_EQUAL, _RETURN = 0x20, 0x15, 0x06
_NOTICE = struct.Struct("=QIIiIQ6Q")
_ANSWER = struct.Struct("=QqiI")


@dataclass(frozen=True)
class Call:
    """A system call, and the watched path that it names."""

    name: str
    path: Path

    @property
    def errors(self) -> tuple[int, ...]:
        """The errors to answer with."""
        return _CALLS[self.name][4] if self.name in _CALLS else _ADDRESSES[self.name][2]

    @property
    def kind(self) -> tuple[str, str]:
        """The call, and the path without numbers, which are others in each run."""
        return self.name, re.sub(r"[0-9a-f]{8,}|[0-9]+", "*", str(self.path))


@dataclass
class Run:
    """What a program did, and which of its calls failed, if it came to that call."""

    code: int
    out: str
    err: str
    calls: list[Call] = field(default_factory=list[Call])
    failed: Call | None = None


@dataclass(frozen=True)
class Failpoint:
    """The n-th call of a kind, from 1 on, and its error. Processes that run side by side change no kind's order."""

    number: int
    error: int
    call: Call

    def __str__(self) -> str:
        return f"{errno.errorcode[self.error]} of {self.call.name} {self.number} on {self.call.path}"


class _Instruction(ctypes.Structure):
    _fields_ = [("code", ctypes.c_uint16), ("true", ctypes.c_uint8), ("false", ctypes.c_uint8), ("k", ctypes.c_uint32)]


class _Program(ctypes.Structure):
    _fields_ = [("length", ctypes.c_uint16), ("filter", ctypes.POINTER(_Instruction))]


class Unsupported(OSError):
    """The kernel, or what this process runs in, lets no program filter the calls of another one."""


def is_supported() -> bool:
    """Whether calls can be watched here."""
    try:
        run([sys.executable, "-c", ""], [])
    except Unsupported:
        return False
    return True


def run(
    command: Sequence[str | Path],
    watched: Sequence[Path],
    failpoint: Failpoint | None = None,
    *,
    env: Mapping[str, str] | None = None,
    seconds: float = 60,
) -> Run:
    """Run a program, note its calls on paths in the watched folders, and let one fail.

    Args:
        command: The program. Processes that it starts are watched, too.
        watched: Folders and files, by the paths that the program uses or by those without links.
        failpoint: The call that fails.
        env: Variables to add.
        seconds: Time after which the program is killed.

    Raises:
        subprocess.TimeoutExpired: The program did not end.
        Unsupported: Calls cannot be watched here.
    """
    ours, theirs = socket.socketpair()
    done = Run(0, "", "")
    with ours, theirs:
        process = subprocess.Popen(
            [sys.executable, __file__, str(theirs.fileno()), *command],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env={**os.environ, **(env or {})},
            text=True,
            pass_fds=[theirs.fileno()],
        )
        theirs.close()
        _, listeners, _, _ = socket.recv_fds(ours, 1, 1)
    if not listeners:
        raise Unsupported(process.communicate()[1])
    (listener,) = listeners
    answering = threading.Thread(target=_answer, args=(listener, [*watched], failpoint, done))
    answering.start()
    try:
        done.out, done.err = process.communicate(timeout=seconds)
    finally:
        process.kill()
        process.wait()
        answering.join(seconds)
        assert not answering.is_alive(), "a process that it started still runs"
    done.code = process.returncode
    return done


def failpoints(calls: Sequence[Call]) -> Iterator[Failpoint]:
    """Provide every call of a program with each of its errors."""
    seen: Counter[tuple[str, str]] = Counter()
    for call in calls:
        seen[call.kind] += 1
        for error in call.errors:
            yield Failpoint(seen[call.kind], error, call)


def _hand_over_calls(to: socket.socket) -> None:
    """Filter the calls of this process, and of those that it becomes and starts."""
    lines = [(_LOAD, 0, 0, 4), (_JUMP_IF_EQUAL, 1, 0, _ARCHITECTURE), (_RETURN, 0, 0, _ALLOW), (_LOAD, 0, 0, 0)]
    for number in _NUMBERS:
        lines += [(_JUMP_IF_EQUAL, 0, 1, number), (_RETURN, 0, 0, _NOTIFY)]
    lines.append((_RETURN, 0, 0, _ALLOW))
    filters = (_Instruction * len(lines))(*(_Instruction(*line) for line in lines))
    program = _Program(len(lines), filters)
    libc = ctypes.CDLL(None, use_errno=True)
    # no new privileges, then SECCOMP_SET_MODE_FILTER with SECCOMP_FILTER_FLAG_NEW_LISTENER
    if libc.prctl(38, 1, 0, 0, 0) != 0:
        raise OSError(ctypes.get_errno(), "prctl")
    listener = libc.syscall(_SECCOMP, 1, 8, ctypes.byref(program))
    if listener < 0:
        raise OSError(ctypes.get_errno(), "seccomp")
    socket.send_fds(to, [b"x"], [listener])
    os.close(listener)


def _answer(listener: int, watched: list[Path], failpoint: Failpoint | None, done: Run) -> None:
    seen = 0
    try:
        waiting = select.poll()
        waiting.register(listener, select.POLLIN)
        while True:
            ((_, event),) = waiting.poll()
            if not event & select.POLLIN:
                return  # the last process has ended
            notice = bytearray(_NOTICE.size)
            try:
                fcntl.ioctl(listener, _RECEIVE, notice)
            except FileNotFoundError:
                continue  # a signal has interrupted the call
            number, pid, _, call, _, _, *arguments = _NOTICE.unpack(notice)
            error = 0
            path = _path(pid, _NUMBERS[call], arguments)
            if path is not None and any(path == each or each in path.parents for each in watched):
                made = Call(_NUMBERS[call], path)
                done.calls.append(made)
                seen += failpoint is not None and made.kind == failpoint.call.kind
                if failpoint is not None and done.failed is None and seen == failpoint.number:
                    done.failed, error = made, failpoint.error
            # 1: SECCOMP_USER_NOTIF_FLAG_CONTINUE
            try:
                fcntl.ioctl(listener, _SEND, _ANSWER.pack(number, 0, -error, int(error == 0)))
            except FileNotFoundError:
                continue
    finally:
        os.close(listener)


def _path(pid: int, name: str, arguments: Sequence[int]) -> Path | None:
    """Return the path that a call names; none for a pipe, a socket, or a process that has ended."""
    try:
        if name in _ADDRESSES:
            # struct sockaddr_un; other addresses have other families
            address = _memory(pid, arguments[1], min(arguments[2], 110))
            family, text = int.from_bytes(address[:2], "little"), address[2:].split(b"\0")[0]
            return Path(os.fsdecode(text)) if family == socket.AF_UNIX and text else None
        _, _, descriptor, text_at, _ = _CALLS[name]
        text = _text(pid, arguments[text_at]) if text_at >= 0 and arguments[text_at] else b""
        if text.startswith(b"/"):
            return Path(os.path.normpath(os.fsdecode(text)))
        at = ctypes.c_int32(arguments[descriptor]).value if descriptor >= 0 else -100
        link = Path(f"/proc/{pid}/cwd" if at == -100 else f"/proc/{pid}/fd/{at}")
        base = Path(str(link.readlink()).removesuffix(" (deleted)"))
        return Path(os.path.normpath(base / os.fsdecode(text))) if base.is_absolute() else None
    except OSError:
        return None


def _text(pid: int, at: int) -> bytes:
    text = b""
    # not past the page, behind which there may be none
    while b"\0" not in text:
        length = 4096 - (at + len(text)) % 4096
        text += _memory(pid, at + len(text), length)
    return text.split(b"\0")[0]


def _memory(pid: int, at: int, length: int) -> bytes:
    with Path(f"/proc/{pid}/mem").open("rb", buffering=0) as memory:
        return os.pread(memory.fileno(), length, at)


if __name__ == "__main__":
    with socket.socket(fileno=int(sys.argv[1])) as parent:
        _hand_over_calls(parent)
    os.execvp(sys.argv[2], sys.argv[2:])
