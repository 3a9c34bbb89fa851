"""What pictures frame: robots and free bodies fill them, whatever else stands in the scene."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

import tightloop as tl
from conftest import URDF
from tightloop.view import Camera, Film, Picture
from tightloop.view.framing import Framing
from tightloop.view.meshes.outlines import outline
from tightloop.view.parts import Mesh, Parts, parts

READY = [0.0, -0.6, 0.0, -2.2, 0.0, 1.7, 0.8, 0.03, 0.03]
STRAIGHT = [0.0, 0.0, 0.0, -0.1, 0.0, 0.6, 0.8, 0.03, 0.03]
SIZE = (320, 240)
# The least part of a picture's width or height that robots and free bodies span.
LEAST = 2 / 3
INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
ROD = (
    '<visual><origin xyz="0 0 -0.5"/><geometry><cylinder radius="0.02" length="1"/></geometry></visual>'
    '<visual><origin xyz="0 0 -1"/><geometry><sphere radius="0.08"/></geometry></visual>'
)
PENDULUM = (
    f'<robot name="p"><link name="base">{INERTIAL}</link><link name="rod">{ROD}{INERTIAL}</link>'
    '<joint name="j" type="continuous"><parent link="base"/><child link="rod"/><origin xyz="0 0 1.5"/>'
    '<axis xyz="0 1 0"/></joint></robot>'
)
LEG = (
    '<link name="{0}"><visual><origin xyz="0 0 -0.15"/><geometry><cylinder radius="0.03" length="0.3"/></geometry>'
    f'</visual>{INERTIAL}</link><joint name="hip_{{0}}" type="continuous"><parent link="trunk"/><child link="{{0}}"/>'
    '<origin xyz="{1} 0 0"/><axis xyz="0 1 0"/></joint>'
)
WALKER = (
    f'<robot name="w"><link name="trunk"><visual><geometry><box size="0.6 0.2 0.15"/></geometry></visual>{INERTIAL}'
    f"</link>{LEG.format('front', 0.25)}{LEG.format('rear', -0.25)}</robot>"
)


class Case:
    """A scene, and one state of it."""

    def __init__(self, scene: tl.Scene, joint_q: list[float]) -> None:
        self.scene, self.dynamics = scene, tl.Dynamics(scene)
        self.joint_q = joint_q
        self.parts: Parts = parts(scene.to_toml(), "/", self.dynamics.body_names)

    def poses(self, worlds: int = 1) -> NDArray[np.float64]:
        """Body poses of equal worlds."""
        return np.repeat(self.dynamics.forward_kinematics(np.array([self.joint_q])), worlds, axis=0)

    def span(self, body_q: NDArray[Any], picture: Picture | None = None, **options: Any) -> NDArray[np.float64]:
        """Return the parts of a picture's width and height that robots and free bodies span, all in the picture."""
        picture = picture or Picture(self.parts, *SIZE)
        seen = reddened(picture, body_q, options)
        # what stands still turns red too, and is all that is drawn where no pose is finite
        if any(part.body < 0 and part.shape != "plane" for part in self.parts):
            seen &= ~reddened(picture, body_q * np.nan, options)
        rows, columns = np.nonzero(seen)
        last = np.array(seen.shape) - 1
        assert min(rows.min(), columns.min()) > 0 and rows.max() < last[0] and columns.max() < last[1]
        return np.array([(np.ptp(columns) + 1) / seen.shape[1], (np.ptp(rows) + 1) / seen.shape[0]])


def redness(picture: NDArray[Any]) -> NDArray[Any]:
    """By how much red is above the other colours."""
    return picture[..., 0].astype(int) - picture[..., 1:].max(axis=-1)


def reddened(picture: Picture, body_q: NDArray[Any], options: dict[str, Any]) -> NDArray[np.bool_]:
    """Return the pixels of parts, which are red in frozen worlds; their shadows are not."""
    frames = [SimpleNamespace(body_q=body_q, status=np.full(len(body_q), status)) for status in (1, 0)]
    red, plain = (picture.render(frame, **options).astype(int) for frame in frames)
    return np.abs(red - plain).sum(axis=-1) > 40


def scene_of(folder: Path, text: str, **options: Any) -> tl.Scene:
    path = folder / "robot.urdf"
    path.write_text(text)
    scene = tl.Scene(dt=1 / 480, substeps=8)
    scene.add_urdf(path, name="robot", **options)
    scene.add_ground()
    return scene


def pendulum(folder: Path) -> Case:
    return Case(scene_of(folder, PENDULUM), [0.4])


def walker(folder: Path) -> Case:
    return Case(scene_of(folder, WALKER, floating=True), [0, 0, 0.4, 0, 0, 0, 1, 0.3, -0.3])


def arm(_: Path) -> Case:
    scene = tl.Scene(dt=1 / 480, substeps=8)
    scene.add_urdf(URDF, name="arm")
    scene.add_ground()
    return Case(scene, READY)


def workplace(_: Path) -> Case:
    """An arm at a table, and a wall."""
    scene = tl.Scene(dt=1 / 480, substeps=8)
    scene.add_urdf(URDF, name="arm")
    scene.add_table()
    scene.add_cube()
    scene.add_box(half_extents=(1.5, 0.1, 1.0), pos=(2.6, 3, 1), name="wall")
    scene.add_ground()
    return Case(scene, [*READY, 0.1, -0.3, 0.125, 0, 0, 0, 1])


MAKERS = (pendulum, walker, arm, workplace)


@pytest.mark.parametrize("camera", ["three-quarter", "front", "side", "top", "follow"])
@pytest.mark.parametrize("make", MAKERS)
def test_one_world_fills_the_picture(tmp_path: Path, make: Callable[[Path], Case], camera: str) -> None:
    case = make(tmp_path)
    assert case.span(case.poses(), camera=camera).max() > LEAST


def test_arms_that_stretch_out_later_stay_in_the_picture_in_each_of_several_worlds(tmp_path: Path) -> None:
    case, picture = arm(tmp_path), Picture(arm(tmp_path).parts, 320, 200)
    case.span(case.poses(4), picture, worlds=4)
    for turned in (0.0, -0.8, 2.4):
        case.joint_q = [turned, 1.4, 0, -0.1, 0, 2.4, 0.8, 0, 0]
        case.span(case.poses(4), picture, worlds=4)


@pytest.mark.parametrize("camera", ["three-quarter", "front", "side", "top"])
@pytest.mark.parametrize("make", [pendulum, walker, arm])
def test_a_grid_of_worlds_fills_the_picture(tmp_path: Path, make: Callable[[Path], Case], camera: str) -> None:
    case = make(tmp_path)
    assert case.span(case.poses(16), camera=camera).max() > LEAST


@pytest.mark.parametrize("size", [(640, 160), (160, 640)])
def test_pictures_of_any_shape_are_filled(tmp_path: Path, size: tuple[int, int]) -> None:
    case = arm(tmp_path)
    assert case.span(case.poses(), Picture(case.parts, *size)).max() > LEAST


def test_one_lost_world_does_not_shrink_the_others(tmp_path: Path) -> None:
    case = walker(tmp_path)
    usual, lost = Picture(case.parts, *SIZE), case.poses(16)
    lost[5, :, 2] += 1e4
    frames = [SimpleNamespace(body_q=body_q) for body_q in (case.poses(16), lost)]
    same, other = usual.render(frames[1]), Picture(case.parts, *SIZE).render(frames[1])
    assert usual.render(frames[0]).shape == same.shape
    assert case.span(lost, worlds=[k for k in range(16) if k != 5]).max() > LEAST
    assert np.abs(same.astype(int) - other).max() == 0


def test_a_fixed_robot_stays_in_the_picture_when_it_reaches_out(tmp_path: Path) -> None:
    case = arm(tmp_path)
    picture = Picture(case.parts, *SIZE)
    first = picture.render(SimpleNamespace(body_q=case.poses()))
    # upright, it is half as tall again
    assert case.span(case.dynamics.forward_kinematics(np.array([STRAIGHT])), picture)[1] > LEAST
    np.testing.assert_array_equal(picture.render(SimpleNamespace(body_q=case.poses())), first)


def test_a_goal_beside_the_picture_is_brought_into_it(tmp_path: Path) -> None:
    case = arm(tmp_path)
    goal = {"goal": (np.array([[0.3, 0.9, 0.2]]), 0.05, (20, 200, 60))}
    frame = SimpleNamespace(body_q=case.poses())
    picture = Picture(case.parts, *SIZE)
    picture.render(frame)
    marked = picture.render(frame, goals=goal).astype(int)
    assert ((marked[..., 1] - marked[..., [0, 2]].max(axis=-1)) > 20).sum() > 30


def test_the_camera_follows_what_floats_and_else_stands(tmp_path: Path) -> None:
    walking, standing = walker(tmp_path), arm(tmp_path)
    assert walking.parts.subject.floats and not standing.parts.subject.floats
    picture, away = Picture(walking.parts, *SIZE), walking.poses()
    picture.render(SimpleNamespace(body_q=away))
    away[..., :2] += [7.0, -4.0]
    assert walking.span(away, picture).max() > LEAST
    # a camera that is asked for does not follow
    picture = Picture(walking.parts, *SIZE)
    picture.render(SimpleNamespace(body_q=walking.poses()), camera="three-quarter")
    assert not reddened(picture, away, {"camera": "three-quarter"}).any()
    for case, camera in ((walking, "follow"), (standing, "three-quarter")):
        frame = SimpleNamespace(body_q=case.poses())
        default = Picture(case.parts, *SIZE).render(frame)
        named = Picture(case.parts, *SIZE).render(frame, camera=camera)
        np.testing.assert_array_equal(default, named)


def test_a_film_of_a_floating_robot_does_not_lose_it(tmp_path: Path) -> None:
    case = walker(tmp_path)
    with tl.launch(case.scene, worlds=1, fields=("body_q",)) as sim:
        made = Film(tmp_path / "run", sim, size=SIZE, fps=1)
        body_q = case.poses()
        for second in range(4):
            body_q[..., 0] += float(second)
            made.add(SimpleNamespace(body_q=body_q.copy(), status=np.ones(1, int)), 1.0)
        made.close()
    shares = [(redness(np.asarray(Image.open(file))) > 70).mean() for file in sorted((tmp_path / "run").iterdir())]
    # as much of the robot is seen in each, 6 m from its start
    assert len(shares) == 4 and min(shares) > 0.95 * max(shares) > 0.1


def test_subjects_are_robots_with_their_bases_and_free_bodies(tmp_path: Path) -> None:
    found = workplace(tmp_path)
    names = np.array(found.dynamics.body_names)
    subject = found.parts.subject
    assert not subject.floats
    assert {"arm/fr3_link0", "arm/fr3_hand", "cube/body"} <= set(names[subject.bodies])
    assert "cube/body" not in names[subject.robot] and "arm/fr3_link0" in names[subject.robot]


def test_loose_bodies_are_followed_together() -> None:
    scene = tl.Scene(dt=1 / 480, substeps=8)
    for k in range(3):
        scene.add_box(half_extents=(0.1, 0.1, 0.1), body=scene.add_body(name=f"box{k}", pos=(k, 0, 0.1)))
    case = Case(scene, [x for k in range(3) for x in (float(k), 0, 0.1, 0, 0, 0, 1)])
    assert case.parts.subject.floats and case.parts.subject.robot.tolist() == [0, 1, 2]
    assert case.span(case.poses()).max() > LEAST


def test_contacts_are_off_above_four_worlds_unless_they_are_asked_for(tmp_path: Path) -> None:
    case = arm(tmp_path)
    for worlds, shows in ((4, True), (5, False)):
        contacts = {
            "contact_count": np.ones(worlds, int),
            "contact_pos": np.tile([0.5, -0.3, 0.3], (worlds, 1, 1)),
            "contact_force": np.tile([0.0, 0.0, 20.0], (worlds, 1, 1)),
        }
        frame = SimpleNamespace(body_q=case.poses(worlds), **contacts)
        plain, default, asked = (
            Picture(case.parts, *SIZE).render(frame, contacts=on).tobytes() for on in (False, None, True)
        )
        assert plain != asked and default == (asked if shows else plain)


def test_an_arrow_of_a_large_force_is_as_long_as_a_link(tmp_path: Path) -> None:
    case = arm(tmp_path)
    link = Framing(case.parts.of("visual"), case.parts.subject).link
    assert 0.1 < link < 0.35
    view = Camera((1.5, 0.0, 0.4), (0.0, 0.0, 0.4))
    contacts = {
        "contact_count": np.ones(1, int),
        "contact_pos": np.array([[[0.0, 0.6, 0.2]]]),
        "contact_force": np.array([[[0.0, 0.0, 1e6]]]),
    }
    frame = SimpleNamespace(body_q=case.poses(), **contacts)
    shown, plain = (Picture(case.parts, *SIZE).render(frame, camera=view, contacts=on) for on in (True, False))
    rows, _ = np.nonzero(np.abs(shown.astype(int) - plain).sum(axis=-1) > 30)
    pixels = 0.5 * SIZE[1] / np.tan(0.5 * view.fov) / 1.5
    assert np.ptp(rows) == pytest.approx(pixels * link, abs=10)


def test_an_outline_is_as_large_as_its_mesh_from_any_side() -> None:
    generator = np.random.default_rng(0)
    vertices = generator.normal(size=(5000, 3)) * [1.0, 0.2, 3.0]
    mesh = Mesh(vertices.astype(np.float32), np.zeros((0, 3), np.uint32), np.zeros((0, 4), np.uint8))
    found = outline(mesh)
    assert len(found) <= 256
    directions = generator.normal(size=(100, 3))
    whole, few = ((points @ directions.T).max(axis=0) for points in (mesh.vertices, found))
    np.testing.assert_allclose(few, whole, rtol=0.1)


def test_a_scene_without_robots_is_framed_by_what_stands_in_it() -> None:
    scene = tl.Scene(dt=1 / 480, substeps=8)
    scene.add_box(half_extents=(0.2, 0.2, 0.2), pos=(5, 0, 0.2), name="block")
    look = parts(scene.to_toml(), "/", [])
    points = Framing(look.of("visual"), look.subject).points(np.zeros((1, 0, 7)), np.zeros((1, 3)))
    np.testing.assert_allclose([points.min(axis=0), points.max(axis=0)], [[4.8, -0.2, 0], [5.2, 0.2, 0.4]], atol=1e-6)
    assert Picture(look, *SIZE).render(SimpleNamespace(body_q=np.zeros((1, 0, 7)))).shape == (SIZE[1], SIZE[0], 3)
