"""The README's code runs as it stands."""

from __future__ import annotations

from typing import Any

import numpy as np

import tightloop as tl
from conftest import REPOSITORY


def test_the_api_in_twenty_lines_runs(monkeypatch, tmp_path, unique):
    text = (REPOSITORY / "README.md").read_text()
    _, _, code = text.partition("```python\n")
    code, _, _ = code.partition("```")
    assert len(code.splitlines()) <= 26  # with its blank lines
    name = unique()
    # what the reader has at hand: the repository as working directory, arrays, and a daemon to attach to
    code = code.replace("examples/assets", f"{REPOSITORY}/examples/assets").replace("NAME", name)
    given: dict[str, Any] = {name: np.zeros((4096, 9)) for name in ("q", "tau")} | {
        name: np.zeros(9) for name in ("qd", "qdd", "goal")
    }
    monkeypatch.chdir(tmp_path)
    scene = tl.Scene()
    scene.add_urdf(REPOSITORY / "examples/assets/fr3/fr3_franka_hand.urdf")
    with tl.launch(scene, worlds=1, name=name):
        exec(compile(code, "README.md", "exec"), given)
        assert given["kept"].joint_q.shape == (4096, 9)
        assert given["sim"].worlds == 1
        given["sim"].close()
