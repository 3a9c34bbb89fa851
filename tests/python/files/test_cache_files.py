"""Files in the user's cache: written once, and removed when others were used more recently."""

from __future__ import annotations

import multiprocessing
import os
import time
from pathlib import Path

import numpy as np
import pytest

import tightloop as tl
from tightloop.files import cache as cache_files


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setitem(cache_files.LIMITS, "scenes", 10_000)
    return tmp_path / "tightloop/scenes"


def keep(name: str, size: int = 1000) -> Path:
    return cache_files.keep("scenes", name, lambda part: part.write_bytes(bytes(size)))


def test_the_files_used_longest_ago_go_first(folder: Path):
    for number in range(10):
        path = keep(f"file{number}")
        os.utime(path, ns=(number, number))
    # it was used just now, and nothing is written
    assert keep("file0").stat().st_mtime_ns > 10
    keep("new")
    names = {path.name for path in folder.iterdir()}
    assert {"file0", "new", "file9"} <= names and names.isdisjoint({"file1", "file2"})
    assert sum(path.stat().st_size for path in folder.iterdir()) <= 10_000
    # what is larger than the limit alone is there for who asked for it
    assert keep("huge", 20_000).stat().st_size == 20_000
    assert [path.name for path in folder.iterdir()] == ["huge"]
    keep("small")
    assert [path.name for path in folder.iterdir()] == ["small"]


def test_what_killed_processes_left_goes_and_what_others_write_stays(folder: Path):
    for number in range(10):
        keep(f"file{number}")
    for name, age in ((".tightloop-1.toml", 7200), (".tightloop-2.toml", 60)):
        (folder / name).write_bytes(bytes(5000))
        then = time.time() - age
        os.utime(folder / name, (then, then))
    keep("new")
    assert {path.name for path in folder.iterdir() if path.name.startswith(".")} == {".tightloop-2.toml"}


def fill(process: int) -> None:
    for number in range(200):
        assert keep(f"file{(number * 7 + process) % 40}").name


def test_processes_that_share_a_folder_do_not_disturb_each_other(folder: Path):
    forks = multiprocessing.get_context("fork")
    filling = [forks.Process(target=fill, args=(process,)) for process in range(4)]
    for process in filling:
        process.start()
    for process in filling:
        process.join(60)
    assert [process.exitcode for process in filling] == [0] * 4
    keep("last")
    sizes = [path.stat().st_size for path in folder.iterdir()]
    assert sum(sizes) <= 10_000 and set(sizes) == {1000}


def test_height_fields_in_the_cache_are_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setitem(cache_files.LIMITS, "height_fields", 100_000)
    for number in range(30):
        tl.Scene().add_hfield(np.full((50, 50), float(number)), size=(1, 1), base=1)
    assert 0 < sum(path.stat().st_size for path in (tmp_path / "tightloop/height_fields").iterdir()) <= 100_000
