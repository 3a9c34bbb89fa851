"""``tightloop top``: what a daemon does now, as text, as JSON and for Prometheus."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator

import numpy as np
import pytest

import tightloop as tl

TOP = [sys.executable, "-m", "tightloop", "top"]
FRAMES = 10


@pytest.fixture
def sim() -> Iterator[tl.Sim]:
    """Eight boxes on the ground after 10 frames; the one of world 3 has no finite position."""
    scene = tl.Scene(dt=0.002, substeps=2)
    scene.add_ground()
    scene.add_body(name="box", pos=(0.0, 0.0, 0.099), mass=1.0)
    scene.add_box(body="box", half_extents=(0.1, 0.1, 0.1))
    fields = ("joint_q", "contact_count")
    with tl.launch(scene, worlds=8, device="cpu", threads=1, fields=fields, on_nan="freeze") as sim:
        force = np.zeros((8, 6))
        force[3] = np.nan
        sim.step(joint_f=force)
        for _ in range(FRAMES - 1):
            sim.step(joint_f=np.zeros(6))
        yield sim


def said(*arguments: str, code: int = 0) -> str:
    """What the command prints."""
    done = subprocess.run([*TOP, *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == code, done.stderr
    return done.stdout if code == 0 else done.stderr


def test_a_look_as_text(sim: tl.Sim) -> None:
    text = said(sim.name, "--count", "2", "--interval", "0.1")
    assert text.count(f"daemon    {sim.name}, pid {sim.pid}") == 2
    assert "faulted   1 of the 8 worlds" in text
    assert f"frames    {FRAMES}, 0 missed, 0 late, 0 skipped" in text
    assert re.search(r"contacts  [1-9]\.\d a world", text)


def test_a_look_as_json(sim: tl.Sim) -> None:
    look = json.loads(said(sim.name, "--count", "1", "--json"))
    assert (look["worlds"], look["seen_worlds"], look["faulted_worlds"]) == (8, 8, 1)
    assert look["controllers"] != []
    # resting boxes have four contacts, and one world has what it had at the start
    assert 3.0 < look["contacts_per_world"] <= 8.0
    assert look["memory_bytes"] > look["shared_bytes"] > 0
    [timing] = look["timing_us"]
    assert timing["frames"] == FRAMES
    assert timing["busy"]["worst"] >= timing["busy"]["p50"] > 0.0


def test_speed_is_that_of_the_interval(sim: tl.Sim) -> None:
    with subprocess.Popen(
        [*TOP, sim.name, "--count", "1", "--json", "--interval", "2"], stdout=subprocess.PIPE, text=True
    ) as top:
        frames = 0
        while top.poll() is None:
            sim.step()
            frames += 1
        assert top.stdout is not None
        look = json.loads(top.stdout.read())
    assert 0 < look["frames_per_s"] <= frames / 2.0
    assert look["steps_per_s"] == pytest.approx(look["frames_per_s"] * 8 * 2)


def test_prometheus_scrapes_loopback(sim: tl.Sim) -> None:
    command = [*TOP, sim.name, "--metrics", "127.0.0.1:0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as top:
        assert top.stdout is not None
        try:
            address = top.stdout.readline().strip()
            text = urllib.request.urlopen(address, timeout=20).read().decode()
            with pytest.raises(urllib.error.HTTPError, match="404"):
                urllib.request.urlopen(address.replace("metrics", "secrets"), timeout=20)
        finally:
            top.kill()
    values = dict(line.rsplit(" ", 1) for line in text.splitlines() if not line.startswith("#"))
    assert values[f'tightloop_frames_total{{daemon="{sim.name}",group="0"}}'] == str(FRAMES)
    assert values[f'tightloop_faulted_worlds{{daemon="{sim.name}"}}'] == "1"
    known = {line.split()[2] for line in text.splitlines() if line.startswith("# TYPE")}
    assert {name.split("{")[0] for name in values} == known


@pytest.mark.parametrize(
    ("arguments", "cure"),
    [
        (("--interval", "0"), "0.1 to 3600"),
        (("--metrics", "0.0.0.0:0"), "127.0.0.1"),
        (("--metrics", "here"), "127.0.0.1:9400"),
    ],
)
def test_wrong_arguments_are_named(sim: tl.Sim, arguments: tuple[str, ...], cure: str) -> None:
    assert cure in said(sim.name, *arguments, code=2)


def test_a_daemon_that_is_not_there_is_named() -> None:
    assert "nobody-here" in said("nobody-here", code=1)
