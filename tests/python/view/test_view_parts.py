"""What scenes look like: parts where their bodies are, in their colours, visuals apart from collision shapes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import sample_meshes as looks
from PIL import Image

import tightloop as tl
from conftest import SHARED, URDF
from tightloop import _core
from tightloop.view.parts import Part, Parts, parts

PUBLISHED = SHARED / "fr3_franka_hand/urdf/fr3_franka_hand.urdf"
RED, GREEN, BLUE = [255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255]
# Roundings of float32 in numbers of some metres
ATOL = 1e-5


def scene_of(folder: Path, links: str, joints: str = "", more: str = "", **options) -> tuple[tl.Scene, tl.Dynamics]:
    """A scene with a robot `r` of these elements."""
    path = folder / "r.urdf"
    path.write_text(f'<robot name="r">{more}{links}{joints}</robot>')
    scene = tl.Scene(dt=1 / 480, substeps=1)
    scene.add_urdf(path, name="r", **options)
    return scene, tl.Dynamics(scene)


def parts_of(scene: tl.Scene, dynamics: tl.Dynamics | None = None) -> Parts:
    return parts(scene.to_toml(), "/", (dynamics or tl.Dynamics(scene)).body_names)


def link(name: str, inside: str) -> str:
    return f'<link name="{name}">{inside}</link>'


def visual(geometry: str, origin: str = "", material: str = "") -> str:
    origin = origin and f"<origin {origin}/>"
    return f"<visual>{origin}<geometry>{geometry}</geometry>{material}</visual>"


def collision(geometry: str) -> str:
    return f"<collision><geometry>{geometry}</geometry></collision>"


def rotation(quat: np.ndarray) -> np.ndarray:
    x, y, z, w = quat
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def in_world(part: Part, body_q: np.ndarray) -> np.ndarray:
    """Vertices of a part where its body is."""
    points = part.mesh.vertices @ rotation(part.pose[3:]).T + part.pose[:3]
    return points if part.body < 0 else points @ rotation(body_q[part.body, 3:]).T + body_q[part.body, :3]


def extent(points: np.ndarray) -> np.ndarray:
    return np.array([points.min(axis=0), points.max(axis=0)])


def test_visuals_of_all_formats_are_where_their_links_are(tmp_path):
    looks.stl(tmp_path / "a.stl")
    looks.obj(tmp_path / "b.obj", mtl="newmtl red\nKd 1 0 0\nnewmtl green\nKd 0 1 0\n")
    looks.collada(
        tmp_path / "c.dae", asset='<unit meter="0.5"/><up_axis>Z_UP</up_axis>', diffuse="<color>0 0 1 1</color>"
    )
    looks.glb(tmp_path / "d.glb", material={"pbrMetallicRoughness": {"baseColorFactor": [0, 1, 0, 1]}})
    green = '<material name="green"><color rgba="0 1 0 1"/></material>'
    links = (
        link("base", visual('<mesh filename="a.stl"/>', 'xyz="0 0 1"', green))
        + link(
            "upper", visual('<mesh filename="b.obj" scale="2 1 1"/>', 'xyz="1 0 0" rpy="0 0 1.5707963267948966"', green)
        )
        + link("fixed", visual('<mesh filename="c.dae"/>', material=green))
        + link("tip", visual('<mesh filename="d.glb" scale="1 1 0.1"/>'))
    )
    joints = (
        '<joint name="swing" type="continuous"><parent link="base"/><child link="upper"/><origin xyz="0 0 2"/>'
        '<axis xyz="1 0 0"/></joint>'
        '<joint name="weld" type="fixed"><parent link="upper"/><child link="fixed"/>'
        '<origin xyz="0 3 0" rpy="0 1.5707963267948966 0"/></joint>'
        '<joint name="weld2" type="fixed"><parent link="fixed"/><child link="tip"/><origin xyz="0 0 4"/></joint>'
    )
    inertial = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    scene, dynamics = scene_of(tmp_path, links.replace("</link>", inertial), joints, pos=(10, 0, 0))
    found = parts_of(scene, dynamics)
    assert found.notes == []
    base, upper, fixed, tip = found.of("visual")
    assert [dynamics.body_names[part.body] for part in found] == ["r/base", "r/upper", "r/fixed", "r/tip"]
    assert len(found) == 4 and {part.shape for part in found} == {"mesh"}
    # colours: the robot's, except of a file with several
    assert (base.mesh.colors == GREEN).all()
    assert sorted(map(tuple, np.unique(upper.mesh.colors, axis=0))) == [tuple(GREEN), tuple(RED)]
    assert (fixed.mesh.colors == GREEN).all() and (tip.mesh.colors == GREEN).all()
    # swung by 90° about x: y is up
    body_q = dynamics.forward_kinematics(np.array([np.pi / 2]))
    np.testing.assert_allclose(extent(in_world(base, body_q)), [[10, 0, 1], [11, 2, 4]], atol=ATOL)
    # (x, y, z) of the file: scaled, turned about z to (-y, 2x, z), moved, then swung to (x, -z, y), and up by 2
    np.testing.assert_allclose(extent(in_world(upper, body_q)), [[9, -3, 2], [11, 0, 4]], atol=ATOL)
    # half the size, turned about y to (z, y, -x), moved, then swung
    np.testing.assert_allclose(extent(in_world(fixed, body_q)), [[10, 0, 5], [11.5, 0.5, 6]], atol=ATOL)
    # glTF's y is up, (x, -z, y), of which the scale is a tenth of z; its z is the weld's x, 4 m on
    np.testing.assert_allclose(extent(in_world(tip, body_q)), [[14, 0, 2], [14.2, 1, 5]], atol=ATOL)


def test_primitives_have_their_sizes_and_colours(tmp_path):
    red = '<material name="red"/>'
    links = link(
        "l",
        visual('<box size="2 4 6"/>', 'xyz="1 2 3"', red)
        + visual('<sphere radius="0.5"/>')
        + visual(
            '<cylinder radius="0.5" length="4"/>', material='<material name="x"><color rgba="0 0 1 0.5"/></material>'
        )
        + visual('<capsule radius="0.5" length="4"/>', material=red),
    )
    scene, _ = scene_of(tmp_path, links, more='<material name="red"><color rgba="1 0 0 1"/></material>')
    box, sphere, cylinder, capsule = parts_of(scene)
    assert [part.shape for part in (box, sphere, cylinder, capsule)] == ["box", "sphere", "cylinder", "capsule"]
    assert [part.name for part in (box, sphere)] == ["r/l/0", "r/l/1"]
    for part, half in ((box, (1, 2, 3)), (sphere, (0.5,) * 3), (cylinder, (0.5, 0.5, 2)), (capsule, (0.5, 0.5, 2.5))):
        np.testing.assert_allclose(extent(part.mesh.vertices), np.outer([-1, 1], half), atol=ATOL)
        assert looks.volume(part.mesh.vertices, part.mesh.faces) > 0
        assert part.kind == "visual"
        assert (part.mesh.vertices.dtype, part.mesh.faces.dtype, part.mesh.colors.dtype) == ("f4", "u4", "u1")
        assert part.mesh.colors.shape == (len(part.mesh.faces), 4)
    np.testing.assert_array_equal(box.pose, [1, 2, 3, 0, 0, 0, 1])
    assert (box.mesh.colors == RED).all() and (capsule.mesh.colors == RED).all()
    assert (cylinder.mesh.colors == [0, 0, 255, 128]).all()
    assert len(np.unique(sphere.mesh.colors, axis=0)) == 1


def test_textures_of_the_robot_file_are_their_mean(tmp_path):
    image = Image.new("RGB", (2, 1))
    image.putpixel((0, 0), (200, 0, 0))
    image.putpixel((1, 0), (0, 100, 0))
    image.save(tmp_path / "skin.png")
    (tmp_path / "broken.png").write_bytes(b"no image")
    skin = '<material name="m"><texture filename="{}"/><color rgba="0 0 1 1"/></material>'
    looks.stl(tmp_path / "a.stl")
    links = link(
        "l",
        visual('<mesh filename="a.stl"/>', material=skin.format("skin.png"))
        + visual('<box size="1 1 1"/>', material=skin.format("broken.png")),
    )
    found = parts_of(scene_of(tmp_path, links)[0])
    first, second = found.of("visual")
    assert (first.mesh.colors == [100, 50, 0, 255]).all() and (second.mesh.colors == BLUE).all()
    assert len(found.notes) == 1 and "broken.png" in found.notes[0]


def test_a_link_of_which_nothing_can_be_shown_is_reported_and_a_robot_is_then_seen_as_its_skeleton(tmp_path):
    mass = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    lost = visual('<mesh filename="missing.stl"/>') + mass
    joint = '<joint name="j" type="continuous"><parent link="a"/><child link="b"/><axis xyz="1 0 0"/></joint>'
    scene, _ = scene_of(tmp_path, link("a", lost) + link("b", visual('<sphere radius="2"/>') + mass), joint)
    found = parts_of(scene)
    assert [(part.body, part.shape) for part in found] == [(1, "sphere")]
    assert len(found.notes) == 1 and "r/a/0" in found.notes[0] and "nothing of the link is shown" in found.notes[0]
    scene, _ = scene_of(tmp_path, link("a", lost))
    found = parts_of(scene)
    assert [(part.body, part.kind, part.shape) for part in found] == [(0, "visual", "sphere")]
    assert len(found.notes) == 2 and "its joints" in found.notes[1]


@pytest.mark.parametrize("file", ["missing.dae", "broken.stl", "http://far/away.dae", "strange.blend"])
def test_a_visual_that_cannot_be_read_leaves_the_links_collision_shapes(tmp_path, file):
    (tmp_path / "broken.stl").write_bytes(b"solid nothing")
    (tmp_path / "strange.blend").write_bytes(b"BLENDER")
    broken = visual('<sphere radius="3"/>') + visual(f'<mesh filename="{file}"/>')
    links = link("a", broken + collision('<box size="1 1 1"/>')) + link(
        "b", visual('<sphere radius="2"/>') + collision('<box size="2 2 2"/>')
    )
    joint = '<joint name="j" type="continuous"><parent link="a"/><child link="b"/><axis xyz="1 0 0"/></joint>'
    scene, _ = scene_of(tmp_path, links, joint)
    found = parts_of(scene)
    assert [(part.body, part.shape) for part in found.of("visual")] == [(0, "box"), (1, "sphere")]
    assert [(part.body, part.shape) for part in found.of("collision")] == [(0, "box"), (1, "box")]
    assert len(found.notes) == 1
    assert "r/a/1" in found.notes[0] and file.rpartition("/")[2] in found.notes[0] and "shown" in found.notes[0]
    # a launch is not its business
    with tl.launch(scene, worlds=1) as sim:
        assert sim.reset().time[0] == 0


def test_robots_without_visuals_and_scenes_are_seen_as_they_touch(tmp_path):
    looks.stl(tmp_path / "a.stl")
    scene, _ = scene_of(tmp_path, link("l", collision('<mesh filename="a.stl"/>') + collision('<sphere radius="2"/>')))
    scene.add_ground()
    scene.add_box(half_extents=(1, 1, 1), pos=(0, 0, 5), name="shelf")
    scene.add_body(name="ball", pos=(0, 0, 9))
    scene.add_sphere(radius=1, body="ball", name="skin")
    scene.add_sphere(radius=1, body="r/l", name="added")
    found = parts_of(scene)
    assert found.notes == []
    told = [(part.body, part.name, part.shape) for part in found.of("collision")]
    assert told == [
        (-1, "ground", "plane"),
        (-1, "shelf", "box"),
        (0, "r/l/0", "mesh"),
        (0, "r/l/1", "sphere"),
        (0, "r/l/added", "sphere"),
        (1, "ball/skin", "sphere"),
    ]
    assert [(part.body, part.name, part.shape) for part in found.of("visual")] == told
    # surfaces that are the same are shared, whatever they are for
    balls = [part for part in found.of("collision") if part.name in ("r/l/added", "ball/skin")]
    assert balls[0].mesh.vertices is balls[1].mesh.vertices
    shelf = [part.mesh for part in found if part.name == "shelf"]
    assert shelf[0] is shelf[1]


def test_a_robot_without_visuals_and_collisions_is_seen_as_its_skeleton(tmp_path):
    inertia = '<mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    mass = f'<inertial><origin xyz="0 0 {{}}"/>{inertia}</inertial>'
    links = link("a", mass.format(0)) + link("b", mass.format(-0.5)) + link("c", mass.format(0.001))
    ends = '<parent link="{1}"/><child link="{2}"/><origin xyz="{3}"/>'
    joint = f'<joint name="{{0}}" type="continuous">{ends}<axis xyz="1 0 0"/></joint>'
    joints = joint.format("j", "a", "b", "0.3 0 0.4") + joint.format("k", "b", "c", "0 0 -1")
    scene, dynamics = scene_of(tmp_path, links, joints)
    found = parts_of(scene, dynamics)
    assert found.of("collision") == []
    assert len(found.notes) == 1 and "nothing in its file" in found.notes[0] and "`r`" in found.notes[0]
    body_q = dynamics.forward_kinematics(np.zeros(2))
    names = dynamics.body_names
    # each link's ball is at its frame, and lines go from there to the joints and the centres of mass
    for body in range(3):
        ball, *lines = [part for part in found.of("visual") if part.body == body]
        assert ball.shape == "sphere"
        reached = [2 * line.pose[:3] for line in lines]
        expected = {"r/a": [[0.3, 0, 0.4]], "r/b": [[0, 0, -1], [0, 0, -0.5]], "r/c": []}[names[body]]
        np.testing.assert_allclose(np.reshape(reached, (-1, 3)), np.reshape(expected, (-1, 3)), atol=1e-12)
        for line, end in zip(lines, expected, strict=True):
            low, high = extent(in_world(line, body_q))
            # as thick as a tenth of the middle one, which is 0.5 m long
            np.testing.assert_allclose(high - low, np.abs(end) + 0.05, atol=1e-3)


def test_shapes_that_a_scene_adds_to_a_dressed_robot_are_seen(tmp_path):
    links = link("l", visual('<box size="1 1 1"/>') + collision('<sphere radius="1"/>')) + link(
        "m", collision('<sphere radius="1"/>')
    )
    joint = '<joint name="j" type="continuous"><parent link="l"/><child link="m"/><axis xyz="1 0 0"/></joint>'
    scene, _ = scene_of(tmp_path, links, joint)
    scene.add_capsule(radius=1, half_height=1, body="r/l", name="tool")
    # `m` has no visual: it is not seen, as its author wants
    assert [part.name for part in parts_of(scene).of("visual")] == ["r/l/tool", "r/l/0"]


def test_a_mesh_touches_as_its_hull_and_is_seen_whole(tmp_path):
    # two boxes apart: their hull is larger than both
    nodes = [{"mesh": 0}, {"mesh": 0, "translation": [9, 0, 0]}]
    looks.glb(tmp_path / "two.glb", nodes=nodes)
    scene, _ = scene_of(tmp_path, link("l", collision('<mesh filename="two.glb"/>')))
    found = parts_of(scene)
    hull, whole = found.of("collision")[0].mesh, found.of("visual")[0].mesh
    assert looks.volume(hull.vertices, hull.faces) == pytest.approx(60)
    assert looks.volume(whole.vertices, whole.faces) == pytest.approx(12)


def test_one_file_is_read_once_and_shared(tmp_path):
    looks.collada(tmp_path / "a.dae", diffuse="<color>1 0 0 1</color>")
    same = visual('<mesh filename="a.dae"/>', material='<material name="m"><color rgba="0 1 0 1"/></material>')
    links = link("l", same + visual('<mesh filename="a.dae"/>') + visual('<mesh filename="a.dae" scale="1 1 2"/>'))
    links += link("m", same)
    joint = '<joint name="w" type="fixed"><parent link="l"/><child link="m"/></joint>'
    one, two, tall, other = parts_of(scene_of(tmp_path, links, joint)[0])
    assert one.mesh is other.mesh and tall.mesh is not two.mesh and one.mesh is not two.mesh
    assert (two.mesh.colors == RED).all() and (one.mesh.colors == GREEN).all()


def test_a_plane_is_a_sheet_of_checkers():
    scene = tl.Scene(dt=1 / 480, substeps=1)
    scene.add_plane(quat=(-np.sin(np.pi / 8), 0, 0, np.cos(np.pi / 8)), pos=(0, 0, 1))
    plane = parts_of(scene).of("visual")[0]
    assert plane.body == -1 and plane.shape == "plane"
    np.testing.assert_allclose(extent(plane.mesh.vertices), [[-5, -5, 0], [5, 5, 0]])
    assert len(np.unique(plane.mesh.colors, axis=0)) == 2
    corners = plane.mesh.vertices[plane.mesh.faces].astype(float)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    np.testing.assert_allclose(normals, np.broadcast_to([0, 0, 0.25], normals.shape), atol=1e-6)
    # neighbours differ: the mean colour over the sheet is half-way
    first = plane.mesh.colors == plane.mesh.colors[0]
    assert first.all(axis=1).mean() == 0.5
    np.testing.assert_allclose(rotation(plane.pose[3:]) @ [0, 0, 1], np.array([0, 1, 1]) / np.sqrt(2), atol=1e-12)


def test_other_bodies_and_broken_scenes_are_refused(tmp_path):
    scene, _ = scene_of(tmp_path, link("l", visual('<sphere radius="1"/>')))
    with pytest.raises(tl.SceneError, match=r"`r/l`.*body_names"):
        parts(scene.to_toml(), "/", ["other/l"])
    with pytest.raises(tl.SceneError, match="scene"):
        parts("nonsense = [", "/", [])


def test_looks_change_no_model(tmp_path):
    inside = collision('<box size="1 1 1"/>')
    _, plain = scene_of(tmp_path, link("l", inside))
    _, dressed = scene_of(tmp_path, link("l", visual('<mesh filename="a.dae"/>') + inside))
    assert plain.model_hash == dressed.model_hash


def assert_arm(found: Parts, dynamics: tl.Dynamics) -> None:
    """Every moving link is seen, and its visuals lie about where its collision shapes do."""
    body_q = dynamics.forward_kinematics(np.zeros(len(dynamics.coord_names)))
    touching = {part.body for part in found.of("collision")}
    assert len(touching) >= 11
    for body in sorted(touching):
        boxes = [
            extent(np.concatenate([in_world(part, body_q) for part in found.of(kind) if part.body == body]))
            for kind in ("visual", "collision")
        ]
        # both are about the same link: no more than a hand's breadth apart
        np.testing.assert_allclose(boxes[0], boxes[1], atol=0.06, err_msg=dynamics.body_names[body])


def test_the_projects_own_arm_is_seen():
    scene = tl.Scene(dt=1 / 480, substeps=1)
    scene.add_urdf(URDF, name="arm")
    dynamics = tl.Dynamics(scene)
    found = parts_of(scene, dynamics)
    assert found.notes == []
    assert_arm(found, dynamics)
    assert len(np.unique(np.concatenate([part.mesh.colors for part in found.of("visual")]), axis=0)) > 2


@pytest.mark.skipif(not PUBLISHED.exists(), reason="the published URDF lies in ../shared only")
def test_the_published_arm_is_seen():
    scene = tl.Scene(dt=1 / 480, substeps=1)
    scene.add_urdf(PUBLISHED, name="arm")
    dynamics = tl.Dynamics(scene)
    found = parts_of(scene, dynamics)
    assert_arm(found, dynamics)
    # its file has no visuals: the meshes of its collisions are seen whole
    faces = {kind: sum(len(part.mesh.faces) for part in found.of(kind)) for kind in ("visual", "collision")}
    assert faces["visual"] > 1.5 * faces["collision"]


def test_what_rust_tells_is_flat_and_finite(tmp_path):
    scene, _ = scene_of(tmp_path, link("l", collision('<box size="1 1 1"/>')))
    _, surfaces = _core.parts(scene.to_toml(), "/")
    for vertices, faces in surfaces:
        assert vertices.dtype == "f4" and vertices.shape[1] == 3 and np.isfinite(vertices).all()
        assert faces.dtype == "u4" and faces.shape[1] == 3 and faces.max() < len(vertices)
