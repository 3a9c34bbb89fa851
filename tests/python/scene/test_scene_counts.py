"""Scenes that no machine could hold are refused by their counts, before they are built."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import pytest

TIGHTLOOP = [sys.executable, "-m", "tightloop"]
# From the command to its words, the start of the interpreter included [s]; building takes minutes
REFUSED_MAX = 15.0

HEAD = "dt = 0.002\nsubsteps = 1\n"
BODY = '[[body]]\nname = "b{k}"\nmass = 1.0\n[[shape]]\nname = "s{k}"\ntype = "sphere"\nradius = 0.1\nbody = "b{k}"\n'


def bodies(count: int) -> str:
    return HEAD + "".join(BODY.format(k=k) for k in range(count))


def planes(count: int) -> str:
    return HEAD + '[[shape]]\ntype = "plane"\n' * count


def pairs(count: int) -> str:
    """Spheres of one body, each of which may touch as many static ones."""
    sphere = '[[shape]]\nname = "{name}{k}"\ntype = "sphere"\nradius = 0.1\n'
    own = "".join(sphere.format(name="o", k=k) + 'body = "b"\n' for k in range(count))
    static = "".join(sphere.format(name="t", k=k) for k in range(count))
    return f'{HEAD}[[body]]\nname = "b"\nmass = 1.0\n{own}{static}'


@pytest.mark.parametrize(
    ("text", "worlds", "words"),
    [
        (bodies(50_000), 1, ["300000 dofs", "2048", "split it"]),
        (planes(1_000_000), 1, ["number of shapes is 1000000", "10000", "height field"]),
        (pairs(1100), 1, ["pairs of shapes that may touch is 1210000", "1048576", "group"]),
        (bodies(341), 4_000_000_000, ["4000000000 worlds of 2046 dofs", "bytes of memory are free", "fewer worlds"]),
    ],
    ids=["bodies", "shapes", "pairs", "worlds"],
)
def test_a_scene_beyond_the_machine_is_refused_in_seconds_with_its_count_and_a_cure(
    tmp_path: Path, unique, text, worlds, words
):
    scene = tmp_path / "scene.toml"
    scene.write_text(text)
    command = [*TIGHTLOOP, "serve", scene, "--worlds", str(worlds), "--device", "cpu", "--name", unique()]
    began = time.monotonic()
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    took = time.monotonic() - began
    assert done.returncode == 1
    for word in words:
        assert word in done.stderr
    assert took < REFUSED_MAX
