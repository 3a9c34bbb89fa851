"""Spatial tendons in pictures: where MuJoCo has them, in its colours, as wide as their width."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest
import random_tendons
from safetensors.numpy import load_file, save_file

import tightloop as tl
from tightloop.mujoco import export
from tightloop.view import Camera, Picture
from tightloop.view.browser import guarded_server
from tightloop.view.browser.display_options import DisplayOptions
from tightloop.view.browser.gate import Gate
from tightloop.view.parts import Parts, parts
from tightloop.view.poses import place
from tightloop.view.tendons import capsules
from tightloop.view.tendons.batched import TendonMeshes
from tightloop.view.tendons.paths import Tendons

# MuJoCo stops its search on the inner side of a surface 1e-6 rad off [m].
ATOL = 1e-6
ARM = """<mujoco model="arm"><asset><material name="blue" rgba="0 0 1 1"/></asset><worldbody>
<site name="start" pos="-.5 0 1"/>
<geom name="ball" size=".2" pos="0 0 1" contype="0" conaffinity="0"/><site name="above" pos="0 0 1.3"/>
<site name="inside" pos="0 .01 1.1"/>
<geom name="rod" type="cylinder" size=".15 .4" pos="0 -.5 1" euler="90 0 0" contype="0" conaffinity="0"/>
<site name="under" pos="0 -.5 .5"/>
<body name="tip" pos=".5 0 1"><joint axis="0 1 0"/><geom size=".01"/>
  <site name="end" pos=".1 0 0"/><site name="low" pos=".1 -.8 -.1"/></body>
</worldbody><tendon>{tendons}</tendon><actuator>{actuators}</actuator></mujoco>"""
PATHS = {
    "straight": '<site site="start"/><site site="end"/>',
    "sphere": '<site site="start"/><geom geom="ball"/><site site="end"/>',
    "sphere past a side site": '<site site="start"/><geom geom="ball" sidesite="above"/><site site="end"/>',
    "inside of a sphere": '<site site="above"/><geom geom="ball" sidesite="inside"/><site site="end"/>',
    "cylinder": '<site site="start"/><geom geom="rod"/><site site="low"/>',
    "cylinder past a side site": '<site site="start"/><geom geom="rod" sidesite="under"/><site site="low"/>',
    "pulley": '<site site="start"/><geom geom="ball" sidesite="above"/><site site="end"/><pulley divisor="2"/>'
    '<site site="start"/><site site="low"/><pulley divisor="3"/><site site="above"/><site site="end"/>',
}


def arm(tendons: str, actuators: str = "") -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(ARM.format(tendons=tendons, actuators=actuators))


def tendons_of(model: mujoco.MjModel) -> Tendons:
    made = Tendons()
    made.add(export.arrays(model), range(model.nbody), 0)
    return made


def body_poses(data: mujoco.MjData) -> np.ndarray:
    """``body_q`` of one world."""
    return np.concatenate([data.xpos, data.xquat[:, [1, 2, 3, 0]]], axis=1)[None]


def assert_paths_are_mujocos(model: mujoco.MjModel, data: mujoco.MjData) -> int:
    """Compare all paths with MuJoCo's; return how many points on shapes there are."""
    segments = tendons_of(model).segments(body_poses(data))
    touched = 0
    for tendon in range(model.ntendon):
        first, count = int(data.ten_wrapadr.ravel()[tendon]), int(data.ten_wrapnum.ravel()[tendon])
        objects = data.wrap_obj.ravel()[first : first + count]
        points = data.wrap_xpos.reshape(-1, 3)[first : first + count]
        own = segments.ends[0, segments.tendon == tendon]
        for k in range(count - 1):
            if objects[k] == -2 or objects[k + 1] == -2:
                continue
            if objects[k] >= 0 and objects[k + 1] >= 0:
                # on a shape: a chain of pieces from one point to the other
                touched += 2
                off = [np.abs(own - point).max(axis=-1).min() for point in (points[k], points[k + 1])]
                assert max(off) < ATOL
            else:
                off = np.abs(own - points[k : k + 2]).max(axis=(1, 2))
                assert off.min() < ATOL, (tendon, k)
    return touched


@pytest.mark.parametrize("path", PATHS)
def test_a_path_is_mujocos(path):
    model = arm(f"<spatial>{PATHS[path]}</spatial>")
    data = mujoco.MjData(model)
    touched = 0
    for angle in np.linspace(-np.pi, np.pi, 50):
        data.qpos[0] = angle
        mujoco.mj_forward(model, data)
        touched += assert_paths_are_mujocos(model, data)
    assert (touched > 0) == (path != "straight")


def test_random_paths_are_mujocos():
    touched = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)

        def numbers(count: int, low: float = -1.0, high: float = 1.0, rng: Any = rng) -> str:
            return " ".join(f"{x:.17g}" for x in rng.uniform(low, high, count))

        bodies = "".join(
            f'<body pos="{numbers(3)}"><freejoint/><geom size=".01" contype="0" conaffinity="0"/>'
            f'{random_tendons.shape(rng, numbers, str(k))}<site name="s{k}" pos="{numbers(3, -0.5, 0.5)}"/></body>'
            for k in range(4)
        )
        spatial = "".join(f"<spatial>{random_tendons.path(rng, 4)}</spatial>" for _ in range(3))
        model = mujoco.MjModel.from_xml_string(
            f"<mujoco><worldbody>{bodies}</worldbody><tendon>{spatial}</tendon></mujoco>"
        )
        data = mujoco.MjData(model)
        for _ in range(5):
            data.qpos[:] = rng.uniform(-1, 1, model.nq)
            mujoco.mj_normalizeQuat(model, data.qpos)
            mujoco.mj_forward(model, data)
            touched += assert_paths_are_mujocos(model, data)
    assert touched > 500


@pytest.mark.parametrize("path", ["sphere", "sphere past a side site", "cylinder", "cylinder past a side site"])
def test_an_arc_lies_on_its_shape_and_is_as_long_as_mujocos(path):
    model = arm(f"<spatial>{PATHS[path]}</spatial>")
    data = mujoco.MjData(model)
    for angle in np.linspace(-1.0, 1.0, 9):
        data.qpos[0] = angle
        mujoco.mj_forward(model, data)
        segments = tendons_of(model).segments(body_poses(data))
        lengths = np.linalg.norm(segments.ends[0, :, 1] - segments.ends[0, :, 0], axis=-1)
        # a chord of an eighth of half a turn is 0.6 % shorter than its arc
        assert data.ten_length[0] * 0.99 < lengths.sum() <= data.ten_length[0] + ATOL
        geom = 1 if "cylinder" in path else 0
        local = (segments.ends[0] - data.geom_xpos[geom]) @ data.geom_xmat[geom].reshape(3, 3)
        away = np.linalg.norm(local[..., :2] if geom else local, axis=-1)
        on_shape = np.abs(away - model.geom_size[geom, 0]) < ATOL
        assert on_shape.sum() >= 2 * 8 or lengths[1:].sum() == 0


def test_a_world_of_many_has_the_paths_that_it_has_alone():
    model = arm("".join(f"<spatial>{path}</spatial>" for path in PATHS.values()))
    data, made = mujoco.MjData(model), tendons_of(model)
    poses = []
    for angle in (-2.0, -0.5, 0.5, 2.0):
        data.qpos[0] = angle
        mujoco.mj_forward(model, data)
        poses.append(body_poses(data))
    together = made.segments(np.concatenate(poses))
    for world, alone in enumerate(poses):
        np.testing.assert_array_equal(together.ends[world], made.segments(alone).ends[0])


def drawn(model: mujoco.MjModel, data: mujoco.MjData, *flags: int) -> list[Any]:
    """What MuJoCo's viewer draws of tendons and of actuators."""
    scene = mujoco.MjvScene(model, maxgeom=1000)
    options, grip, camera = mujoco.MjvOption(), mujoco.MjvPerturb(), mujoco.MjvCamera()
    for flag in flags:
        options.flags[flag] = 1
    mujoco.mjv_updateScene(model, data, options, grip, camera, mujoco.mjtCatBit.mjCAT_ALL.value, scene)
    kinds = (mujoco.mjtObj.mjOBJ_TENDON, mujoco.mjtObj.mjOBJ_ACTUATOR)
    return [shape for shape in scene.geoms[: scene.ngeom] if shape.objtype in kinds]


def test_tendons_are_seen_as_mujocos_viewer_shows_them():
    line = PATHS["straight"]
    model = arm(
        f'<spatial name="plain">{line}</spatial><spatial name="own" rgba="1 0 0 .5" width=".02">{line}</spatial>'
        f'<spatial name="blue" material="blue" group="2">{line}</spatial>'
        f'<spatial name="hidden" group="3">{line}</spatial><spatial name="clear" rgba="1 1 1 0">{line}</spatial>'
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    shapes, made = drawn(model, data), tendons_of(model)
    # MuJoCo's shapes of clear tendons are not seen
    shapes = [shape for shape in shapes if shape.rgba[3] > 0]
    assert [model.tendon(shape.objid).name for shape in shapes] == ["plain", "own", "blue"]
    np.testing.assert_allclose(made.radii, [shape.size[0] for shape in shapes], rtol=1e-6)
    np.testing.assert_allclose(made.colors, [shape.rgba for shape in shapes], rtol=1e-6)


def test_muscles_have_mujocos_colours_of_activation():
    model = arm(
        "".join(f'<spatial name="{name}">{PATHS["straight"]}</spatial>' for name in ("a", "b", "c")),
        '<muscle tendon="b" lengthrange=".5 2"/><muscle tendon="a" lengthrange=".5 2"/><motor tendon="c"/>',
    )
    data, made = mujoco.MjData(model), tendons_of(model)
    np.testing.assert_array_equal(made.shown_colors(None, 1)[0], made.colors)
    for act in ([0.0, 0.3], [0.6, 1.0]):
        data.act[:] = act
        mujoco.mj_forward(model, data)
        flags = mujoco.mjtVisFlag.mjVIS_ACTUATOR, mujoco.mjtVisFlag.mjVIS_ACTIVATION
        shapes = drawn(model, data, *flags)
        of = {shape.objid: shape.rgba for shape in shapes if shape.objtype == mujoco.mjtObj.mjOBJ_ACTUATOR}
        colors = made.shown_colors(np.array([act]), 1)[0]
        np.testing.assert_allclose(colors[:2], [of[1], of[0]], rtol=1e-6)
        np.testing.assert_array_equal(colors[2], made.colors[2])


def test_capsules_cover_a_piece_and_no_more():
    rng = np.random.default_rng(0)
    lengths, radii = 10 ** rng.uniform(-3, 1, 200), 10 ** rng.uniform(-3, -1, 200)
    levels, own = capsules.cover(lengths, radii)
    long = lengths >= radii / 8
    assert np.all(own[long] <= lengths[long] * (1 + 1e-12)) and np.all(2 * own[long] >= lengths[long] * (1 - 1e-12))
    np.testing.assert_allclose(own, radii * 2.0**levels)
    directions = rng.normal(size=(50, 3))
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    for direction in (*directions, np.array([0, 0, -1.0]), np.array([0, 0, 1.0])):
        turned = place(np.concatenate([np.zeros(3), capsules.towards(direction)]), np.array([[0, 0, 1.0]]))
        np.testing.assert_allclose(turned[0], direction, atol=1e-9)
    mesh = capsules.capsule(0.1, 0.4)
    assert np.allclose(mesh.vertices.min(axis=0), [-0.1, -0.1, -0.1]) and np.isclose(mesh.vertices[:, 2].max(), 0.5)
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces].astype(float), 1, 0)
    # closed and outwards: π r² l + 4/3 π r³, less what twelve corners lack
    assert np.isclose(np.sum(a * np.cross(b, c)) / 6, np.pi * (0.004 + 4 / 3 * 0.001), rtol=0.1)


def scene_parts(scene: tl.Scene) -> Parts:
    return parts(scene.to_toml(), "/", tl.Dynamics(scene).body_names)


def pixel(view: Camera, point: np.ndarray, width: int, height: int) -> tuple[int, int]:
    """Row and column of a point."""
    forward = np.subtract(view.target, view.position)
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, view.up)
    right /= np.linalg.norm(right)
    away = point - view.position
    scale = 0.5 * height / np.tan(0.5 * view.fov) / (away @ forward)
    return (
        int(0.5 * height - scale * (away @ np.cross(right, forward))),
        int(0.5 * width + scale * (away @ right)),
    )


def test_a_still_shows_a_tendon_where_it_is_in_its_colour():
    scene = tl.Scene.from_mujoco(
        arm(f'<spatial rgba="1 0 1 1" width=".02">{PATHS["sphere past a side site"]}</spatial>')
    )
    seen, dynamics = scene_parts(scene), tl.Dynamics(scene)
    view = Camera((0.2, 2.3, 2.1), (0.0, 0.0, 1.0))
    for angle in (0.0, 0.6):
        body_q = dynamics.forward_kinematics(np.array([[angle]]))
        shown = SimpleNamespace(body_q=body_q)
        picture = Picture(seen, 320, 240).render(shown, camera=view).astype(int)
        segments = seen.tendons.segments(body_q)
        lengths = np.linalg.norm(segments.ends[0, :, 1] - segments.ends[0, :, 0], axis=-1)
        assert (lengths > 0).sum() > 3
        for ends in segments.ends[0, lengths > 0]:
            red, green, blue = picture[pixel(view, ends.mean(axis=0), 320, 240)]
            assert min(red, blue) > green + 40
        touching = Picture(seen, 320, 240, kind="collision").render(shown, camera=view).astype(int)
        assert not np.any(touching[..., [0, 2]].min(axis=-1) > touching[..., 1] + 40)


def test_a_still_shows_how_active_a_muscle_is():
    scene = tl.Scene.from_mujoco(
        arm(f'<spatial name="t" width=".03">{PATHS["straight"]}</spatial>', '<muscle tendon="t" lengthrange=".5 2"/>')
    )
    seen = scene_parts(scene)
    body_q = tl.Dynamics(scene).forward_kinematics(np.array([[0.0], [0.0]]))
    view = Camera((0.0, -2.5, 1.5), (0.0, 0.0, 1.0))
    middle = pixel(view, np.array([-0.35, 0, 1.0]), 320, 240)
    pictures = [
        Picture(seen, 320, 240).render(
            SimpleNamespace(body_q=body_q, act=np.array([[1.0], [act]])), worlds=[1], camera=view
        )
        for act in (0.0, 1.0)
    ]
    rest, work = (picture[middle].astype(int) for picture in pictures)
    assert np.ptp(rest) < 40 and work[0] > work[2] + 60


def test_models_side_by_side_have_their_own_tendons_and_muscles():
    line = PATHS["straight"]
    first = arm(f'<spatial name="t">{line}</spatial>', '<muscle tendon="t" lengthrange=".5 2"/>')
    scene = tl.Scene.from_mujoco(first)
    turn = (0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5))
    scene.add_mujoco(
        arm(f'<spatial name="t">{line}</spatial>', '<muscle tendon="t" lengthrange=".5 2"/>'),
        name="b",
        pos=(2, 0, 0),
        quat=turn,
    )
    made = scene_parts(scene).tendons
    assert made.muscles.tolist() == [[0, 0], [1, 1]]
    ends = made.segments(tl.Dynamics(scene).forward_kinematics(np.zeros((1, 2)))).ends[0]
    pose = np.array([2, 0, 0, *turn])
    np.testing.assert_allclose(ends[1], place(pose, ends[0]), atol=1e-6)


def test_a_file_of_an_older_version_shows_no_tendons(tmp_path):
    scene = tl.Scene.from_mujoco(arm(f"<spatial>{PATHS['straight']}</spatial>"))
    scene.save(tmp_path / "scene.toml")
    (file,) = (tmp_path / "scene_models").iterdir()
    arrays = {name: array for name, array in load_file(file).items() if not name.startswith(("light_", "vis."))}
    for name in ("tendon_width", "tendon_rgba", "tendon_group", "tendon_matid"):
        del arrays[name]
    save_file(arrays, file)
    assert len(scene_parts(scene).tendons) == 1
    assert len(scene_parts(tl.Scene.load(tmp_path / "scene.toml")).tendons) == 0


def test_looks_of_tendons_change_no_physics():
    one, other = (
        tl.Dynamics(tl.Scene.from_mujoco(arm(f"<spatial {looks}>{PATHS['sphere']}</spatial>"))).model_hash
        for looks in ('width=".1"', 'rgba="1 0 0 1" group="4"')
    )
    assert one == other


def test_a_tendon_that_a_model_is_made_without_is_not_seen():
    scene = tl.Scene.from_mujoco(arm(f'<spatial name="t">{PATHS["sphere"]}</spatial>'), without=("t",))
    assert len(scene_parts(scene).tendons) == 0


def test_the_page_has_the_pieces_of_all_worlds_in_two_batches():
    model = arm(f'<spatial rgba="1 0 0 1" width=".02">{PATHS["sphere past a side site"]}</spatial>')
    data, made, options = mujoco.MjData(model), tendons_of(model), DisplayOptions()
    mujoco.mj_forward(model, data)
    body_q = np.tile(body_poses(data), (2, 1, 1))
    offsets = np.array([[0, 0, 0], [3.0, 0, 0]])
    server = guarded_server.start(Gate("127.0.0.1"), "127.0.0.1", 0)
    try:
        meshes = TendonMeshes(server, made, options)
        meshes.show(SimpleNamespace(body_q=body_q), (0, 1), offsets)
        tubes, balls = meshes._handles["tubes"], meshes._handles["balls"]
        ends = made.segments(body_q).ends + offsets[:, None, None]
        first, last = ends.reshape(-1, 2, 3).swapaxes(0, 1)
        np.testing.assert_allclose(tubes.batched_positions, first, atol=1e-6)
        turns = np.asarray(tubes.batched_wxyzs)[:, [1, 2, 3, 0]]
        for k, (start, turn, scale) in enumerate(zip(first, turns, np.asarray(tubes.batched_scales), strict=True)):
            pose = np.concatenate([start, turn]).astype(float)
            np.testing.assert_allclose(place(pose, np.array([[0, 0, scale[2]]]))[0], last[k], atol=1e-5)
            np.testing.assert_allclose(scale[:2], 0.02)
        assert len(balls.batched_positions) == 2 * len(first)
        assert np.all(np.asarray(tubes.batched_colors) == [255, 0, 0])
        meshes.show(SimpleNamespace(body_q=body_q), (1,), offsets)
        assert len(tubes.batched_positions) == len(first) // 2 and tubes.visible
        options.choose(kind="collision")
        meshes.show(SimpleNamespace(body_q=body_q), (1,), offsets)
        assert not tubes.visible and not balls.visible
    finally:
        server.stop()
