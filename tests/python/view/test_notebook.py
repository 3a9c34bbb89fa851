"""How objects show themselves in a notebook."""

from __future__ import annotations

import gc
import re
import weakref
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
            html = getattr(shown, "_repr_html_")()  # noqa: B009  (the class of frames in Rust has it from Python)
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


def _with_a_mesh(folder) -> tl.Scene:
    """A pendulum of a mesh file, which is unlinked by the tests to show that nobody reads it."""
    folder.joinpath("bob.obj").write_text(
        "v 0 0 0\nv 0.3 0 0\nv 0 0.2 0\nv 0 0 0.4\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    )
    link = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    mesh = '<visual><geometry><mesh filename="bob.obj"/></geometry></visual>'
    joint = '<joint name="hinge" type="continuous"><parent link="base"/><child link="bob"/><axis xyz="0 1 0"/></joint>'
    urdf = folder / "pendulum.urdf"
    urdf.write_text(f'<robot name="p"><link name="base"/><link name="bob">{link}{mesh}</link>{joint}</robot>')
    scene = tl.Scene()
    scene.add_urdf(urdf, name="p")
    return scene


def test_a_second_picture_reads_no_file_and_has_a_camera_of_its_own(tmp_path):
    pytest.importorskip("PIL")
    with tl.launch(_with_a_mesh(tmp_path), worlds=4) as sim:
        fresh = [np.asarray(sim.picture(worlds=count, size=(320, 200))) for count in (1, 4)]
    with tl.launch(_with_a_mesh(tmp_path), worlds=4) as sim:
        sim.picture(worlds=4, camera="top")
        (tmp_path / "bob.obj").unlink()
        later = [np.asarray(sim.picture(worlds=count, size=(320, 200))) for count in (1, 4)]
    assert all(np.array_equal(ours, theirs) for ours, theirs in zip(later, fresh, strict=True))
    # the bob is in them, and not the lines that stand for a lost mesh
    assert np.ptp(fresh[0]) > 100


def test_kept_meshes_are_bounded_and_go_with_their_simulation(tmp_path):
    pytest.importorskip("PIL")
    from tightloop.view import kept_picture

    scene, meshes, sims = _with_a_mesh(tmp_path), [], []
    for _ in range(kept_picture._KEPT_MAX + 1):
        sims.append(tl.launch(scene, worlds=1))
        sims[-1].picture(size=(64, 48))
        meshes.append(weakref.ref(kept_picture.kept_picture(sims[-1])._parts[0].mesh))
    gc.collect()
    # the one drawn longest ago has lost its meshes, and loads them again
    assert [mesh() is None for mesh in meshes] == [True] + [False] * kept_picture._KEPT_MAX
    assert sims[0].picture(size=(64, 48)).size == (64, 48)
    for sim in sims[:-1]:
        sim.close()
        del sim
    del sims[-1]
    gc.collect()
    assert all(mesh() is None for mesh in meshes) and not kept_picture._kept


def test_a_viewer_is_embedded_in_a_cell(scene):
    pytest.importorskip("viser")
    with tl.launch(scene, worlds=1) as sim:
        viewer = sim.view(port=8700)
        assert f'<iframe src="{viewer.url}"' in viewer._repr_html_()
        viewer.close()
