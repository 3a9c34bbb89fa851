"""Codes for terminals in files and names are shown, and never reach a terminal as they are."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import tightloop as tl
from tightloop.checks import advice

#: Sets the title, clears, recolours by a C1 code, and turns the direction of text.
CODES = "\x1b]0;owned\x07\x1b[2J\x9b31m\u202e"
SCENE = """
dt = 0.002
substeps = 1
[[{table}]]
name = "a{codes}b"
"""
ESCAPED = CODES.replace("\x1b", "\\u001b").replace("\x07", "\\u0007")


def said(*line: str | Path) -> str:
    done = subprocess.run(
        [sys.executable, "-m", "tightloop", *map(str, line)], capture_output=True, timeout=120, check=False
    )
    return (done.stdout + done.stderr).decode()


def has_codes(text: str) -> bool:
    return any(code in text for code in ("\x1b", "\x07", "\x9b", "\u202e", "\r"))


@pytest.mark.parametrize("table", ["robot", "body", "shape", "material"])
def test_names_in_scene_files_reach_no_terminal_as_codes(tmp_path: Path, table: str) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(SCENE.format(table=table, codes=ESCAPED), encoding="utf-8")
    for command in ("inspect", "serve", "bench"):
        text = said(command, path)
        assert text and not has_codes(text), repr(text)
    with pytest.raises(tl.SceneError) as caught:
        tl.Scene.load(path)
    assert not has_codes(str(caught.value))


def test_quotes_of_broken_files_reach_no_terminal_as_codes(tmp_path: Path) -> None:
    scene, robot = tmp_path / "scene.toml", tmp_path / "robot.urdf"
    scene.write_text(f"dt = {CODES}\n", encoding="utf-8")
    robot.write_text(f'<robot name="r"><link name="{CODES[10:]}"/><joint name="j"/></robot>', encoding="utf-8")
    for command in ("inspect", "serve", "bench", "replay"):
        for path in (scene, robot):
            text = said(command, path)
            assert text and not has_codes(text), repr(text)


def test_a_link_whose_name_has_codes_is_listed_without_them(tmp_path: Path) -> None:
    robot = tmp_path / "robot.urdf"
    inertia = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    robot.write_text(f'<robot name="r"><link name="hand&#x202e;dnah">{inertia}</link></robot>', encoding="utf-8")
    for options in ((), ("--json",)):
        text = said("inspect", robot, *options)
        assert "hand" in text and not has_codes(text), repr(text)


def test_errors_and_warnings_show_codes() -> None:
    for kind in (tl.SceneError, tl.DaemonLost, tl.CommandRefused, tl.UnknownName):
        assert str(kind(f"a{CODES}\tb\nc")) == "a\\u001b]0;owned\\u0007\\u001b[2J\\u009b31m\\u202e\tb\nc"
    with pytest.warns(tl.TightloopWarning, match=r"a\\u001b\[2J") as caught:
        advice.warn("a\x1b[2J")
    assert not has_codes(str(caught[0].message))
