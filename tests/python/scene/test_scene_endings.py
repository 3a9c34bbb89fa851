"""A scene is saved as TOML: the ending of another format is refused with the right one."""

from __future__ import annotations

import pytest

import tightloop as tl


@pytest.mark.parametrize("ending", [".json", ".yaml", ".xml", ".urdf", ".usd", ".npz", ".JSON"])
def test_a_scene_is_not_saved_under_the_ending_of_another_format(ending, tmp_path):
    scene = tl.Scene()
    scene.add_cube()
    with pytest.raises(
        tl.SceneError, match=rf"save: path ends with {ending}, and scene files are TOML; give 'x\.toml'"
    ):
        scene.save(tmp_path / f"x{ending}")
    assert not list(tmp_path.iterdir())
    scene.save(tmp_path / "x.toml")
    scene.save(tmp_path / "x")
