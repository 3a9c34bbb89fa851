"""A file that is changed in place, and of which a whole version always has a name.

HDF5 changes its tables in place, and Rerun opens no file that ends within a message. So a process that is killed
meanwhile leaves a damaged file. Here changes stay in memory until a commit. There are two copies of the file: a commit
brings the older one up to date, and only then gives it the name, by a rename. So the name is always that of a copy that
nobody changes.
"""

from __future__ import annotations

import io
import secrets
from collections.abc import Iterator
from pathlib import Path

from tightloop.datasets.writers import remove

# Changes are kept in pages of so many bytes.
_PAGE = 1 << 16


class TwinFile:
    """A binary file for reading and writing that appears as of the last `commit`.

    Args:
        path: Where the file appears with the first commit.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        key = secrets.token_hex(8)
        self._names = [path.with_name(f".tightloop-{key}-{copy}{path.suffix}") for copy in range(3)]
        self._copies = [io.FileIO(name, "x+") for name in self._names[:2]]
        #: Index of the copy of the last commit.
        self._whole = 0
        # pages since the last commit, and those of the last commit, which the other copy lacks
        self._changed: dict[int, bytearray] = {}
        self._behind: dict[int, bytearray] = {}
        self._size = self._place = 0

    def seek(self, offset: int, whence: int = io.SEEK_SET, /) -> int:
        """Move to a place, and return it."""
        start = {io.SEEK_SET: 0, io.SEEK_CUR: self._place, io.SEEK_END: self._size}[whence]
        self._place = start + offset
        return self._place

    def tell(self) -> int:
        """Return the place."""
        return self._place

    def truncate(self, size: int | None = None, /) -> int:
        """Set the size, and return it."""
        place, size = self._place, self._place if size is None else size
        # what is cut off must not come back if the file grows again
        self._place = size
        self.write(bytes(max(self._size - size, 0)))
        self._place, self._size = place, size
        return size

    def read(self, size: int = -1, /) -> bytes:
        """Return bytes from the place on, all without a size."""
        buffer = bytearray(max(self._size - self._place, 0) if size < 0 else size)
        return bytes(buffer[: self.readinto(memoryview(buffer))])

    def readinto(self, buffer: memoryview, /) -> int:
        """Read into a buffer, and return the number of bytes."""
        view = memoryview(buffer).cast("B")
        count = max(min(len(view), self._size - self._place), 0)
        done = 0
        for page, first, length in _pages(self._place, count):
            view[done : done + length] = self._page(page)[first : first + length]
            done += length
        self._place += count
        return count

    def write(self, data: bytes | memoryview, /) -> int:
        """Write bytes, which appear in the file with the next commit."""
        view = memoryview(data).cast("B")
        done = 0
        for page, first, length in _pages(self._place, len(view)):
            if page not in self._changed:
                self._changed[page] = self._page(page)
            self._changed[page][first : first + length] = view[done : done + length]
            done += length
        self._place += done
        self._size = max(self._size, self._place)
        return done

    def flush(self) -> None:
        """Do nothing: `commit` writes."""

    def commit(self) -> None:
        """Let the file appear as it is now."""
        other = 1 - self._whole
        for page, data in (self._behind | self._changed).items():
            _write_all(self._copies[other], data, page * _PAGE)
        self._copies[other].truncate(self._size)
        # a rename onto a file of the same contents, from a name that is needed no more
        self._names[2].hardlink_to(self._names[other])
        self._names[2].replace(self._path)
        self._whole = other
        self._behind, self._changed = self._changed, {}

    def close(self) -> None:
        """Release both copies; the file stays as of the last commit."""
        while self._copies:
            self._copies.pop().close()
        for name in self._names:
            remove(name)

    def _page(self, page: int) -> bytearray:
        """Return a page, as long as pages are."""
        if page in self._changed:
            return self._changed[page]
        data, file = bytearray(_PAGE), self._copies[self._whole]
        file.seek(page * _PAGE)
        view = memoryview(data)
        while view and (count := file.readinto(view)):
            view = view[count:]
        return data


def _pages(place: int, count: int) -> Iterator[tuple[int, int, int]]:
    """Return the pages of a range of bytes, each with its first byte and the number of bytes there."""
    end = place + count
    while place < end:
        page, first = divmod(place, _PAGE)
        length = min(_PAGE - first, end - place)
        yield page, first, length
        place += length


def _write_all(file: io.FileIO, data: bytearray, place: int) -> None:
    file.seek(place)
    view = memoryview(data)
    while view:
        view = view[file.write(view) :]
