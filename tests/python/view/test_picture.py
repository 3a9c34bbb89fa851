"""Pictures without a display: what is where, in which colour, and the same bytes each time."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import tightloop as tl
from conftest import URDF
from tightloop import _core
from tightloop.view import Camera, Picture
from tightloop.view.parts import Parts, parts
from tightloop.view.poses import place

WIDTH, HEIGHT = 240, 180
READY = [0.0, -0.6, 0.0, -2.2, 0.0, 1.7, 0.8, 0.03, 0.03]
BENT = [0.9, 0.2, 0.0, -1.2, 0.0, 1.7, 0.8, 0.0, 0.0]
# From below the floor, which is seen from above only: nothing but the arm and the sky is in the picture
BELOW = Camera((1.6, -1.2, -0.6), (0.2, 0.0, 0.45))


class Arm:
    """The FR3, and where its links are."""

    def __init__(self) -> None:
        scene = tl.Scene(dt=1 / 480, substeps=8)
        scene.add_urdf(URDF, name="arm")
        self.dynamics = tl.Dynamics(scene)
        self.parts: Parts = parts(scene.to_toml(), "/", self.dynamics.body_names)

    def shown(self, *joint_q: list[float], **fields: Any) -> SimpleNamespace:
        """A frame with a world at each of these positions."""
        return SimpleNamespace(body_q=self.dynamics.forward_kinematics(np.array(joint_q)), **fields)


@pytest.fixture(scope="module")
def arm() -> Arm:
    return Arm()


def drawn(arm: Arm, shown: Any, **options: Any) -> NDArray[np.int16]:
    return Picture(arm.parts, WIDTH, HEIGHT).render(shown, **options).astype(np.int16)


def empty(camera: Camera) -> NDArray[np.int16]:
    """The same picture without anything in it."""
    return (
        Picture([], WIDTH, HEIGHT).render(SimpleNamespace(body_q=np.zeros((1, 0, 7))), camera=camera).astype(np.int16)
    )


def redness(picture: NDArray[Any]) -> NDArray[Any]:
    """By how much red is above the other colours."""
    return picture[..., 0].astype(int) - picture[..., 1:].max(axis=-1)


def pixels_of(camera: Camera, points: NDArray[Any]) -> NDArray[np.float64]:
    """Where points of the world are in the picture, columns and rows, ``(n, 2)``."""
    eye, target = np.array(camera.position), np.array(camera.target)
    into = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(into, camera.up)
    right /= np.linalg.norm(right)
    up = np.cross(right, into)
    away = points - eye
    scale = 0.5 * HEIGHT / np.tan(0.5 * camera.fov) / (away @ into)
    return np.stack([0.5 * WIDTH + scale * (away @ right), 0.5 * HEIGHT - scale * (away @ up)], axis=-1)


@pytest.mark.parametrize("joint_q", [READY, BENT])
def test_the_arm_is_seen_where_forward_kinematics_has_it(arm: Arm, joint_q: list[float]) -> None:
    shown = arm.shown(joint_q)
    changed = np.abs(drawn(arm, shown, camera=BELOW) - empty(BELOW)).sum(axis=-1) > 12
    rows, columns = np.nonzero(changed)
    corners = [
        place(shown.body_q[0, part.body], place(part.pose, part.mesh.vertices))
        for part in arm.parts
        if part.kind == "visual"
    ]
    expected = pixels_of(BELOW, np.concatenate(corners))
    assert expected.min() > 5 and (expected < [WIDTH - 5, HEIGHT - 5]).all(), "the test wants all of it in the picture"
    found = np.array([[columns.min(), rows.min()], [columns.max() + 1, rows.max() + 1]])
    # a pixel is changed where a quarter of it is covered
    np.testing.assert_allclose(found, [expected.min(axis=0), expected.max(axis=0)], atol=1.0)


def test_two_poses_differ_and_the_same_one_has_the_same_bytes(arm: Arm) -> None:
    picture = Picture(arm.parts, WIDTH, HEIGHT)
    one, other = picture.render(arm.shown(READY)), picture.render(arm.shown(BENT))
    assert one.shape == (HEIGHT, WIDTH, 3) and one.dtype == np.uint8
    assert (np.abs(one.astype(int) - other).sum(axis=-1) > 60).mean() > 0.02
    assert picture.render(arm.shown(READY)).tobytes() == one.tobytes()
    for threads in (1, 3):
        assert Picture(arm.parts, WIDTH, HEIGHT, threads=threads).render(arm.shown(READY)).tobytes() == one.tobytes()


def test_a_world_among_others_is_drawn_as_alone(arm: Arm) -> None:
    many = arm.shown(READY, BENT, READY)
    alone = drawn(arm, arm.shown(BENT))
    np.testing.assert_array_equal(drawn(arm, many, worlds=[1], world=1), alone)
    np.testing.assert_array_equal(drawn(arm, many, worlds=1), drawn(arm, arm.shown(READY)))


def test_worlds_stand_beside_each_other(arm: Arm) -> None:
    picture = Picture(arm.parts, WIDTH, HEIGHT)
    top = picture.render(arm.shown(READY, READY, READY, READY), camera="top")
    assert picture.offsets.shape == (4, 3)
    steps = np.linalg.norm(picture.offsets[1:] - picture.offsets[0], axis=-1)
    assert steps.min() > 0.5, "the arm is that large"
    # four arms on a square: what is in one quarter is in the others, the same view but for the perspective
    light = (top.min(axis=-1) > 225).astype(int)
    quarters = [half.sum() for row in np.array_split(light, 2) for half in np.array_split(row, 2, axis=1)]
    assert min(quarters) > 30 and max(quarters) < 3 * min(quarters)


@pytest.mark.parametrize("camera", ["three-quarter", "front", "side", "top"])
def test_a_preset_sees_all_of_it(arm: Arm, camera: str) -> None:
    for worlds in (1, 9):
        picture = Picture(arm.parts, WIDTH, HEIGHT)
        # frozen worlds are red, their shadows are not
        shown = arm.shown(*[READY] * worlds, status=np.ones(worlds, int))
        there = redness(picture.render(shown, camera=camera))
        shown.body_q[:] = np.nan
        seen = there - redness(picture.render(shown, camera=camera)) > 25
        assert 0.03 < seen.mean() < 0.4
        assert not np.concatenate([seen[0], seen[-1], seen[:, 0], seen[:, -1]]).any()


def test_follow_goes_along(arm: Arm) -> None:
    picture = Picture(arm.parts, WIDTH, HEIGHT)
    near = arm.shown(READY)
    far = arm.shown(READY)
    # by whole lines of the floor, whose axes alone are left behind
    far.body_q[..., :2] += [64.0, -32.0]
    here, there = (picture.render(shown, camera="follow").astype(int) for shown in (near, far))
    arms = (here.min(axis=-1) > 225) | (there.min(axis=-1) > 225)
    assert arms.sum() > 300
    assert np.abs(here - there)[arms].mean() < 8
    assert np.abs(here - picture.render(far, camera="three-quarter")).mean() > 3 * np.abs(here - there).mean()


def test_a_frozen_world_is_red(arm: Arm) -> None:
    for status, reddish in ((0, False), (1, True), (8, True), (4, False)):
        picture = drawn(arm, arm.shown(READY, status=np.array([status])), camera=BELOW)
        assert (redness(picture) > 40).any() == reddish


def test_what_is_not_finite_is_left_out(arm: Arm) -> None:
    shown = arm.shown(READY)
    shown.body_q[0, :] = np.nan
    np.testing.assert_array_equal(drawn(arm, shown, camera=BELOW), empty(BELOW))


def test_contacts_are_points_and_forces(arm: Arm) -> None:
    places = np.zeros((1, 4, 3))
    places[0, 0] = [0.5, -0.3, 0.3]
    # beyond contact_count nothing is drawn
    places[0, 1] = [0.5, 0.3, 0.3]
    forces = np.zeros((1, 4, 3))
    forces[0, :2] = [0.0, 0.0, 20.0]
    told = {"contact_count": np.array([1]), "contact_pos": places, "contact_force": forces}
    shown = arm.shown(READY, **told)
    with_contacts, without = drawn(arm, shown, camera=BELOW), drawn(arm, shown, camera=BELOW, contacts=False)
    np.testing.assert_array_equal(without, drawn(arm, arm.shown(READY), camera=BELOW))
    rows, columns = np.nonzero(np.abs(with_contacts - without).sum(axis=-1) > 30)
    # a centimetre a newton, with a dot of 6 pixels at its begin
    ends = pixels_of(BELOW, np.array([[0.5, -0.3, 0.3], [0.5, -0.3, 0.5]]))
    found = np.array([[columns.min(), rows.min()], [columns.max() + 1, rows.max() + 1]])
    np.testing.assert_allclose(found, [ends.min(axis=0) - 3, ends.max(axis=0) + 3], atol=2.5)
    column, row = ends.mean(axis=0).astype(int)
    red, green, blue = with_contacts[row, column]
    assert red > green + 100 and red > blue + 100
    column, row = ends[0].astype(int)
    assert with_contacts[row, column, 0] > 200 and with_contacts[row, column, 2] < 90


def test_a_ghost_and_goals_are_drawn_over_it(arm: Arm) -> None:
    shown = arm.shown(READY, BENT)
    plain = drawn(arm, shown, worlds=[1], world=1, camera=BELOW)
    ghost = drawn(arm, shown, worlds=[1], world=1, camera=BELOW, ghost=shown.body_q[0])
    changed = np.abs(ghost - plain).sum(axis=-1) > 12
    # a blue shade where the other arm is
    assert changed.sum() > 300 and (ghost - plain)[changed].mean(axis=0).argmax() == 2
    goal = np.array([[9.0, 9.0, 9.0], [0.45, -0.35, 0.5]])
    marked = drawn(arm, shown, worlds=[1], world=1, camera=BELOW, goals={"goal": (goal, 0.05, (20, 200, 60))})
    rows, columns = np.nonzero(np.abs(marked - plain).sum(axis=-1) > 12)
    middle = [columns.mean() + 0.5, rows.mean() + 0.5]
    np.testing.assert_allclose(middle, pixels_of(BELOW, goal[1:])[0], atol=1.5)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"camera": "behind"}, "three-quarter"),
        ({"worlds": [0, 7]}, "no world 7"),
        ({"worlds": 0}, "worlds is 0"),
        ({"worlds": [0.5]}, "worlds"),
        ({"worlds": [0], "world": 1}, "world is 1"),
        ({"goals": {"there": (np.zeros(3), 0.1, (0, 0, 0))}}, "there"),
    ],
)
def test_wrong_arguments_are_named(arm: Arm, options: dict[str, Any], said: str) -> None:
    with pytest.raises(tl.ArgumentError, match=said):
        drawn(arm, arm.shown(READY, BENT), **options)


def test_wrong_sizes_kinds_and_frames_are_named(arm: Arm) -> None:
    for width, said in ((3, "width"), (10_000, "8192"), (2.5, "width")):
        with pytest.raises(tl.ArgumentError, match=said):
            Picture(arm.parts, width)  # pyright: ignore[reportArgumentType]
    with pytest.raises(tl.ArgumentError, match="collision"):
        Picture(arm.parts, kind="nice")  # pyright: ignore[reportArgumentType]
    with pytest.raises(tl.ArgumentError, match="body_q"):
        drawn(arm, SimpleNamespace())
    with pytest.raises(tl.ArgumentError, match="position is nan; give a finite number"):
        Camera((np.nan, 0, 0), (0, 0, 0))
    with pytest.raises(tl.ArgumentError, match="fov is 4; give less than π"):
        Camera((1, 0, 0), (0, 0, 0), fov=4.0)


def test_the_renderer_refuses_arrays_that_do_not_fit() -> None:
    renderer = _core.Renderer(32, 24)
    corners, face, color = np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.uint32), np.zeros((1, 4), np.uint8)
    for arrays, said in (
        ((corners[:, :2].copy(), face, color), "vertices"),
        ((corners, face + 1, color), "face 0"),
        ((corners * np.float32(np.nan), face, color), "vertex 0"),
        ((corners, face, color[:0]), "colour"),
    ):
        with pytest.raises(tl.ArgumentError, match=said):
            renderer.add(*arrays)
    assert renderer.add(corners, face, color) == 0

    def render(mesh: int = 0, poses: int = 1, reach: float = 1.0) -> NDArray[np.uint8]:
        return renderer.render(
            ((2, 2, 2), (0, 0, 0), (0, 0, 1)),
            0.6,
            (0, 0, 0, reach),
            None,
            np.array([mesh], np.uint32),
            np.tile([0.0, 0, 0, 0, 0, 0, 1], (poses, 1)),
            np.zeros((1, 4), np.uint8),
            np.ones(1, np.float32),
            np.zeros((0, 6)),
            np.zeros((0, 4), np.uint8),
            np.zeros(0, np.float32),
        )

    assert render().shape == (24, 32, 3)
    with pytest.raises(tl.ArgumentError, match="meshes"):
        render(mesh=1)
    with pytest.raises(tl.ArgumentError, match="poses"):
        render(poses=2)
    with pytest.raises(tl.ArgumentError, match="camera"):
        render(reach=0.0)
