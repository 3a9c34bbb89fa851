"""What MuJoCo models look like: the geoms and sites that MuJoCo's viewer shows, where they are, in their colours."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from PIL import Image
from safetensors.numpy import load_file, save_file

import tightloop as tl
from tightloop import optional_imports
from tightloop.mujoco import textures
from tightloop.view import Camera, Picture
from tightloop.view.framing import Framing
from tightloop.view.meshes import grid, paint
from tightloop.view.parts import Parts, parts
from tightloop.view.poses import place

# Roundings of float32 in numbers of some metres
ATOL = 1e-5
# A wedge with a notch: its hull has other faces
NOTCHED = """<mesh name="notched" vertex="0 0 0 .4 0 0 .4 0 .3 .2 0 .1 0 0 .3 0 .2 0 .4 .2 0 .4 .2 .3 .2 .2 .1 0 .2 .3"
face="0 1 3 1 2 3 0 3 4 5 8 6 6 8 7 5 9 8 0 5 6 0 6 1 1 6 7 1 7 2 2 7 8 2 8 3 3 8 9 3 9 4 4 9 5 4 5 0"/>"""
MODEL = f"""<mujoco model="looks"><asset>{NOTCHED}
<texture name="squares" type="2d" builtin="checker" rgb1="1 0 0" rgb2="0 0 .5" width="64" height="64"/>
<texture name="box" type="cube" builtin="flat" rgb1=".2 .4 .6" rgb2=".2 .4 .6" width="8" height="48"/>
<texture name="sky" type="skybox" builtin="gradient" rgb1="1 1 1" rgb2="0 0 0" width="8" height="48"/>
<material name="blue" rgba="0 0 1 1"/>
<material name="squares" texture="squares" rgba="1 1 1 1"/>
<material name="box" texture="box" rgba="1 .5 1 .5"/>
</asset><worldbody>
<geom name="floor" type="plane" size="0 0 .1" pos="0 0 -1" material="squares"/>
<geom name="table" type="plane" size="1 .5 .1" rgba="0 1 0 1"/>
<body name="dressed" pos="0 0 1" euler="20 30 40"><freejoint/>
  <geom name="hull" type="box" size=".1 .2 .3" group="3"/>
  <geom name="plain" type="sphere" size=".1" contype="0" conaffinity="0"/>
  <geom name="shown" type="ellipsoid" size=".1 .2 .3" group="2" contype="0" conaffinity="0" material="blue"/>
  <geom name="own" type="capsule" size=".1 .2" group="1" contype="0" conaffinity="0" material="blue" rgba="1 0 0 1"/>
  <geom name="clear" type="sphere" size=".3" contype="0" conaffinity="0" rgba="1 0 0 0"/></body>
<body name="bare" pos="1 0 1"><freejoint/><geom name="box" type="box" size=".1 .2 .3" group="4" material="box"/></body>
<body name="mesh" pos="2 0 1"><freejoint/>
  <geom name="notched" type="mesh" mesh="notched" contype="0" conaffinity="0" pos=".1 .2 .3" euler="10 20 30"/>
  <geom name="again" type="mesh" mesh="notched" contype="0" conaffinity="0" pos="0 0 -.3"/>
  <geom name="rod" type="cylinder" size=".1 .2" group="3"/></body>
</worldbody></mujoco>"""
SITES = """<mujoco model="sites"><asset>
<texture name="squares" type="2d" builtin="checker" rgb1="1 0 0" rgb2="0 0 .5" width="64" height="64"/>
<material name="blue" rgba="0 0 1 1"/><material name="squares" texture="squares" rgba=".5 1 1 .75"/>
</asset><worldbody>
<site name="still" type="box" size=".1 .2 .3" pos="1 0 2" euler="10 20 30"/>
<site name="hidden" group="3"/><site name="clear" rgba="1 0 0 0"/>
<body name="mocap" mocap="true" pos="0 1 1"><geom size=".05" contype="0" conaffinity="0"/>
  <site name="fromto" type="capsule" size=".1" fromto="0 0 0 0 .6 .8"/></body>
<body name="moving" pos="0 0 2" euler="20 30 40"><freejoint/>
  <geom name="box" type="box" size=".1 .1 .1"/>
  <site name="ellipsoid" type="ellipsoid" size=".1 .2 .3" material="blue" group="2" pos=".1 .2 .3"/>
  <site name="cylinder" type="cylinder" size=".1 .2" material="blue" rgba="1 0 0 .5" group="1" euler="0 50 0"/>
  <site name="box" rgba="1 0 1 1" size=".2"/>
  <site name="squares" material="squares"/><site/></body>
</worldbody></mujoco>"""


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def parts_of(scene: tl.Scene, folder: Path | str = "/") -> Parts:
    return parts(scene.to_toml(), folder, tl.Dynamics(scene).body_names)


def seen(xml: str, kind: str = "visual") -> dict:
    """Parts of one kind by the names of their geoms."""
    return {part.name.rpartition("/")[2]: part for part in parts_of(tl.Scene.from_mujoco(spec(xml))).of(kind)}


def spec(xml: str) -> mujoco.MjSpec:
    return mujoco.MjSpec.from_string(xml)


def sites_of(found: Parts) -> list:
    return [part for part in found if part.is_site]


def viewed(model: mujoco.MjModel) -> dict:
    """What MuJoCo's viewer draws of sites at first, at the start, by their names."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    drawn = mujoco.MjvScene(model, maxgeom=100)
    options, grip, camera = mujoco.MjvOption(), mujoco.MjvPerturb(), mujoco.MjvCamera()
    mujoco.mjv_updateScene(model, data, options, grip, camera, mujoco.mjtCatBit.mjCAT_ALL.value, drawn)
    shapes = [shape for shape in drawn.geoms[: drawn.ngeom] if shape.objtype == mujoco.mjtObj.mjOBJ_SITE]
    return {model.site(shape.objid).name or f"site{shape.objid}": shape for shape in shapes}


def start(model: mujoco.MjModel) -> np.ndarray:
    """`joint_q` of free joints at the start, shape ``(1, coords)``."""
    pos, turn = np.split(model.qpos0.reshape(-1, 7), [3], axis=1)
    return np.concatenate([pos, np.roll(turn, -1, axis=1)], axis=1).reshape(1, -1)


def color(part) -> list[int]:
    """The colour of a part that has only one."""
    (only,) = np.unique(part.mesh.colors, axis=0)
    return only.tolist()


def changed(scene: tl.Scene, change, path: Path) -> tl.Scene:
    """The scene with other arrays in the file of its only model."""
    (model,) = scene.models.values()
    arrays = load_file(model.file)
    change(arrays)
    save_file(arrays, path)
    text = scene.to_toml().replace(str(model.file), str(path))
    (path.with_suffix(".toml")).write_text(text)
    return tl.Scene.load(path.with_suffix(".toml"))


def test_geoms_are_seen_that_mujocos_viewer_shows():
    # of `dressed` no group above 2 and nothing clear, of `bare` all, since it has nothing else
    shown = {"floor", "table", "plain", "shown", "own", "box", "notched", "again"}
    assert set(seen(MODEL)) == shown
    assert set(seen(MODEL, "collision")) == {"floor", "table", "hull", "box", "rod"}


def test_colours_are_mujocos():
    found = seen(MODEL)
    assert color(found["plain"]) == [128, 128, 128, 255], "MuJoCo's grey"
    assert color(found["shown"]) == [0, 0, 255, 255], "the material's"
    assert color(found["own"]) == [255, 0, 0, 255], "its own before the material's"
    assert color(found["box"]) == [51, 51, 153, 128], "the material's times the texture's mean"
    floor = np.unique(found["floor"].mesh.colors, axis=0)
    np.testing.assert_allclose(floor.mean(axis=0), [127.5, 0, 63.75, 255], atol=2)


def test_a_texture_from_a_file_has_the_mean_that_a_robots_has(tmp_path):
    rng = np.random.default_rng(3)
    for mode, shape in (("RGB", (6, 5, 3)), ("L", (6, 5)), ("RGBA", (6, 5, 4))):
        file = tmp_path / f"{mode}.png"
        Image.fromarray(rng.integers(0, 256, shape, np.uint8), mode).save(file)
        channels = {"RGB": 3, "L": 1, "RGBA": 4}[mode]
        xml = f"""<mujoco><asset><texture name="t" type="2d" file="{file}" nchannel="{channels}"/>
        <material name="none"/><material name="m" texture="t"/></asset><worldbody/></mujoco>"""
        model = mujoco.MjModel.from_xml_string(xml)
        none, mean = textures.means(model)
        assert none.tolist() == [1, 1, 1]
        # the other mean is rounded
        np.testing.assert_allclose(255 * mean, paint.file_mean(file)[:3], atol=0.5 + 1e-9)


def test_surfaces_are_where_mujoco_has_them():
    model = spec(MODEL).compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    scene = tl.Scene.from_mujoco(model)
    dynamics = tl.Dynamics(scene)
    (body_q,) = dynamics.forward_kinematics(start(model))
    found = seen(MODEL)

    def corners(name):
        part = found[name]
        own = place(part.pose, part.mesh.vertices)
        return own if part.body < 0 else place(body_q[part.body], own)

    def placed(name, points):
        geom = model.geom(name).id
        return points @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]

    faces = {tuple(face) for face in model.mesh_face.tolist()}
    for name in ("notched", "again"):
        np.testing.assert_allclose(corners(name), placed(name, model.mesh_vert), atol=ATOL)
        assert {tuple(face) for face in found[name].mesh.faces.tolist()} == faces, "all faces, not those of the hull"
    assert found["notched"].mesh is found["again"].mesh
    geom = model.geom("shown").id
    local = (corners("shown") - data.geom_xpos[geom]) @ data.geom_xmat[geom].reshape(3, 3)
    np.testing.assert_allclose(np.linalg.norm(local / [0.1, 0.2, 0.3], axis=1), 1, atol=1e-4)
    assert found["shown"].shape == "ellipsoid"
    np.testing.assert_allclose(np.abs(corners("table")).max(axis=0), [1, 0.5, 0], atol=ATOL)
    np.testing.assert_allclose(corners("floor")[:, 2], -1)
    assert found["floor"].mesh.vertices.max() == 5, "a plane without end is a sheet"


def test_the_world_of_a_model_stands_where_the_scene_puts_it():
    scene = tl.Scene(dt=0.002, gravity=(0, 0, -9.81))
    scene.solver(iterations=100, ls_iterations=50, tolerance=1e-8, cone="pyramidal", impratio=1)
    scene.add_mujoco(spec(MODEL), pos=(1, 2, 3), quat=(0, 0, 1, 0))
    (table,) = (part for part in parts_of(scene).of("visual") if part.name.endswith("/table"))
    assert table.body == -1
    np.testing.assert_allclose(table.pose, [1, 2, 3, 0, 0, 1, 0], atol=1e-12)


def test_looks_change_no_physics(tmp_path):
    scene = tl.Scene.from_mujoco(spec(MODEL))

    def paint_it(arrays):
        arrays["geom_group"][:] = 1
        arrays["mat_rgba"][:] = 0.3
        arrays["mat_texture_mean"][:] = 0.7

    other = changed(scene, paint_it, tmp_path / "other.safetensors")
    assert tl.Dynamics(other).model_hash == tl.Dynamics(scene).model_hash
    names, others = ({part.name for part in parts_of(one).of("visual")} for one in (scene, other))
    assert others - names == {"looks/dressed/hull", "looks/mesh/rod"}


def test_looks_of_sites_change_no_physics(tmp_path):
    scene = tl.Scene.from_mujoco(spec(SITES))

    def hide_most(arrays):
        arrays["site_rgba"][:] = 0.3
        arrays["site_group"][1:] = 4
        arrays["site_matid"][:] = -1

    other = changed(scene, hide_most, tmp_path / "other.safetensors")
    assert tl.Dynamics(other).model_hash == tl.Dynamics(scene).model_hash
    assert [part.name for part in sites_of(parts_of(other))] == ["sites/world/still"]


@pytest.mark.parametrize("array", ["geom_group", "mat_texture_mean"])
def test_an_older_file_shows_what_touches(tmp_path, array):
    scene = tl.Scene.from_mujoco(spec(MODEL))
    older = parts_of(changed(scene, lambda arrays: arrays.pop(array), tmp_path / "older.safetensors"))
    touching = {part.name for part in older.of("collision")}
    assert {part.name for part in older.of("visual")} == touching
    assert len(older.notes) == 1 and "save the scene again" in older.notes[0]


def test_an_older_file_shows_no_sites(tmp_path):
    scene = tl.Scene.from_mujoco(spec(SITES))

    def age(arrays):
        for array in ("site_group", "site_matid", "site_rgba"):
            del arrays[array]

    older, newer = parts_of(changed(scene, age, tmp_path / "older.safetensors")), parts_of(scene)
    assert not sites_of(older) and not older.notes
    assert [part.name for part in older] == [part.name for part in newer if not part.is_site]


@pytest.mark.parametrize("xml", [MODEL, SITES])
def test_a_saved_scene_needs_no_mujoco_for_its_looks(tmp_path, monkeypatch, xml):
    scene = tl.Scene.from_mujoco(spec(xml))
    scene.save(tmp_path / "scene.toml")
    monkeypatch.setattr(optional_imports, "import_module", _missing)
    loaded = tl.Scene.load(tmp_path / "scene.toml")
    assert [part.name for part in parts_of(loaded)] == [part.name for part in parts_of(scene)]


def _missing(_: str) -> None:
    raise ModuleNotFoundError(name="mujoco")


def test_a_shape_of_the_scene_on_a_link_is_seen_with_its_geoms():
    scene = tl.Scene.from_mujoco(spec(MODEL))
    extra = '[[shape]]\ntype = "sphere"\nradius = 0.2\nbody = "looks/dressed"\nname = "extra"\n'
    found = parts(f"{scene.to_toml()}\n{extra}", "/", tl.Dynamics(scene).body_names)
    names = {part.name for part in found.of("visual")}
    assert {"looks/dressed/extra", "looks/dressed/plain"} <= names and "looks/dressed/hull" not in names


def test_sites_are_seen_as_mujocos_viewer_shows_them():
    model = spec(SITES).compile()
    scene = tl.Scene.from_mujoco(model)
    (body_q,) = tl.Dynamics(scene).forward_kinematics(start(model))
    found = {part.name.rpartition("/")[2]: part for part in sites_of(parts_of(scene))}
    wanted = viewed(model)
    assert found.keys() == wanted.keys() and len(wanted) == 7
    kinds = {"sphere": "SPHERE", "capsule": "CAPSULE", "ellipsoid": "ELLIPSOID", "cylinder": "CYLINDER", "box": "BOX"}
    for name, shape in wanted.items():
        part = found[name]
        assert part.kind == "visual" and mujoco.mjtGeom(shape.type).name == f"mjGEOM_{kinds[part.shape]}"
        own = place(part.pose, part.mesh.vertices)
        local = ((own if part.body < 0 else place(body_q[part.body], own)) - shape.pos) @ shape.mat
        half = shape.size + np.array([0, 0, shape.size[0] if part.shape == "capsule" else 0])
        # round surfaces have corners on them
        np.testing.assert_allclose(np.abs(local).max(axis=0), half, rtol=0.05, atol=ATOL)
        rgba = shape.rgba * [0.5, 0, 0.25, 1] if name == "squares" else shape.rgba
        np.testing.assert_allclose(color(part), 255 * rgba, atol=1)


def test_sites_that_are_meshes_are_where_mujocos_viewer_has_them():
    xml = f"""<mujoco model="m"><asset>{NOTCHED}</asset><worldbody><body pos="0 0 1" euler="10 20 30"><freejoint/>
    <geom size=".1"/><site name="mesh" type="mesh" mesh="notched" pos=".1 .2 .3" euler="30 20 10"/></body></worldbody>
    </mujoco>"""
    if not hasattr(spec(MODEL).compile(), "site_dataid"):
        pytest.skip("this version of MuJoCo has no sites that are meshes")
    model = spec(xml).compile()
    scene = tl.Scene.from_mujoco(model)
    (body_q,) = tl.Dynamics(scene).forward_kinematics(start(model))
    (part,) = sites_of(parts_of(scene))
    shape = viewed(model)["mesh"]
    corners = place(body_q[part.body], place(part.pose, part.mesh.vertices))
    np.testing.assert_allclose(corners, model.mesh_vert @ shape.mat.T + shape.pos, atol=ATOL)


def test_sites_touch_nothing_and_take_no_geoms_place():
    assert set(seen(SITES, "collision")) == {"box"}
    # hidden geoms of a body without others, geoms that are all clear, and joints of a model without geoms
    for inside, kept in (
        ('<geom name="hull" size=".1" group="3"/>', {"m/b/hull"}),
        ('<geom name="clear" size=".1" rgba="0 0 0 0"/>', {"m/b/clear"}),
        ('<inertial pos="0 0 -.5" mass="1" diaginertia=".1 .1 .1"/>', {"m/b/bone1"}),
    ):
        xml = f"""<mujoco model="m"><worldbody><body name="b"><joint axis="0 1 0"/>{inside}<site name="s"/></body>
        </worldbody></mujoco>"""
        names = {part.name for part in parts_of(tl.Scene.from_mujoco(spec(xml))).of("visual")}
        assert kept | {"m/b/s"} <= names, inside


def test_no_camera_is_fitted_to_sites():
    far = SITES.replace('pos="1 0 2"', 'pos="90 0 2"').replace('pos=".1 .2 .3"', 'pos="0 40 0"')
    none = re.sub(r"<site[^>]*/>", "", SITES)
    found, without = (parts_of(tl.Scene.from_mujoco(spec(xml))) for xml in (far, none))
    assert sites_of(found) and not sites_of(without)
    body_q = tl.Dynamics(tl.Scene.from_mujoco(spec(SITES))).forward_kinematics(start(spec(SITES).compile()))
    framings = [Framing(own.of("visual"), own.subject) for own in (found, without)]
    assert framings[0].link == framings[1].link
    points = [framing.points(body_q, np.zeros((1, 3))) for framing in framings]
    np.testing.assert_array_equal(points[0], points[1])
    np.testing.assert_array_equal(grid.extent(found, body_q[0]), grid.extent(without, body_q[0]))


def test_a_picture_shows_sites_and_their_bodies_carry_them():
    model = spec(SITES).compile()
    scene = tl.Scene.from_mujoco(model)
    coords = start(model)
    view = Camera((6, -6, 4), (1, 0, 2))

    def purple(kind):
        shown = SimpleNamespace(body_q=tl.Dynamics(scene).forward_kinematics(coords))
        picture = Picture(parts_of(scene), 240, 180, kind=kind).render(shown, camera=view).astype(int)
        return np.argwhere(picture[..., [0, 2]].min(axis=-1) - picture[..., 1] > 60)

    before = purple("visual")
    assert len(before) > 50 and len(purple("collision")) == 0
    coords[0, 2] += 0.5
    assert purple("visual")[:, 0].mean() < before[:, 0].mean() - 5


def test_height_fields_are_seen():
    xml = """<mujoco model="m"><asset><hfield name="hills" nrow="3" ncol="4" size="1 1 .1 .1"
    elevation="0 1 2 3 4 5 6 7 8 9 10 11"/></asset><worldbody>
    <geom name="hills" type="hfield" hfield="hills" contype="0" conaffinity="0"/><geom name="ball" size=".1"/>
    </worldbody></mujoco>"""
    found = parts_of(tl.Scene.from_mujoco(spec(xml)))
    hills = {part.name: part for part in found.of("visual")}["m/world/hills"]
    assert not found.notes and hills.shape == "hfield"
    np.testing.assert_allclose([hills.mesh.vertices.min(0), hills.mesh.vertices.max(0)], [(-1, -1, -0.1), (1, 1, 0.1)])


def test_a_model_without_geoms_shows_its_joints():
    xml = """<mujoco model="m"><worldbody><body pos="0 0 1"><joint axis="0 1 0"/><inertial pos="0 0 -.5" mass="1"
    diaginertia=".1 .1 .1"/></body></worldbody></mujoco>"""
    found = parts_of(tl.Scene.from_mujoco(spec(xml)))
    assert len(found.of("visual")) > 1 and "joints" in found.notes[0]


def test_a_picture_shows_them():
    xml = MODEL.replace('name="shown"', 'name="shown" pos="0 0 1"')
    model = spec(xml).compile()
    scene = tl.Scene.from_mujoco(model)
    shown = SimpleNamespace(body_q=tl.Dynamics(scene).forward_kinematics(start(model)))
    view = Camera((4, -4, 3), (1, 0, 1))
    pictures = {
        kind: Picture(parts_of(scene), 240, 180, kind=kind).render(shown, camera=view).astype(int)
        for kind in ("visual", "collision")
    }
    blue = {kind: picture[..., 2] - picture[..., :2].max(axis=-1) > 100 for kind, picture in pictures.items()}
    assert blue["visual"].sum() > 50 and blue["collision"].sum() == 0
