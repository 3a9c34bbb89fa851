"""``examples/newton_lesson.py``: Newton's lesson in no more lines, with MuJoCo's motions, and as the site shows it."""

from __future__ import annotations

import ast
import sys

import numpy as np
import pytest

from code_blocks import blocks
from conftest import REPOSITORY

EXAMPLE = REPOSITORY / "examples/newton_lesson.py"
PAGE = REPOSITORY / "docs/pages/start/lesson.md"
THEIRS = 206  # lines of the lesson's last listing


@pytest.fixture
def example(monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLE.parent))
    yield __import__("newton_lesson")
    sys.modules.pop("newton_lesson")


def reference(name: str) -> np.ndarray:
    """Positions of MuJoCo C in float64 after each frame, ``(180, 9)``."""
    return np.loadtxt(REPOSITORY / f"tests/data/mujoco_{name}.csv", delimiter=",")[1:, 1:10]


def test_it_has_no_more_lines_than_the_lesson():
    assert len(EXAMPLE.read_text().splitlines()) <= THEIRS


def test_targets_are_followed_as_in_mujoco(example):
    # what rounding MuJoCo's own state to single precision does, with room for the table that nothing touches
    assert np.abs(example.target_demo(3, view=False) - reference("target")).max() < 2e-6


def test_torques_move_the_arm_as_in_mujoco_until_it_touches_the_table(example):
    # in frame 14 the fingers hit the table, whose contacts are those of other collision shapes
    moved, free = example.torque_demo(3, view=False), reference("torque_free")
    assert np.abs(moved - free)[:13].max() < 2e-6
    assert np.abs(moved[:, 2]).max() > 2.0


def test_the_site_shows_the_same_code():
    text = EXAMPLE.read_text()
    shown = [block.text for block in blocks("lesson.md", PAGE.read_text()) if block.language == "python"]
    tree, page = ast.parse(text), ast.parse("\n".join(shown))

    def of_name(module: ast.Module, name: str) -> str:
        return next(
            ast.unparse(node) for node in module.body if isinstance(node, ast.FunctionDef) and node.name == name
        )

    def loops(module: ast.AST) -> list[list[str]]:
        found = [node for node in ast.walk(module) if isinstance(node, ast.For) and "FRAMES" in ast.unparse(node.iter)]
        return [[ast.unparse(line) for line in loop.body if "pace" not in ast.unparse(line)] for loop in found]

    assert of_name(page, "build_franka_scene") == of_name(tree, "build_franka_scene")
    assert len(loops(page)) == 2 and loops(page) == loops(tree)


def test_calls_of_both_are_side_by_side():
    text = PAGE.read_text()
    ours = ["tl.Scene", "add_urdf", "add_table", "add_cube", "tl.launch", "joint_f=", "joint_target_q=", "sim.view"]
    theirs = [
        "ModelBuilder",
        "finalize",
        "SolverMuJoCo",
        "eval_fk",
        "joint_f.assign",
        "joint_target_q.assign",
        "ViewerViser",
    ]
    assert all(f"`{call}" in text or call in text for call in ours + theirs)
