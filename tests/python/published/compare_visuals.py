"""Visuals of published robots: every file is read, and lies where the reader of collision meshes has it.

`make published` runs this, since the wheels are too large for `make test`.
"""

from __future__ import annotations

import json

import numpy as np
import pytest
from compare_with_mujoco import File, files

from tightloop import _core
from tightloop.errors import SceneError
from tightloop.view.meshes import visual as visual_mesh


def visuals(file: File) -> list[dict]:
    """The visuals of a robot's file, as Rust tells of them."""
    folders = json.dumps([str(folder) for folder in file.package_dirs])
    robot = f"urdf = {json.dumps(str(file.path))}\npackage_dirs = {folders}"
    text, _ = _core.parts(f'dt = 0.001\nsubsteps = 1\n[[robot]]\nname = "r"\n{robot}\n', "/")
    return [part for part in json.loads(text)["parts"] if part["kind"] == "visual"]


def test_visual_files_are_read_and_lie_where_physics_has_them(request: pytest.FixtureRequest) -> None:
    seen, painted = set(), 0
    for file in files(request.config):
        try:
            told = visuals(file)
        except SceneError:
            continue  # agree.py says which robots do not load, and why
        for part in told:
            path = part.get("file")
            if path is None or path in seen:
                continue
            seen.add(path)
            mesh = visual_mesh.read(path)
            painted += bool(mesh.painted.any())
            physics = json.loads(_core.read_mesh(path, (1.0, 1.0, 1.0), 64, False))
            extent = np.array(physics["extent"])
            # one reader keeps float32, and what lies at one place to it is one vertex
            off = np.abs([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)] - extent).max()
            assert off <= 1e-5 * np.abs(extent).max(), f"{path}: {off} m"
    assert len(seen) > 100 and painted > 50, "the wheels have hundreds of visuals, and most of them have colours"
