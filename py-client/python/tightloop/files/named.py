"""Files that a user names, opened to be read: only what is a file, and only up to a number of bytes.

A pipe may be waited for without end, a device may have no end, and a sparse file may be larger than memory. Files of
``/proc`` say that they are files, and reading some of them waits, too.
"""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import IO

from tightloop import system

_GIB, _MIB = 1 << 30, 1 << 20
# Windows has neither pipes nor terminals with the name of a file, and marks binary files
_FLAGS = os.O_RDONLY | sum(getattr(os, name, 0) for name in ("O_NONBLOCK", "O_NOCTTY", "O_BINARY"))


def opened(what: str, path: Path, error: type[Exception], *, limit: int) -> IO[bytes]:
    """Open a file, to be closed by a ``with`` statement, without waiting.

    Args:
        what: What it is to be, for messages, such as "a snapshot".
        path: The file.
        error: Class of the exceptions.
        limit: Most bytes that it may have.

    Raises:
        OSError: The system cannot open it.
        error: It is not a file, or is too large.
    """
    none = f"{path}: it is not a file; give the path of {what}"
    try:
        descriptor = os.open(path, _FLAGS)
    except OSError as problem:
        # a socket, or a device without a driver
        if problem.errno not in (errno.ENXIO, errno.ENODEV):
            raise
        raise error(none) from None
    try:
        status = os.fstat(descriptor)
        if not stat.S_ISREG(status.st_mode) or status.st_dev == system.device_of_processes():
            raise error(none)
        if status.st_size > limit:
            most = f"{limit // _GIB} GiB" if limit >= _GIB else f"{limit // _MIB} MiB"
            raise error(f"{path}: it is larger than the limit of {most}; give the path of {what}")
        return os.fdopen(descriptor, "rb")
    except BaseException:
        os.close(descriptor)
        raise


def check(what: str, path: Path, error: type[Exception], *, limit: int) -> None:
    """Refuse what `opened` refuses, for a library that opens the file itself.

    Raises:
        OSError: The system cannot open it.
        error: It is not a file, or is too large.
    """
    opened(what, path, error, limit=limit).close()
