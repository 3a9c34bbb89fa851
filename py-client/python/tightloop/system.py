"""What differs between Linux, macOS and Windows. No other module of this package asks which of them it runs on."""

from __future__ import annotations

import contextlib
import errno
import functools
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

# A folder of files in memory on Linux.
_SHARED_MEMORY = Path("/dev/shm")
# How far a process steps back: 0 is ordinary, 19 the farthest.
_NICENESS = 5
# From winnt.h and winbase.h.
_SYNCHRONIZE, _WAIT_OBJECT_0, _CURRENT_PROCESS, _BELOW_NORMAL = 0x100000, 0, -1, 0x4000


def usable_cores() -> int:
    """Return the number of cores that this process may use."""
    if sys.platform == "linux":
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def give_way(niceness: int = _NICENESS) -> None:
    """Let other processes go first where there are not enough cores; processes that this one starts do so, too.

    Args:
        niceness: How far to step back, 1 to 19; Windows knows one step.
    """
    if sys.platform == "win32":
        _kernel().SetPriorityClass(_CURRENT_PROCESS, _BELOW_NORMAL)
        return
    os.nice(niceness)
    if os.getsid(0) == os.getpid():
        give_way_as_session(os.getpid(), niceness)


def give_way_as_session(leader: int, niceness: int) -> None:
    """Let a session step back as a whole, since Linux weighs sessions against each other first.

    Args:
        leader: Process id of the first process of the session, such as one of `start_apart`.
        niceness: How far, 1 to 19.
    """
    if sys.platform == "linux":
        # not every kernel groups sessions
        with contextlib.suppress(OSError):
            Path(f"/proc/{leader}/autogroup").write_text(f"{niceness}")


def start_apart(
    command: Sequence[str], *, stdin: int | None = None, stderr: int | None = None
) -> subprocess.Popen[bytes]:
    """Start a process that Ctrl-C in this terminal does not reach, with a pipe as its standard output.

    Args:
        command: The program and its arguments.
        stdin: As of `subprocess.Popen`.
        stderr: As of `subprocess.Popen`.

    Raises:
        OSError: The system starts no such process.
    """
    if sys.platform == "win32":
        flags = subprocess.CREATE_NEW_PROCESS_GROUP
        return subprocess.Popen(command, stdin=stdin, stdout=subprocess.PIPE, stderr=stderr, creationflags=flags)
    return subprocess.Popen(command, stdin=stdin, stdout=subprocess.PIPE, stderr=stderr, start_new_session=True)


def write_at_once(pipe: IO[bytes], data: bytes) -> int:
    """Write as much to a pipe as it takes now, and return how many bytes that is.

    Args:
        pipe: The pipe, of which this is the only writer.
        data: Bytes to write.

    Raises:
        OSError: The pipe has no reader any more.
    """
    if sys.platform == "win32" and sys.version_info < (3, 12):
        return len(data)  # this Python cannot write without waiting there, so it writes nothing
    os.set_blocking(pipe.fileno(), False)
    try:
        return os.write(pipe.fileno(), data)
    except BlockingIOError:
        return 0


def take_pipes() -> tuple[IO[str], IO[str]]:
    """Return standard input and output for this process alone: those that it starts have none."""
    taken = os.fdopen(os.dup(0), "r"), os.fdopen(os.dup(1), "w")
    sys.stdout.flush()
    nothing = os.open(os.devnull, os.O_RDWR)
    for number in (0, 1):
        os.dup2(nothing, number)
    os.close(nothing)
    return taken


def device_of_processes() -> int | None:
    """Return the device of files that show processes and the kernel, which are no files to read; None without them."""
    try:
        return Path("/proc").stat().st_dev if Path("/proc/self").exists() else None
    except OSError:
        return None


def ask_to_end(process: subprocess.Popen[bytes]) -> None:
    """Ask a process of `start_apart` to end."""
    if sys.platform == "win32":
        try:
            process.send_signal(signal.CTRL_BREAK_EVENT)
            return
        # without a console in common; some versions of Python report that as a SystemError
        except (OSError, SystemError):
            pass
    process.terminate()


def resume(process: subprocess.Popen[bytes]) -> None:
    """Let a stopped process continue; Windows stops none."""
    if sys.platform != "win32":
        process.send_signal(signal.SIGCONT)


def stop_signals() -> tuple[signal.Signals, ...]:
    """Return the signals by which a terminal or `ask_to_end` asks this process to end."""
    if sys.platform == "win32":
        return (signal.SIGINT, signal.SIGTERM, signal.SIGBREAK)
    return (signal.SIGINT, signal.SIGTERM)


def is_orphan(parent: int) -> bool:
    """Return whether the process that started this one has ended.

    Args:
        parent: Its process id.
    """
    if sys.platform == "win32":
        # the ``python.exe`` of a virtual environment is a process between the two
        handle = _handle_of(parent)
        return not handle or _kernel().WaitForSingleObject(handle, 0) == _WAIT_OBJECT_0
    return os.getppid() != parent


def is_broken_pipe(problem: OSError) -> bool:
    """Return whether a write failed because the reader of the pipe has ended."""
    return isinstance(problem, BrokenPipeError) or (sys.platform == "win32" and problem.errno == errno.EINVAL)


def give_standard_input(data: bytes) -> None:
    """Make bytes the standard input of this process.

    Raises:
        OSError: There is no room for them.
    """
    with _anonymous_file() as file:
        _write(file, data)
        file.seek(0)
        os.dup2(file.fileno(), 0)


@contextmanager
def exchange_file(process: int, data: bytes = b"") -> Iterator[str]:
    """Provide a file that this process and another one open by the same path, in memory if possible.

    On Linux it has no name and ends with this process, unless the other one is in another container. Elsewhere a
    process that is killed leaves it in the temporary folder.

    Args:
        process: Id of the other process.
        data: What it reads there. It may write the file instead.

    Raises:
        OSError: The file cannot be made; `cure_of_full_exchange` says what to do.
    """
    folder = _SHARED_MEMORY if sys.platform == "linux" and _SHARED_MEMORY.is_dir() else None
    if sys.platform == "linux" and _is_beside(process):
        with tempfile.TemporaryFile(dir=folder, buffering=0) as file:
            _write(file, data)
            yield f"/proc/{os.getpid()}/fd/{file.fileno()}"
        return
    descriptor, path = tempfile.mkstemp(prefix="tightloop-", dir=folder)
    try:
        # closed before the other process opens it: Windows replaces no open file
        with os.fdopen(descriptor, "wb", buffering=0) as file:
            _write(file, data)
        yield path
    finally:
        with contextlib.suppress(OSError):
            Path(path).unlink()


def cure_of_full_exchange() -> str:
    """Return what to do where `exchange_file` has no room."""
    if sys.platform == "linux":
        return "make room in shared memory (`df -h /dev/shm` shows it)"
    return "make room in the temporary folder, or set TMPDIR to one that has room"


def write_to_disk(path: Path) -> None:
    """Wait until the contents of a file survive a power cut.

    Raises:
        OSError: The disk failed.
    """
    # Windows flushes only what is open for writing
    opened = os.open(path, os.O_RDWR if sys.platform == "win32" else os.O_RDONLY)
    try:
        os.fsync(opened)
        if sys.platform == "darwin":
            import fcntl

            # fsync ends when the drive has the data, in its cache; file systems of a network know no more than that
            with contextlib.suppress(OSError):
                fcntl.fcntl(opened, fcntl.F_FULLFSYNC)
    finally:
        os.close(opened)


def shares_gpu_memory() -> bool:
    """Return whether processes of this system can share memory of a GPU by Vulkan and CUDA."""
    return sys.platform == "linux"


def _anonymous_file() -> IO[bytes]:
    """Open a file that ends with its last descriptor."""
    if sys.platform == "linux":
        return os.fdopen(os.memfd_create("scene"), "w+b", buffering=0)
    return tempfile.TemporaryFile(buffering=0)


def _write(file: IO[bytes], data: bytes) -> None:
    rest = memoryview(data)
    while rest:
        rest = rest[file.write(rest) :]


def _is_beside(process: int) -> bool:
    """Return whether a process knows this one by the same id."""
    try:
        return Path("/proc/self/ns/pid").readlink() == Path(f"/proc/{process}/ns/pid").readlink()
    except OSError:
        return False


@functools.cache
def _kernel() -> Any:
    """Return the functions of Windows."""
    import ctypes

    assert sys.platform == "win32"
    kernel = ctypes.WinDLL("kernel32")
    handle = ctypes.c_void_p
    kernel.OpenProcess.restype = handle
    kernel.WaitForSingleObject.argtypes = [handle, ctypes.c_uint32]
    kernel.SetPriorityClass.argtypes = [handle, ctypes.c_uint32]
    return kernel


@functools.cache
def _handle_of(process: int) -> int | None:
    """Return a handle of a process; while it is open, no other process gets the same id."""
    return _kernel().OpenProcess(_SYNCHRONIZE, False, process)
