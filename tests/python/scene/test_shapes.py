"""Shapes of a scene as its daemon names them, and what it notes and refuses about them."""

from __future__ import annotations

import pytest

import tightloop as tl
from conftest import URDF


def test_a_daemon_names_every_shape_and_static_ones_first(unique):
    scene = tl.Scene(contacts_max=50, rows_max=150)
    arm = scene.add_urdf(URDF, name="arm", mu=0.8)
    cube = scene.add_cube()
    pad = scene.add_sphere(radius=0.01, body=arm.link("fr3_hand"), name="pad")
    table, ground = scene.add_table(), scene.add_ground(z=-0.5)
    scene.filter_contacts(arm.link("fr3_link0"), table)
    names = [f"arm/{shape}" for shape in arm.shape_names]
    hand = max(place for place, name in enumerate(names) if name.startswith("arm/fr3_hand/"))
    names.insert(hand + 1, pad.full_name)
    names = [table.full_name, ground.full_name, *names, scene.shapes["box"].full_name]
    assert scene.shapes["box"].body == cube.name
    with tl.launch(scene, worlds=1, name=unique()) as sim:
        assert sim.shape_names == names
        with tl.attach(sim.name) as second:
            assert second.shape_names == names


def test_a_daemon_notes_what_was_done_to_a_mesh(tmp_path):
    flat = tmp_path / "flat.obj"
    flat.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n")
    scene = tl.Scene()
    arm = scene.add_urdf(URDF, name="arm")
    scene.add_mesh(flat, name="sheet")
    scene.add_mesh(flat, body=arm.link("fr3_hand"))
    with tl.launch(scene, worlds=1) as sim:
        notes = [note for note in sim.info["notes"] if "is flat" in note]
    assert [note.split(":")[0] for note in notes] == ["sheet", "arm"]
    assert "link `fr3_hand`" in notes[1]


def test_two_shapes_of_a_link_with_one_name_are_refused(tmp_path):
    text = URDF.read_text().replace("<collision>", '<collision name="pad">', 1)
    file = tmp_path / "arm.urdf"
    file.write_text(text)
    scene = tl.Scene()
    arm = scene.add_urdf(file, name="arm")
    link = arm.shape_names[0].split("/")[0]
    scene.add_sphere(radius=0.1, body=arm.link(link), name="pad")
    with pytest.raises(tl.TightloopError, match=f"robot `arm`: link `{link}`: two shapes are named `pad`"):
        tl.launch(scene, worlds=1)
