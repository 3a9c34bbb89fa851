"""How objects show themselves in a notebook."""

from __future__ import annotations

import re
from html import escape

import numpy as np
import pytest

import tightloop as tl
from conftest import START, URDF


@pytest.fixture
def scene() -> tl.Scene:
    scene = tl.Scene()
    arm = scene.add_urdf(URDF, name="arm")
    arm.joint_q = START
    scene.add_cube(pos=(0.5, 0.0, 0.025))
    scene.add_ground()
    return scene


def test_scenes_and_robots_show_a_table_and_a_picture(scene):
    pytest.importorskip("PIL")
    for shown, named in ((scene, "cube"), (scene.robots["arm"], "fr3_joint1")):
        html = shown._repr_html_()
        assert named in html and "<table>" in html
        assert len(re.findall(r"data:image/png;base64,[A-Za-z0-9+/=]{2000,}", html)) == 1


def test_names_are_escaped(scene, monkeypatch):
    monkeypatch.setattr(type(scene.robots["arm"]), "joint_target_mode", ["<b>x</b>"] * 9)
    html = scene.robots["arm"]._repr_html_()
    assert "<b>x</b>" not in html and "&lt;b&gt;x&lt;/b&gt;" in html


def test_simulations_and_frames_show_tables(scene):
    with tl.launch(scene, worlds=3) as sim:
        frame = sim.forward()
        assert escape(sim.device) in sim._repr_html_() and "arm, cube" in sim._repr_html_()
        for shown in (frame, frame.copy()):
            html = shown._repr_html_()
            assert "joint_q" in html and "(3, 16)" in html and "float32" in html


def test_a_picture_of_worlds(scene, tmp_path):
    pytest.importorskip("PIL")
    with tl.launch(scene, worlds=4) as sim:
        picture = sim.picture(worlds=4, camera="front", size=(320, 200))
        assert picture.size == (320, 200) and np.ptp(np.asarray(picture)) > 100
        picture.save(tmp_path / "worlds.png")
        assert picture._repr_png_()
        one = sim.picture(worlds=[2], frame=sim.forward().copy())
        assert one.size == (640, 480)
        with pytest.raises(tl.ArgumentError, match="world 9"):
            sim.picture(worlds=[9])


def test_a_viewer_is_embedded_in_a_cell(scene):
    pytest.importorskip("viser")
    with tl.launch(scene, worlds=1) as sim:
        viewer = sim.view(port=8700)
        assert f'<iframe src="{viewer.url}"' in viewer._repr_html_()
        viewer.close()
