"""Files of visuals: where their triangles lie, which colours they have, and what is said of broken ones."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path

import numpy as np
import pytest
import sample_meshes as looks
from PIL import Image
from sample_meshes import CORNERS, SIZE

from tightloop import _core, optional_imports
from tightloop.errors import MissingLibrary, SceneError
from tightloop.view import dependencies
from tightloop.view.meshes import visual as visual_mesh
from tightloop.view.meshes.visual import VisualMesh

RED, GREEN = [255, 0, 0, 255], [0, 255, 0, 255]
MTL = "newmtl red\nKd 1 0 0\nnewmtl green\nKd 0 1 0\nd 0.5\n"


def extent(surface: VisualMesh) -> np.ndarray:
    return np.array([surface.vertices.min(axis=0), surface.vertices.max(axis=0)])


def texture(path: Path) -> Path:
    """Two by two texels: red and green above, blue and white below."""
    image = Image.fromarray(np.array([[RED[:3], GREEN[:3]], [[0, 0, 255], [255] * 3]], np.uint8))
    image.save(path)
    return path


def test_a_box_is_a_box_in_every_format(tmp_path):
    turned = np.array([[0, -SIZE[2], 0], [SIZE[0], 0, SIZE[1]]])
    for path, expected in (
        (looks.stl(tmp_path / "box.stl"), [[0, 0, 0], SIZE]),
        (looks.obj(tmp_path / "box.obj", mtl=MTL), [[0, 0, 0], SIZE]),
        (looks.collada(tmp_path / "box.dae"), [[0, 0, 0], SIZE]),
        (looks.glb(tmp_path / "box.glb"), turned),
    ):
        found = visual_mesh.read(path)
        assert len(found.vertices) == 8 and len(found.faces) == 12, path
        np.testing.assert_allclose(extent(found), expected, atol=1e-6)
        assert looks.volume(found.vertices, found.faces) == pytest.approx(6.0), f"{path}: inside out"


@pytest.mark.parametrize(
    ("asset", "transform"),
    [
        ('<unit meter="0.01"/><up_axis>Z_UP</up_axis>', ""),
        ('<unit meter="0.001"/><up_axis>Y_UP</up_axis>', ""),
        ('<unit meter="1"/><up_axis>X_UP</up_axis>', ""),
        ("", "<translate>1 2 3</translate><rotate>0 0 1 90</rotate><scale>1 2 1</scale>"),
        ('<unit meter="0.1"/><up_axis>Z_UP</up_axis>', "<matrix>1 0 0 5  0 0 -1 6  0 1 0 7  0 0 0 1</matrix>"),
        ('<unit meter="1"/><up_axis>Z_UP</up_axis>', "<scale>-1 1 1</scale>"),
    ],
)
def test_collada_lies_where_physics_has_it(tmp_path, asset, transform):
    path = looks.collada(tmp_path / "box.dae", asset=asset, transform=transform)
    told = json.loads(_core.read_mesh(str(path), (1.0, 1.0, 1.0), 64, False))
    found = visual_mesh.read(path)
    # float32 of what the other reads in float64
    np.testing.assert_allclose(extent(found), told["extent"], rtol=1e-6, atol=1e-6)
    assert looks.volume(found.vertices, found.faces) > 0
    assert any("turned" in note for note in found.notes) == ("Z_UP" not in asset)


def test_a_skin_lies_where_physics_has_it(tmp_path):
    turned = "0 -1 0 5  1 0 0 6  0 0 2 7  0 0 0 1"
    path = looks.collada(tmp_path / "box.dae", skin=turned, transform="<translate>1 2 3</translate>")
    told = json.loads(_core.read_mesh(str(path), (1.0, 1.0, 1.0), 64, False))
    found = visual_mesh.read(path)
    np.testing.assert_allclose(extent(found), told["extent"], rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(extent(found), [[4, 8, 10], [6, 9, 16]], atol=1e-6)
    assert (found.colors == RED).all()


def test_gltf_lies_where_physics_has_it(tmp_path):
    nodes = [
        {"mesh": 0, "translation": [1, 2, 3], "scale": [1, 1, -1]},
        {"mesh": 0, "rotation": [0, 0, 0.6, 0.8]},
    ]
    path = looks.glb(tmp_path / "two.glb", nodes=nodes)
    told = json.loads(_core.read_mesh(str(path), (1.0, 1.0, 1.0), 64, False))
    found = visual_mesh.read(path)
    np.testing.assert_allclose(extent(found), told["extent"], rtol=1e-6, atol=1e-6)
    assert looks.volume(found.vertices, found.faces) == pytest.approx(12.0)


def test_colours_of_materials(tmp_path):
    obj = visual_mesh.read(looks.obj(tmp_path / "box.obj", mtl=MTL))
    assert obj.painted.all()
    # of a face by what it spans: the material of the lower and upper sides is red
    level = np.ptp(obj.vertices[obj.faces][:, :, 2], axis=1) == 0
    assert level.sum() == 4
    assert (obj.colors[level] == RED).all()
    assert (obj.colors[~level] == [0, 255, 0, 128]).all()
    dae = visual_mesh.read(looks.collada(tmp_path / "box.dae", diffuse="<color>0 0.2 1 1</color>"))
    assert dae.painted.all() and (dae.colors == [0, 51, 255, 255]).all()
    # glTF's numbers are proportional to light; half the light is 188 of 255 on a screen
    glb = visual_mesh.read(
        looks.glb(tmp_path / "box.glb", material={"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0, 1, 0.2]}})
    )
    assert glb.painted.all() and (glb.colors == [188, 0, 255, 51]).all()


@pytest.mark.parametrize(
    ("more", "opacity"),
    [
        ("<transparent><color>1 1 1 0.4</color></transparent><transparency><float>0.5</float></transparency>", 51),
        (
            '<transparent opaque="RGB_ZERO"><color>0.6 0.6 0.6 1</color></transparent>'
            "<transparency><float>1</float></transparency>",
            102,
        ),
        # meant to be opaque by exporters that count the other way
        ("<transparent><color>0 0 0 1</color></transparent><transparency><float>0</float></transparency>", 255),
    ],
)
def test_opacity_of_collada(tmp_path, more, opacity):
    found = visual_mesh.read(looks.collada(tmp_path / "box.dae", more=more))
    assert (found.colors == [255, 0, 0, opacity]).all()


def test_textures_are_looked_up_where_a_face_lies(tmp_path):
    skin = texture(tmp_path / "skin.png")
    obj = visual_mesh.read(
        looks.obj(tmp_path / "box.obj", mtl="newmtl a\nKd 1 1 1\nmap_Kd skin.png\n", used=("a", "a"))
    )
    level = np.ptp(obj.vertices[obj.faces][:, :, 2], axis=1) == 0
    # (0.25, 0.25) is bottom left, (0.75, 0.75) top right
    assert (obj.colors[level] == [0, 0, 255, 255]).all() and (obj.colors[~level] == GREEN).all()
    dae = visual_mesh.read(
        looks.collada(
            tmp_path / "box.dae",
            diffuse='<texture texture="sampler" texcoord="UV"/>',
            images='<library_images><image id="i"><init_from>skin.png</init_from></image></library_images>',
        )
    )
    assert dae.painted.all() and (dae.colors == [0, 0, 255, 255]).all()
    # glTF counts from the top: (0.25, 0.25) is top left
    glb = visual_mesh.read(
        looks.glb(
            tmp_path / "box.glb",
            material={"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}},
            image=skin.read_bytes(),
        )
    )
    assert glb.painted.all() and (glb.colors == RED).all()


def test_what_has_no_material_is_left_unpainted(tmp_path):
    for path in (
        looks.stl(tmp_path / "box.stl"),
        looks.obj(tmp_path / "bare.obj", mtl=None, used=("", "")),
        looks.obj(tmp_path / "lost.obj", mtl=None),
        looks.collada(tmp_path / "box.dae", bind=False),
        looks.glb(tmp_path / "box.glb"),
    ):
        assert not visual_mesh.read(path).painted.any(), path
    # a material for some faces only
    half = visual_mesh.read(looks.obj(tmp_path / "half.obj", mtl="newmtl red\nKd 1 0 0\n"))
    assert half.painted.sum() == 4
    filled = half.filled((1, 2, 3, 4))
    assert (filled[half.painted] == RED).all() and (filled[~half.painted] == [1, 2, 3, 4]).all()


def test_broken_materials_leave_the_shape(tmp_path):
    # an effect whose image is not in the file: the effect is dropped with its material
    found = visual_mesh.read(
        looks.collada(
            tmp_path / "box.dae", diffuse='<texture texture="sampler" texcoord="UV"/>', images="<library_images/>"
        )
    )
    assert len(found.faces) == 12 and not found.painted.any()
    assert any("materials that are broken" in note for note in found.notes)
    # an image whose file is not there
    images = '<library_images><image id="i"><init_from>skin.png</init_from></image></library_images>'
    found = visual_mesh.read(
        looks.collada(tmp_path / "box.dae", diffuse='<texture texture="sampler" texcoord="UV"/>', images=images)
    )
    assert len(found.faces) == 12 and not found.painted.any()


def test_vertices_that_no_face_has_take_no_room(tmp_path):
    path = looks.obj(tmp_path / "box.obj", mtl=None)
    path.write_text("v 100 100 100\n" + path.read_text().replace("f ", "g ") + "f 2 3 4\nf 3 5 4\n")
    found = visual_mesh.read(path)
    assert len(found.vertices) == 4 and found.faces.max() == 3
    np.testing.assert_allclose(extent(found), [[0, 0, 0], [1, 2, 0]])


def test_a_mirror_keeps_the_outside_outside(tmp_path):
    found = visual_mesh.read(looks.stl(tmp_path / "box.stl")).scaled([1, -2, 0.5])
    np.testing.assert_allclose(extent(found), [[0, -4, 0], [1, 0, 1.5]], atol=1e-6)
    assert looks.volume(found.vertices, found.faces) == pytest.approx(6.0)


@pytest.mark.parametrize("ending", ["dae", "obj", "stl", "glb", "gltf"])
def test_broken_files_report_it(tmp_path, ending):
    path = tmp_path / f"broken.{ending}"
    for content in (b"", b"\0" * 200, b"{", b"<COLLADA/>", b"solid x\nendsolid x\n", b"v 0 0 0\nf 1 2 3\n"):
        path.write_bytes(content)
        with pytest.raises(SceneError):
            visual_mesh.read(path)
    path.unlink()
    with pytest.raises(SceneError, match="cannot be read"):
        visual_mesh.read(path)


def test_cut_files_report_it_or_are_read(tmp_path):
    for path in (
        looks.stl(tmp_path / "box.stl"),
        looks.obj(tmp_path / "box.obj", mtl=MTL),
        looks.collada(tmp_path / "box.dae"),
        looks.glb(tmp_path / "box.glb"),
    ):
        content = path.read_bytes()
        for share in np.linspace(0.02, 0.98, 25):
            path.write_bytes(content[: int(share * len(content))])
            try:
                found = visual_mesh.read(path)
            except SceneError:
                continue
            assert np.isfinite(found.vertices).all() and found.faces.max() < len(found.vertices)
            assert extent(found)[1].max() <= max(SIZE)


def test_hostile_and_strange_files_are_refused(tmp_path):
    dae = looks.collada(tmp_path / "box.dae")
    dae.write_text(dae.read_text().replace("<COLLADA", '<!DOCTYPE x [<!ENTITY a "b">]>\n<COLLADA', 1))
    with pytest.raises(SceneError, match="DTD"):
        visual_mesh.read(dae)
    (tmp_path / "box.blend").write_bytes(b"")
    with pytest.raises(SceneError, match="blend"):
        visual_mesh.read(tmp_path / "box.blend")
    with pytest.raises(SceneError, match="unit"):
        visual_mesh.read(looks.collada(dae, asset='<unit meter="-1"/>'))
    stl = looks.stl(tmp_path / "nan.stl")
    content = bytearray(stl.read_bytes())
    content[84 + 12 : 84 + 16] = np.float32("nan").tobytes()
    stl.write_bytes(content)
    with pytest.raises(SceneError, match="finite"):
        visual_mesh.read(stl)
    for corners in (CORNERS[:3] * 0, CORNERS[:3]):
        text = "".join(f"v {x} {y} {z}\n" for x, y, z in corners)
        (tmp_path / "thin.obj").write_text(text + "f 1 1 2\n")
        with pytest.raises(SceneError, match="area"):
            visual_mesh.read(tmp_path / "thin.obj")


@pytest.mark.parametrize("image", ["pipe", "/dev/zero"])
def test_an_image_that_is_no_file_is_noted_and_not_waited_for(tmp_path, image):
    os.mkfifo(tmp_path / "pipe")
    mesh = visual_mesh.read(looks.obj(tmp_path / "box.obj", mtl=f"newmtl red\nmap_Kd {image}\n"))
    (note,) = (note for note in mesh.notes if "image" in note)
    assert image in note and "it is not a file" in note


def test_a_missing_library_is_named(monkeypatch, tmp_path):
    with pytest.raises(MissingLibrary, match=re.escape(dependencies.INSTALL)):
        dependencies.check("no_such_library_of_the_viewer")
    plain, textured = looks.stl(tmp_path / "box.stl"), looks.obj(tmp_path / "box.obj", mtl="newmtl red\nmap_Kd a.png\n")
    missing = ModuleNotFoundError(name="PIL")
    monkeypatch.setattr(optional_imports, "import_module", lambda _: (_ for _ in ()).throw(missing))
    assert len(visual_mesh.read(plain).faces) == 12
    with pytest.raises(MissingLibrary, match="PIL"):
        visual_mesh.read(textured)
