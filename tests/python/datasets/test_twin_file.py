"""The file that appears as of its last commit, beside a plain array of bytes."""

from __future__ import annotations

import os
import random
from pathlib import Path

import pytest

from tightloop.datasets.twin_file import TwinFile


@pytest.mark.parametrize("seed", range(3))
def test_a_file_is_as_of_its_last_commit_after_any_writes(tmp_path: Path, seed: int) -> None:
    path = tmp_path / "file.bin"
    generator = random.Random(seed)
    twin, expected, committed = TwinFile(path), bytearray(), None
    for _ in range(150):
        place = generator.randint(0, len(expected) + 100_000)
        match generator.randrange(8):
            case 0:
                twin.commit()
                committed = bytes(expected)
            case 1:
                twin.truncate(place)
                expected = expected[:place] + bytes(max(place - len(expected), 0))
            case 2:
                place = min(place, len(expected))
                count = generator.randint(0, 200_000)
                assert twin.seek(place) == place
                assert twin.read(count) == expected[place : place + count]
            case _:
                data = generator.randbytes(generator.choice([1, 100, 70_000, 300_000]))
                twin.seek(place)
                assert twin.write(data) == len(data) and twin.tell() == place + len(data)
                expected += bytes(max(place - len(expected), 0))
                expected[place : place + len(data)] = data
        assert twin.seek(0, os.SEEK_END) == len(expected)
        assert path.exists() == (committed is not None)
        if committed is not None:
            assert path.read_bytes() == committed
    twin.commit()
    twin.close()
    twin.close()
    assert [each.name for each in tmp_path.iterdir()] == ["file.bin"]
    assert path.read_bytes() == expected


def test_a_reader_that_opened_the_file_keeps_what_it_opened(tmp_path: Path) -> None:
    twin = TwinFile(tmp_path / "file.bin")
    twin.write(b"first")
    twin.commit()
    with (tmp_path / "file.bin").open("rb") as reader:
        twin.seek(0)
        twin.write(b"other")
        twin.commit()
        assert reader.read() == b"first"
    assert (tmp_path / "file.bin").read_bytes() == b"other"
    twin.close()
