"""What writers of all formats have in common: where an unfinished dataset is, and when it becomes whole.

A dataset has the name ``NAME.part…`` until it is complete. A process that is killed leaves that, and it opens with all
episodes of the last `Writer.commit`.
"""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol

from tightloop.datasets.reading import Episode
from tightloop.errors import ArgumentError, OutputError


class Writer(Protocol):
    """Writes episodes into a dataset."""

    def add(self, episode: Episode) -> None:
        """Add an episode. It is in the dataset for others to read from the next `commit` on."""
        ...

    def commit(self) -> None:
        """Let the unfinished dataset have all episodes so far, whatever becomes of this process."""
        ...

    def close(self) -> None:
        """Finish the dataset, and give it its name."""
        ...

    def discard(self) -> None:
        """End without a dataset, and remove the unfinished one."""
        ...


def part_of(out: Path) -> Path:
    """Return where a dataset is until it is complete."""
    return out.with_name(f"{out.stem}.part{out.suffix}")


def check_place(out: Path) -> None:
    """Check that there can be a new dataset.

    Raises:
        ArgumentError: There is something of that name, or no folder for it.
        OutputError: The folder cannot be written.
    """
    if out.exists() or out.is_symlink():
        raise ArgumentError(f"export: out is {out}, which is there already; remove it, or give another name")
    if not out.parent.is_dir():
        raise ArgumentError(f"export: out is {out}, and there is no folder {out.parent}; make it first")
    part = part_of(out)
    if part.exists():
        raise ArgumentError(
            f"export: {part} is there already, of an export that was killed or still runs; remove it, or give another "
            "name"
        )
    if not os.access(out.parent, os.W_OK):
        raise OutputError(f"{out}: cannot be written: {os.strerror(errno.EACCES)}")


@contextmanager
def writing(out: Path) -> Iterator[None]:
    """Name the dataset in errors of the block.

    Raises:
        OutputError: It cannot be written.
    """
    try:
        yield
    except OSError as problem:
        if isinstance(problem, OutputError):
            raise
        raise OutputError(f"{out}: cannot be written: {problem.strerror or problem}") from problem


def put_in_place(out: Path) -> None:
    """Give a complete dataset its name."""
    part_of(out).rename(out)


def remove(path: Path) -> None:
    """Remove a file or a folder that may be gone."""
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
