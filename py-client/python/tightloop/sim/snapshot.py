"""Snapshots: all worlds of a simulation as bytes, from `Sim.snapshot` and for `Sim.restore`.

A snapshot is a header of 40 bytes, then a record per world; `sim-core/engine/src/snapshot.rs` defines the layout.
"""

from __future__ import annotations

import contextlib
import errno
import os
import struct
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop import system
from tightloop.checks import arguments as checks
from tightloop.checks.signatures import checked_calls
from tightloop.errors import SnapshotError
from tightloop.files import named as named_files
from tightloop.whole_files import whole_file

# magic, version, checksum, model hash, worlds, values per world, bytes per value; little endian
_HEAD = struct.Struct("<8sIIQQII")
_MAGIC, _VERSION = b"tlsnap\r\n", 1
# offset of the checksum; offset from which it covers the bytes; bytes of a world's counters, which precede its values
_CHECKSUM, _COVERED, _COUNTERS = 12, 16, 28
# largest file that is read: a million worlds of the largest robots have less
_BYTES_MAX = 1 << 36


@checked_calls
class Snapshot:
    """All worlds of a simulation at one instant, for `Sim.restore`; immutable.

    Made by `Sim.snapshot`, `Snapshot.load` and `Snapshot.from_bytes`.

    Attributes:
        worlds: Number of worlds.
        precision: ``"f32"`` or ``"f64"``.
        model_hash: Hash of the scene's model. A simulation with the same ``sim.info["model_hash"]`` can restore it.
    """

    def __init__(self, data: bytes, origin: str) -> None:
        self._data = data
        self.model_hash, self.worlds, real = _check(data, origin)
        self.precision = f"f{8 * real}"

    @classmethod
    def from_bytes(cls, data: bytes | bytearray | memoryview) -> Snapshot:
        """Make a snapshot from the bytes of `to_bytes`.

        Args:
            data: The bytes.

        Raises:
            SnapshotError: The bytes are no snapshot, or of another version, truncated or damaged.
        """
        if not isinstance(data, bytes | bytearray | memoryview):
            raise SnapshotError(f"snapshot: data is {type(data).__name__}; give the bytes of one")
        return cls(bytes(data), "snapshot")

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Snapshot:
        """Read a snapshot from a file that `save` wrote.

        Args:
            path: The file.

        Raises:
            SnapshotError: The file cannot be read, is larger than 64 GiB, is no snapshot, or is of another version,
                truncated or damaged.
        """
        file = checks.path("snapshot: path", path, error=SnapshotError)
        try:
            data = _read(file)
        except OSError as problem:
            raise SnapshotError(f"{file}: cannot be read: {problem.strerror}; give a file that `save` wrote") from None
        return cls(data, str(file))

    def _check_world(self, world: int) -> None:
        """Refuse a world that this snapshot does not have.

        Raises:
            SnapshotError: There is no such world.
        """
        if world >= self.worlds:
            raise SnapshotError(f"restore: from_world is {world}; the snapshot has worlds 0 to {self.worlds - 1}")

    @property
    def numbers(self) -> NDArray[Any]:
        """State, commands and parameters of each world, ``(worlds, values)``, read-only, in the daemon's layout."""
        real = int(self.precision[1:]) // 8
        return np.ascontiguousarray(self._records()[:, _COUNTERS:]).view(f"<f{real}")

    def with_numbers(self, numbers: NDArray[Any]) -> Snapshot:
        """Return a snapshot with other `numbers`, of the same shape and dtype."""
        records = self._records().copy()
        records[:, _COUNTERS:] = np.ascontiguousarray(numbers, self.numbers.dtype).view(np.uint8)
        return self._with(records)

    def with_worlds(self, other: Snapshot, worlds: NDArray[np.bool_]) -> Snapshot:
        """Return a snapshot whose worlds of a mask are those of another snapshot of the same simulation."""
        records = self._records().copy()
        records[worlds] = other._records()[worlds]
        return self._with(records)

    def of_worlds(self, worlds: NDArray[np.integer[Any]] | Sequence[int]) -> Snapshot:
        """Return a snapshot of the worlds with these indices, in this order; one may occur several times."""
        return self._with(self._records()[np.asarray(worlds, np.intp)])

    def in_double(self) -> Snapshot:
        """Return the snapshot for the same simulation in double precision: the same values, converted exactly."""
        if self.precision == "f64":
            return self
        counters, numbers = self._records()[:, :_COUNTERS], self.numbers.astype("<f8").view(np.uint8)
        return self._with(np.concatenate((counters, numbers), axis=1), precision="f64")

    def with_model(self, model_hash: int) -> Snapshot:
        """Return the snapshot for a simulation of the same scene that has another hash, because of other substeps."""
        return self._with(self._records(), model_hash=model_hash)

    def _records(self) -> NDArray[np.uint8]:
        return np.frombuffer(self._data, np.uint8, offset=_HEAD.size).reshape(self.worlds, -1)

    def _with(
        self, records: NDArray[np.uint8], *, model_hash: int | None = None, precision: str | None = None
    ) -> Snapshot:
        made = Snapshot.__new__(Snapshot)
        made.model_hash = self.model_hash if model_hash is None else model_hash
        made.worlds, made.precision = len(records), precision or self.precision
        real = int(made.precision[1:]) // 8
        numbers = (records.shape[1] - _COUNTERS) // real
        head = bytearray(_HEAD.pack(_MAGIC, _VERSION, 0, made.model_hash, made.worlds, numbers, real))
        data = head + records.tobytes()
        struct.pack_into("<I", data, _CHECKSUM, zlib.crc32(memoryview(data)[_COVERED:]))
        made._data = bytes(data)
        return made

    def to_bytes(self) -> bytes:
        """Return the snapshot as bytes, for `from_bytes`."""
        return self._data

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the snapshot into a file. An existing file is replaced as a whole or, after an error, not at all.

        Args:
            path: The file.

        Raises:
            SnapshotError: The file cannot be written; the message has the reason.
        """
        file = checks.path("snapshot: path", path, error=SnapshotError)
        with whole_file(file, SnapshotError) as part:
            part.write_bytes(self._data)

    def __repr__(self) -> str:
        return f"Snapshot(worlds={self.worlds}, precision={self.precision!r}, model_hash={self.model_hash:#018x})"


@contextmanager
def transfer_file(daemon: int, data: bytes = b"") -> Iterator[str]:
    """Provide a file between client and daemon, in shared memory if possible.

    `tightloop.system.exchange_file` says how long it lives.

    Args:
        daemon: Process id of the daemon.
        data: What the daemon reads there.

    Yields:
        The path by which both open it.

    Raises:
        SnapshotError: The file cannot be made.
    """
    with contextlib.ExitStack() as opened:
        try:
            path = opened.enter_context(system.exchange_file(daemon, data))
        except OSError as problem:
            raise _no_room(problem) from None
        try:
            yield path
        except SnapshotError as problem:
            # the daemon names the file, which tells a user nothing
            _, found, reason = str(problem).partition(f"{path}: cannot be written: ")
            if not found:
                raise
            raise _no_room(reason) from None


def _no_room(reason: object) -> SnapshotError:
    # what a daemon says is text; there may be too many in the system, too
    if os.strerror(errno.EMFILE) in str(reason):
        return SnapshotError(
            f"snapshot: no file for its way to the daemon: {reason}; allow this process and the daemon more open "
            "files (`ulimit -n 65536`)"
        )
    return SnapshotError(f"snapshot: no room on its way to the daemon: {reason}; {system.cure_of_full_exchange()}")


def _read(file: Path) -> bytes:
    """Return the bytes of a regular file that begins as a snapshot does, or the beginning of another one."""
    with named_files.opened("a snapshot", file, SnapshotError, limit=_BYTES_MAX) as source:
        head = source.read(_HEAD.size)
        return head + source.read() if head.startswith(_MAGIC) else head


def _check(data: bytes, origin: str) -> tuple[int, int, int]:
    """Check a snapshot; return its model hash, its number of worlds and the bytes per value."""
    if not data.startswith(_MAGIC):
        raise SnapshotError(f"{origin}: this is no snapshot; give what was saved as one")
    if len(data) < _HEAD.size:
        raise SnapshotError(f"{origin}: cut short: {len(data)} bytes of {_HEAD.size}; copy it again, whole")
    _, version, checksum, model, worlds, numbers, real = _HEAD.unpack_from(data)
    if version != _VERSION:
        reads = f"this release reads format {_VERSION}; take it again with this release"
        raise SnapshotError(f"{origin}: of format {version}, {reads}")
    expected = _HEAD.size + worlds * (_COUNTERS + numbers * real)
    if len(data) < expected:
        raise SnapshotError(f"{origin}: cut short: {len(data)} bytes of {expected}; copy it again, whole")
    if len(data) > expected or zlib.crc32(memoryview(data)[_COVERED:]) != checksum:
        damaged = "damaged: its checksum does not match"
        raise SnapshotError(f"{origin}: {damaged}; copy it again, or take another")
    return model, worlds, real
