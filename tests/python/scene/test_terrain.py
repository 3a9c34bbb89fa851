"""Height fields of scenes, terrain generators and height scans."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tightloop as tl
from tightloop import terrain

KINDS = {
    "flat": terrain.flat(),
    "rough": terrain.rough(seed=3),
    "slopes": terrain.slopes(seed=3),
    "stairs": terrain.stairs(seed=3),
    "steps": terrain.steps(seed=3),
    "stones": terrain.stones(seed=3),
}


def ball_scene(ground: terrain.Terrain, **surface: Any) -> tl.Scene:
    scene = tl.Scene(dt=0.002, substeps=5)
    ground.add_to(scene, **surface)
    scene.add_body(name="ball", pos=(0, 0, 1), mass=1.0)
    scene.add_sphere(body="ball", radius=0.1)
    return scene


@pytest.mark.parametrize("kind", KINDS)
def test_a_tile_has_a_level_rim_at_zero_and_a_level_middle(kind: str) -> None:
    ground = KINDS[kind]
    z, middle = ground.elevation, ground.elevation.shape[0] // 2
    rim = np.concatenate([z[0], z[-1], z[:, 0], z[:, -1]])
    assert not rim.any() and np.isfinite(z).all()
    around = z[middle - 3 : middle + 4, middle - 3 : middle + 4]
    assert np.ptp(around) == 0 and ground.starts[0, 0, 2] == z[middle, middle]
    assert (np.ptp(z) > 0.05) == (kind != "flat")


def test_a_seed_gives_the_same_terrain_and_another_seed_another_one() -> None:
    first, again, other = (terrain.mixed(levels=3, seed=seed) for seed in (5, 5, 6))
    np.testing.assert_array_equal(first.elevation, again.elevation)
    np.testing.assert_array_equal(first.starts, again.starts)
    assert (first.elevation != other.elevation).mean() > 0.1


def test_a_tile_of_a_grid_depends_on_its_place_and_not_on_the_grid() -> None:
    small, large = (
        terrain.mixed(("rough", "steps"), levels=levels, hardest={"steps": 0.2 * levels}) for levels in (2, 4)
    )
    first = small.elevation[40:121, 121:201], large.elevation[40:121, 121:201]
    np.testing.assert_allclose(*first, atol=1e-12)


def test_levels_become_harder_and_starts_lie_on_the_ground() -> None:
    ground = terrain.mixed(levels=5, seed=1)
    assert ground.starts.shape == (5, 6, 3) and ground.levels == 5
    np.testing.assert_allclose(
        ground.height(ground.starts[..., 0], ground.starts[..., 1]), ground.starts[..., 2], atol=1e-9
    )
    spans = []
    for level in range(5):
        x, y = ground.starts[level, 3, :2]
        along = np.linspace(-4, 4, 81)
        spans.append(np.ptp(ground.height(x + along, np.full(81, y))))
    assert (np.diff(spans) > 0).all()


def test_heights_between_samples_lie_on_two_triangles() -> None:
    ground = terrain.Terrain(np.array([[0.0, 1.0], [2.0, 5.0]]), 2.0, np.zeros((1, 1, 3)), ("flat",))
    for x, y, z in [(-1, -1, 0), (1, -1, 1), (-1, 1, 2), (1, 1, 5), (0, 0, 2.5), (0.5, -0.5, 1.75), (-0.5, 0.5, 2.25)]:
        assert ground.height(x, y) == pytest.approx(z)


@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_cubes_come_to_rest_on_stairs(precision: str) -> None:
    ground = terrain.stairs(step=0.1, seed=2)
    scene = tl.Scene(dt=0.002, substeps=5)
    ground.add_to(scene)
    scene.add_body(name="cube", pos=(0, 0, 1), mass=1.0)
    scene.add_box(body="cube", half_extents=(0.1, 0.1, 0.1))
    places = np.random.default_rng(0).uniform(-3.5, 3.5, (64, 2))
    with tl.launch(scene, worlds=64, precision=precision, fields=("joint_q", "joint_qd", "contact_count")) as sim:
        q = sim.reset().joint_q.copy()
        q[:, :2], q[:, 2] = places, ground.height(*places.T) + 0.4
        frame = sim.write(joint_q=q)
        for _ in range(300):
            frame = sim.step()
        assert not (frame.status & 9).any() and (frame.contact_count > 0).all()
        assert (abs(frame.joint_qd).max(1) < 0.02).mean() > 0.9
        x, y, z = np.array(frame.joint_q, float)[:, :3].T
        # no centre is nearer to the ground than the half of a cube's edge, but for what contacts give way
        assert (z - ground.height(x, y) > 0.095).all() and (z - ground.height(x, y) < 0.2).all()


def test_contacts_are_the_same_far_from_the_origin() -> None:
    """In f32 an eighth of a metre is exact up to 2^20 m: only the field's place differs."""
    ground = terrain.Terrain(
        np.floor(terrain.rough(cell=0.125).elevation * 1024) / 1024, 0.125, np.zeros((1, 1, 3)), ("rough",)
    )
    found = []
    for far in (0.0, 512.0):
        scene = tl.Scene(dt=0.002)
        ground.add_to(scene, pos=(far, -far, 0))
        scene.add_body(name="ball", pos=(0, 0, 1), mass=1.0)
        scene.add_sphere(body="ball", radius=0.1)
        rng = np.random.default_rng(1)
        q = np.zeros((200, 7), np.float32)
        # places that f32 has at both distances
        q[:, :2] = np.round(rng.uniform(-3, 3, (200, 2)) * 1024) / 1024
        q[:, 2] = ground.height(*q[:, :2].T.astype(float)) + np.round(rng.uniform(0, 0.1, 200) * 1024) / 1024
        q[:, 2], q[:, 6] = np.round(q[:, 2] * 1024) / 1024, 1
        q[:, 0] += far
        q[:, 1] -= far
        fields = ("contact_count", "contact_distance", "contact_normal")
        with tl.launch(scene, worlds=200, precision="f32", fields=fields) as sim:
            frame = sim.write(joint_q=q)
            found.append([np.array(getattr(frame, field)) for field in fields])
    (count, distance, normal), (other_count, other_distance, other_normal) = found
    assert count.sum() > 150
    np.testing.assert_array_equal(count, other_count)
    used = np.arange(distance.shape[1]) < count[:, None]
    np.testing.assert_array_equal(distance[used], other_distance[used])
    np.testing.assert_array_equal(normal[used], other_normal[used])


@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_a_height_scan_is_the_height_of_its_frame_above_the_ground(precision: str) -> None:
    ground = terrain.mixed(levels=2, seed=4)
    scene = ball_scene(ground)
    scan = scene.add_height_scan(body="ball", pos=(0.2, 0, 0.1), size=(1.6, 1.0), shape=(17, 11), reach=3.0)
    one = scene.add_height_scan(body="ball", shape=(1, 1))
    rng = np.random.default_rng(2)
    q = np.zeros((50, 7))
    width, length = ground.size
    q[:, 0], q[:, 1] = rng.uniform(-0.5, 0.5, 50) * width, rng.uniform(-0.5, 0.5, 50) * length
    q[:, 2] = rng.uniform(0, 2, 50)
    turns = rng.normal(size=(50, 4))
    q[:, 3:] = turns / np.linalg.norm(turns, axis=1)[:, None]
    with tl.launch(scene, worlds=50, precision=precision, fields=("height_scan",)) as sim:
        found = np.array(sim.write(joint_q=q).height_scan)
    assert found.shape == (50, 17 * 11 + 1) and one.rays == slice(187, 188)
    q = q.astype(np.float32 if precision == "f32" else np.float64).astype(float)
    a, b, c, d = q[:, 3:].T
    forward = np.array([1 - 2 * (b * b + c * c), 2 * (a * b + c * d)])
    yaw = np.arctan2(forward[1], forward[0])
    axes = np.stack(
        [
            [1 - 2 * (b * b + c * c), 2 * (a * b + c * d), 2 * (a * c - b * d)],
            [2 * (a * c + b * d), 2 * (b * c - a * d), 1 - 2 * (a * a + b * b)],
        ]
    ).transpose(2, 0, 1)
    middle = q[:, :3] + 0.2 * axes[:, 0] + 0.1 * axes[:, 1]
    i, j = np.meshgrid(np.linspace(-0.8, 0.8, 17), np.linspace(-0.5, 0.5, 11))
    i, j = i.ravel()[None], j.ravel()[None]
    x = middle[:, :1] + np.cos(yaw)[:, None] * i - np.sin(yaw)[:, None] * j
    y = middle[:, 1:2] + np.sin(yaw)[:, None] * i + np.cos(yaw)[:, None] * j
    expected = np.minimum(middle[:, 2:] - ground.height(x, y), 3.0)
    inside = (abs(x) < 0.5 * width) & (abs(y) < 0.5 * length)
    # where the ground is a wall, one cell wide, rounding moves a ray up or down it
    close = abs(found[:, scan.rays] - expected) < (1e-9 if precision == "f64" else 2e-4)
    assert inside.mean() > 0.9 and close[inside].all()
    assert (
        found[:, scan.rays][~inside & (abs(abs(x) - 0.5 * width) > 1e-3) & (abs(abs(y) - 0.5 * length) > 1e-3)] == 3.0
    ).all()


def test_a_scan_sees_planes_where_there_is_no_field() -> None:
    scene = ball_scene(terrain.flat())
    scene.add_ground(z=-0.5)
    scene.add_height_scan(body="ball", shape=(1, 1))
    q = np.array([[0, 0, 1, 0, 0, 0, 1], [50, 0, 1, 0, 0, 0, 1.0]])
    with tl.launch(scene, worlds=2, precision="f64", fields=("height_scan",)) as sim:
        np.testing.assert_allclose(sim.write(joint_q=q).height_scan[:, 0], [1.0, 1.5])


def test_a_saved_scene_has_its_field_and_its_scan(tmp_path: Path) -> None:
    scene = ball_scene(KINDS["stairs"], mu=0.7)
    scene.add_height_scan(body="ball", pos=(0, 0, 0.1), shape=(5, 3), size=(0.4, 0.3), reach=2.0, name="eyes")
    scene.save(tmp_path / "hills.toml")
    again = tl.Scene.load(tmp_path / "hills.toml")
    field = again.shapes["terrain"]
    assert field.path is not None and field.path == tmp_path / "hills_fields" / "terrain.npy" and field.mu == 0.7
    np.testing.assert_array_equal(np.load(field.path), KINDS["stairs"].elevation)
    eyes, own = again.height_scans["eyes"], scene.height_scans["eyes"]
    assert eyes.counts == own.counts and eyes.reach == own.reach
    np.testing.assert_allclose(eyes.spacing, own.spacing)


@pytest.mark.parametrize(
    ("message", "elevation", "size"),
    [
        (r"elevation has shape \(3,\)", np.zeros(3), (1, 1)),
        (r"elevation is nan at \(1, 2\)", np.array([[0, 0, 0], [0, 0, np.nan]]), (1, 1)),
        ("elevation is str|no such file|No such file", "there_is_no.npy", (1, 1)),
        ("smallest of size", np.zeros((3, 3)), (1, 0)),
        ("size has 3 values", np.zeros((3, 3)), (1, 1, 1)),
    ],
)
def test_wrong_elevations_and_sizes_are_named(message: str, elevation: np.ndarray, size: tuple) -> None:
    with pytest.raises(tl.SceneError, match=message):
        tl.Scene().add_hfield(elevation, size=size)


@pytest.mark.parametrize("kinds", [(), None, "rough", ("rough", "sea")])
def test_wrong_kinds_are_named(kinds: Any) -> None:
    with pytest.raises(tl.SceneError, match="terrain: kind"):
        terrain.mixed(kinds)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: tl.terrain.stairs(step_height=0.1), "stairs: there is no argument `step_height`"),  # pyright: ignore[reportCallIssue]
        (lambda: tl.terrain.mixed(hardest={"stair": 0.3}), "hardest has 'stair', .*did you mean `stairs`"),
        (lambda: tl.terrain.mixed(hardest={"steps": float("nan")}), "hardest steps is nan"),
        (lambda: tl.terrain.mixed(hardest={"steps": -1.0}), "hardest steps is -1"),
        (lambda: tl.terrain.mixed(hardest=0.3), r"hardest is 0\.3; give a dict"),  # pyright: ignore[reportArgumentType]
        (lambda: tl.terrain.rough(seed=1.5), r"seed is 1\.5; give a whole number"),  # pyright: ignore[reportArgumentType]
        (lambda: tl.terrain.mixed(levels=10**6), "elevations are more than .* fewer levels"),
        (lambda: tl.terrain.mixed(border=1e5), "elevations are more than"),
        (lambda: tl.terrain.rough(cell=1e-9), "give a larger cell"),
        (lambda: tl.terrain.steps(tile=1e300), "give a larger cell, a smaller tile"),
    ],
)
def test_what_terrain_cannot_be_is_refused_at_once_by_name(make, message):
    with pytest.raises(tl.TightloopError, match=message):
        make()


def test_a_scan_without_ground_is_refused() -> None:
    scene = tl.Scene()
    scene.add_body(name="ball", mass=1.0)
    scene.add_sphere(body="ball", radius=0.1)
    scene.add_height_scan(body="ball")
    with pytest.raises(tl.TightloopError, match="no plane or height field"):
        tl.launch(scene, worlds=1)
