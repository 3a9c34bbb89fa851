"""Whatever call of the system fails, the old file or the new one is whole, and the error names the file."""

from __future__ import annotations

import errno
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from failpoints import REMOVALS, Failpoint, Run, failpoints, run

OLD = b"what was there"
WHOLE = """
import pathlib, tightloop.whole_files
with tightloop.whole_files.whole_file(pathlib.Path({out!r})) as part:
    part.write_text("new")
"""


def each_call(command: list[str], out: Path, there: bytes | None) -> Iterator[tuple[Failpoint, Run]]:
    """Run a command that writes a file once for each of its calls and each error, and check what stays."""
    folder = out.parent

    def begin() -> None:
        for left in folder.iterdir():
            left.unlink()
        if there is not None:
            out.write_bytes(there)

    begin()
    whole = run(command, [folder])
    assert whole.code == 0 and whole.calls, whole.err
    for failpoint in failpoints(whole.calls):
        begin()
        done = run(command, [folder], failpoint)
        said = f"{failpoint}: {done.err}"
        assert done.failed is not None, said
        assert "panicked" not in done.err, said
        # POSIX: a call that a signal interrupts has done nothing, and is made again
        assert done.code == 0 or failpoint.error != errno.EINTR, said
        assert done.code == 0 or str(out) in done.err.splitlines()[-1], said
        if done.failed.name not in REMOVALS:
            assert {each.name for each in folder.iterdir()} <= {out.name}, said
        if done.code == 0:
            assert out.read_bytes() != there, said
        yield failpoint, done


@pytest.mark.parametrize("there", [None, OLD])
def test_a_file_is_the_old_one_or_the_new_one(tmp_path: Path, there: bytes | None) -> None:
    out = tmp_path / "kept" / "file"
    out.parent.mkdir()
    for failpoint, done in each_call([sys.executable, "-c", WHOLE.format(out=str(out))], out, there):
        if done.code != 0:
            assert (out.read_bytes() if out.exists() else None) == there, failpoint
