"""Files that appear as a whole: written under a hidden name beside their place, then renamed into it.

An error, a full disk or the end of the process leaves an existing file as it was. A process that is killed leaves at
most the hidden file, ``.tightloop-…``.
"""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tightloop import system
from tightloop.errors import OutputError

_NEW_MODE = 0o666


class WholeFile:
    """A file in the making. `keep` puts it in its place, and `discard` removes what was written.

    Attributes:
        part: The hidden file to write into, with the ending of the file.

    Args:
        path: The file; of a symbolic link, its target is replaced.
        error: Class of the exceptions.

    Raises:
        OutputError: There can be no such file, or ``error``.
    """

    def __init__(self, path: Path, error: type[Exception] = OutputError) -> None:
        self._path, self._error = path, error
        self._place = place_of(path, error)
        self.part = self._place.with_name(f".tightloop-{secrets.token_hex(8)}{self._place.suffix}")
        self._end = weakref.finalize(self, _remove, self.part, os.getpid())
        with self.writing():
            os.close(os.open(self.part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, _NEW_MODE))
            # it may go meanwhile
            with contextlib.suppress(FileNotFoundError):
                self.part.chmod(self._place.stat().st_mode & 0o777)

    @contextmanager
    def writing(self) -> Iterator[None]:
        """Name the file in errors of the block, after which it is discarded."""
        try:
            yield
        except OSError as problem:
            self.discard()
            raise _unwritable(self._path, problem, self._error) from problem

    def keep(self, *, durable: bool = True) -> None:
        """Put the file in its place.

        Args:
            durable: Whether it must survive a power cut once this returns; otherwise it may be lost or empty.
        """
        with self.writing():
            if durable:
                system.write_to_disk(self.part)
            self.part.replace(self._place)
        self._end.detach()

    def discard(self) -> None:
        """Remove what was written; after `keep`, do nothing."""
        self._end()


@contextmanager
def whole_file(path: Path, error: type[Exception] = OutputError, *, durable: bool = True) -> Iterator[Path]:
    """Provide the path of a hidden file to write, which is put in its place if the block ends without an error.

    Args:
        path: The file.
        error: Class of the exceptions.
        durable: As of `WholeFile.keep`.

    Raises:
        OutputError: The file cannot be written, or ``error``.
    """
    file = WholeFile(path, error)
    try:
        with file.writing():
            yield file.part
        file.keep(durable=durable)
    finally:
        file.discard()


def place_of(path: Path, error: type[Exception] = OutputError) -> Path:
    """Check that a file can be made or replaced, and return its path behind a symbolic link.

    Raises:
        OutputError: It cannot, or ``error``.
    """
    try:
        place = path.resolve() if path.is_symlink() else path
        if place.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        if place.exists() and not place.is_file():
            # a rename would replace a device or a pipe by a file
            raise error(f"{path}: is there and no file; give the path of one")
        if not place.parent.is_dir():
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT))
        if not all(os.access(each, os.W_OK) for each in (place.parent, place) if each.exists()):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    except OSError as problem:
        if isinstance(problem, error):
            raise
        raise _unwritable(path, problem, error) from problem
    return place


def _unwritable(path: Path, problem: OSError, error: type[Exception]) -> Exception:
    return error(f"{path}: cannot be written: {problem.strerror or problem}")


def _remove(part: Path, owner: int) -> None:
    # a forked child must not remove the file of its parent
    if os.getpid() == owner:
        part.unlink(missing_ok=True)
