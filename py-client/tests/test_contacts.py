"""What a scene says of contacts: surfaces, bearers, meshes, planes, filters and capacities, in Python and in files."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

import tightloop as tl

URDF = """<robot name="arm">
  <link name="base"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <link name="hand"><inertial><mass value="1"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>
    <collision name="palm"><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
  <joint name="wrist" type="continuous"><parent link="base"/><child link="hand"/><axis xyz="0 1 0"/></joint>
</robot>
"""
WEDGE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
SURFACE: tl.Surface = {
    "mu": 0.7,
    "ke": 5000.0,
    "kd": 200.0,
    "kf": 500.0,
    "margin": 1e-3,
    "gap": 2e-3,
    "condim": 1,
    "group": -2,
}


@pytest.fixture
def scene(tmp_path: Path) -> tl.Scene:
    """An arm with two shapes, and a cube without any."""
    file = tmp_path / "arm.urdf"
    file.write_text(URDF)
    scene = tl.Scene()
    scene.add_urdf(file, name="arm")
    scene.add_body(name="cube", mass=1.0)
    return scene


@pytest.fixture
def wedge(tmp_path: Path) -> Path:
    file = tmp_path / "meshes" / "wedge.obj"
    file.parent.mkdir()
    file.write_text(WEDGE)
    return file


def adders(scene: tl.Scene, wedge: Path) -> dict[str, Any]:
    """Each way to add a shape, with the sizes it needs."""
    return {
        "box": lambda **options: scene.add_box(half_extents=(1, 1, 1), **options),
        "sphere": lambda **options: scene.add_sphere(radius=1, **options),
        "cylinder": lambda **options: scene.add_cylinder(radius=1, half_height=1, **options),
        "capsule": lambda **options: scene.add_capsule(radius=1, half_height=1, **options),
        "mesh": lambda **options: scene.add_mesh(wedge, **options),
    }


def test_every_shape_takes_a_surface_and_a_bearer(scene, wedge):
    for kind, add in adders(scene, wedge).items():
        assert add(name=kind, **SURFACE).full_name == kind
        assert add(name=f"{kind}_b", body=scene.bodies["cube"], density=400, **SURFACE).full_name == f"cube/{kind}_b"
        shape = add(name=f"{kind}_l", body=scene.robots["arm"].link("hand"), pos=(0, 0, 1), **SURFACE)
        assert (shape.full_name, shape.body, shape.pos) == (f"arm/hand/{kind}_l", "arm/hand", (0, 0, 1))
        assert add(body="arm/base").body == "arm/base"
        assert {name: getattr(shape, name) for name in SURFACE} == SURFACE
    ground = scene.add_ground(z=-0.5, **SURFACE)
    assert (ground.type, ground.pos, ground.mu) == ("plane", (0, 0, -0.5), 0.7)
    assert [ground.name, scene.add_ground().name, scene.add_plane().name] == ["ground", "ground_2", "plane"]


def test_what_is_left_out_of_a_surface_is_not_written(scene):
    shape = scene.add_box(half_extents=(1, 1, 1), mu=None, margin=0.001)
    assert (shape.mu, shape.margin) == (None, 0.001)
    assert "mu" not in scene.to_toml() and "margin = 0.001" in scene.to_toml()


@pytest.mark.parametrize(
    ("surface", "named"),
    [
        ({"mu": -0.1}, r"mu is -0\.1; it must be at least 0"),
        ({"mu": math.nan}, "mu is nan; give a finite number"),
        ({"mu": "rough"}, "mu is 'rough'; give a number"),
        ({"ke": 0}, "ke is 0; it must be above 0"),
        ({"kd": -1}, "kd is -1; it must be above 0"),
        ({"kf": math.inf}, "kf is inf"),
        ({"margin": -1e-3}, r"margin is -0\.001; it must be at least 0"),
        ({"gap": -1}, "gap is -1; it must be at least 0"),
        ({"condim": 2}, "condim is 2; give 3, or 1 for no friction"),
        ({"condim": 4}, "condim is 4: .* not supported yet; give 3, or 1"),
        ({"condim": 6}, "condim is 6: .* not supported yet"),
        ({"condim": 3.0}, r"condim is 3\.0; give a whole number"),
        ({"group": 1.5}, r"group is 1\.5; give a whole number"),
        ({"group": 2**31}, "group is 2147483648; give at most 2147483647"),
    ],
    ids=str,
)
def test_a_wrong_surface_names_shape_and_value(scene, wedge, surface, named):
    before = scene.to_toml()
    for kind, add in adders(scene, wedge).items():
        with pytest.raises(tl.SceneError, match=f"{kind} `x`: {named}"):
            add(name="x", **surface)
    with pytest.raises(tl.SceneError, match=f"plane `ground`: {named}"):
        scene.add_ground(**surface)
    with pytest.raises(tl.SceneError, match=f"body `die`: {named}"):
        scene.add_cube(name="die", **surface)
    with pytest.raises(tl.SceneError, match=f"add_urdf: {named}"):
        scene.add_urdf(scene.robots["arm"].urdf, name="two", **surface)
    assert scene.to_toml() == before


def test_a_misspelt_surface_is_an_error(scene):
    wrong: Any = {"friction": 0.5}
    with pytest.raises(TypeError, match=r"`friction`; did you mean `mu`"):
        scene.add_sphere(radius=1, **wrong)


def test_a_wrong_bearer_is_named(scene, tmp_path):
    other = tl.Scene()
    stranger = other.add_urdf(tmp_path / "arm.urdf", name="arm").link("hand")
    cases: list[tuple[Any, str]] = [
        ("arm", "body is the robot 'arm'; give one of its links"),
        ("arm/foot", "robot `arm` has no link of the name 'foot'; there are: base, hand"),
        ("leg/foot", "body is 'leg/foot', which is no body of this scene; there are: `cube`"),
        (stranger, "link `arm/hand` is of another scene"),
        (7, "body is 7; give a body"),
    ]
    for bearer, named in cases:
        with pytest.raises(tl.SceneError, match=named):
            scene.add_box(half_extents=(1, 1, 1), body=bearer)
    with pytest.raises(tl.SceneError, match="link `arm/hand` has the mass that its robot's file gives it"):
        scene.add_box(half_extents=(1, 1, 1), body="arm/hand", density=5)
    with pytest.raises(tl.SceneError, match="robot `arm` has no link of the name 'foot'"):
        scene.robots["arm"].link("foot")
    assert not scene.shapes


def test_a_mesh_is_read_at_once(scene, wedge, tmp_path):
    shape = scene.add_mesh(wedge, scale=0.5, max_hull_vertices=8, convex_decomposition=True, pos=(1, 2, 3))
    assert (shape.name, shape.path, shape.scale) == ("mesh", wedge, (0.5, 0.5, 0.5))
    assert scene.add_mesh(str(wedge), scale=(1, 2, -3)).scale == (1, 2, -3)
    flat = tmp_path / "flat.obj"
    flat.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n")
    assert any("flat" in note for note in scene.add_mesh(flat).notes)
    before = scene.to_toml()
    cases: list[tuple[Any, dict[str, Any], str]] = [
        (tmp_path / "gone.obj", {}, r"gone\.obj"),
        (None, {}, "path is None; give a path"),
        (wedge, {"scale": (1, 0, 1)}, r"scale is \(1, 0, 1\); no factor must be 0"),
        (wedge, {"scale": 0}, "scale is 0; no factor must be 0"),
        (wedge, {"scale": (1, 2)}, "scale has 2 values; give 3"),
        (wedge, {"scale": 1e-9}, r"wedge\.obj: its size is .*mend the scale"),
        (wedge, {"max_hull_vertices": 4}, "max_hull_vertices is 4; it must be between 8 and 1024"),
    ]
    for path, options, named in cases:
        with pytest.raises(tl.SceneError, match=named):
            scene.add_mesh(path, **options)
    assert scene.to_toml() == before


def test_filters_take_things_and_names(scene):
    table, box = scene.add_table(), scene.add_box(half_extents=(1, 1, 1), body="cube")
    arm, cube = scene.robots["arm"], scene.bodies["cube"]
    for a, b, pair in [
        (table, box, ("table", "cube/box")),
        (arm, cube, ("arm", "cube")),
        (arm.link("hand"), "arm/base/0", ("arm/hand", "arm/base/0")),
        ("arm/hand/palm", "table", ("arm/hand/palm", "table")),
        (arm, arm, ("arm", "arm")),
    ]:
        scene.filter_contacts(a, b)
        assert scene.filters[-1] == pair
    with pytest.raises(
        tl.SceneError,
        match=r"a is 'tabel', which is no shape, robot, body or link; there are: `table`, `cube/box`, `arm`, `cube`",
    ):
        scene.filter_contacts("tabel", cube)
    other = tl.Scene()
    with pytest.raises(tl.SceneError, match="shape `table` is of another scene"):
        scene.filter_contacts(other.add_table(), cube)
    with pytest.raises(tl.SceneError, match="body `cube` is of another scene"):
        scene.filter_contacts(table, other.add_cube())
    assert len(scene.filters) == 5


@pytest.mark.parametrize(
    ("option", "value", "named"),
    [
        ("contacts_max", 0, "contacts_max is 0; it must be at least 1"),
        ("contacts_max", 4097, "contacts_max is 4097; it must be at most 4096"),
        ("contacts_max", 2.5, r"contacts_max is 2\.5; give a whole number"),
        ("rows_max", 0, "rows_max is 0; it must be at least 1"),
        ("rows_max", 16385, "rows_max is 16385; it must be at most 16384"),
    ],
)
def test_a_wrong_capacity_is_named(option, value, named):
    wrong: Any = {option: value}
    with pytest.raises(tl.SceneError, match=named):
        tl.Scene(**wrong)
    scene = tl.Scene(contacts_max=7, rows_max=21)
    with pytest.raises(tl.SceneError, match=named):
        setattr(scene, option, value)
    assert (scene.contacts_max, scene.rows_max) == (7, 21)
    scene.contacts_max = None
    assert "contacts_max" not in scene.to_toml() and "rows_max = 21" in scene.to_toml()


def test_the_lesson_has_a_table_and_a_cube():
    scene = tl.Scene()
    table, cube = scene.add_table(mu=0.9), scene.add_cube(mu=0.5)
    assert (table.name, table.half_extents, table.pos, table.mu) == ("table", (0.4, 0.4, 0.05), (0, -0.5, 0.05), 0.9)
    assert (cube.name, cube.pos, cube.fixed) == ("cube", (0, -0.35, 0.125), False)
    box = scene.shapes["box"]
    assert (box.full_name, box.half_extents, box.density) == ("cube/box", (0.025, 0.025, 0.025), 400)
    assert (box.margin, box.mu) == (1e-3, 0.5)
    # it rests on the table
    assert table.pos[2] + 0.05 == pytest.approx(cube.pos[2] - 0.025)


def test_a_file_holds_all_of_it(scene, wedge, tmp_path):
    scene.contacts_max, scene.rows_max = 40, 120
    scene.add_urdf(scene.robots["arm"].urdf, name="second", **SURFACE)
    scene.add_ground(z=0.1, group=-1)
    scene.add_mesh(wedge, scale=(1, 2, 3), convex_decomposition=True, name="ramp", mu=0.3)
    for add in adders(scene, wedge).values():
        add(body="cube", density=300, **SURFACE)
        add(body="second/hand", **SURFACE)
    scene.filter_contacts("arm/hand", "ground")
    scene.filter_contacts("second", "cube/box")
    file = tmp_path / "scene.toml"
    scene.save(file)
    text = file.read_text()
    assert 'path = "meshes/wedge.obj"' in text and str(tmp_path) not in text
    loaded = tl.Scene.load(file)
    assert loaded.to_toml() == scene.to_toml()
    assert loaded.shapes == scene.shapes and loaded.filters == scene.filters
    assert loaded.robots["second"].surface == SURFACE
    dynamics = tl.Dynamics(loaded)
    assert dynamics.body_names[-1] == "cube/body"


def test_robots_tell_their_shapes(scene):
    assert scene.robots["arm"].shape_names == ["base/0", "hand/palm"]
