"""Pairs of geoms without a closed form, in f64: MuJoCo's points, distances, normals and accelerations, and its runs.

MuJoCo's iterations end at a tolerance, so their result depends on their path. Ours takes the same one. With round
shapes the last bit of a pose may decide where a path goes: ours then is MuJoCo's in a pose that differs by a rounding.
"""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from geom_pairs import UPRIGHT, difference, pair_points
from live_model import Array
from numpy.random import Generator

import tightloop as tl
from tiers import nightly

WORLDS = [500, nightly(5_000)]
#: Poses a rounding away that are tried where the points are not MuJoCo's in the very pose, and that rounding [m or –].
NEIGHBOURS, ROUNDING = 100, 3e-16
#: Share of states that may have another point than all of them.
ELSEWHERE = 0.01
PAIRS = [
    *("sphere ellipsoid", "sphere rock", "capsule ellipsoid", "capsule cylinder", "capsule rock", "capsule drum"),
    *("ellipsoid ellipsoid", "ellipsoid cylinder", "ellipsoid box", "ellipsoid rock", "cylinder cylinder"),
    *("cylinder box", "cylinder rock", "cylinder drum", "box rock", "box brick", "box drum", "rock rock"),
    *("brick brick", "brick drum", "drum drum", "capsule boulder", "box boulder", "boulder boulder"),
]
#: Sizes [m] of the geoms that have one.
SIZES = {
    "sphere": ".1",
    "capsule": ".06 .1",
    "ellipsoid": ".1 .07 .15",
    "cylinder": ".1 .06",
    "box": ".1 .08 .06",
}


def boulder() -> Array:
    """A stone with more corners than tables have."""
    corners = np.random.default_rng(13).normal(size=(1500, 3))
    return corners / np.linalg.norm(corners, axis=1)[:, None] * [0.12, 0.11, 0.1]


def assets(rng: Generator, names: list[str]) -> str:
    """Meshes: a stone of any form, a large one, a cuboid, and a prism with many sides."""
    rock = rng.normal(size=(30, 3))
    rock *= 0.12 / np.linalg.norm(rock, axis=1)[:, None]
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
    angles = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    drum = [[0.1 * np.cos(a), 0.1 * np.sin(a), z] for z in (-0.06, 0.06) for a in angles]
    meshes = {"rock": rock, "boulder": boulder(), "brick": signs * [0.1, 0.08, 0.06], "drum": np.array(drum)}
    texts = {name: " ".join(f"{x:.6f}" for x in vertices.ravel()) for name, vertices in meshes.items()}
    return "".join(f'<mesh name="{name}" vertex="{text}"/>' for name, text in texts.items() if name in names)


def geom(name: str, margin: float) -> str:
    kind = f'type="{name}" size="{SIZES[name]}"' if name in SIZES else f'type="mesh" mesh="{name}"'
    return f'<geom {kind} margin="{margin}" mass="1"/>'


def model_of(rng: Generator, names: str, margin: float, option: str = "", flags: str = "") -> mujoco.MjModel:
    """The first geom of the world, the second on a free body."""
    first, second = names.split()
    exact = 'gravity="0 0 0" tolerance="0" iterations="200" ls_iterations="100"'
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option {exact} {option}>{flags}</option>
        <asset>{assets(rng, names.split())}</asset><worldbody>{geom(first, margin)}
        <body><freejoint/>{geom(second, margin)}</body></worldbody></mujoco>"""
    )


def any_pose(rng: Generator) -> Array:
    way, quat = rng.normal(size=3), rng.normal(size=4)
    return np.hstack([way / np.linalg.norm(way) * rng.uniform(0.05, 0.3), quat / np.linalg.norm(quat)])


def nearly_flat(rng: Generator) -> Array:
    """Axes up to 5 degrees from those of the still geom."""
    quat = np.array(UPRIGHT[rng.integers(len(UPRIGHT))]) + rng.normal(size=4) * rng.choice([0, 1e-6, 1e-3, 0.02])
    return np.hstack([rng.uniform(-0.1, 0.1, 2), rng.uniform(0.1, 0.25), quat / np.linalg.norm(quat)])


def unlike(model: mujoco.MjModel, qpos: Array) -> tuple[list[str], Array]:
    """What is not MuJoCo's in any pose a rounding away, of each state that differs; how many points states have."""
    points, qacc = pair_points(model, qpos)
    rng, data, wrong = np.random.default_rng(11), mujoco.MjData(model), []
    for pose, ours, acceleration in zip(qpos, points, qacc, strict=True):
        text = difference(model, data, pose, ours, acceleration)
        for _ in range(NEIGHBOURS if text else 0):
            near = pose + ROUNDING * rng.normal(size=7)
            if difference(model, data, near, ours, acceleration) is None:
                break
        else:
            wrong += [text] if text else []
    return wrong, np.array([len(row) for row in points])


def assert_mujocos(model: mujoco.MjModel, qpos: Array) -> Array:
    wrong, counts = unlike(model, qpos)
    assert len(wrong) <= ELSEWHERE * len(qpos), f"{len(wrong)} of {len(qpos)}, the first: {wrong[0]}"
    return counts


@pytest.mark.parametrize("worlds", WORLDS)
@pytest.mark.parametrize("margin", [0.0, 0.01])
@pytest.mark.parametrize("names", PAIRS)
def test_points_and_accelerations_are_mujocos(names, margin, worlds):
    rng = np.random.default_rng([7, PAIRS.index(names)])
    qpos = np.array([(any_pose if k % 2 else nearly_flat)(rng) for k in range(worlds)])
    counts = assert_mujocos(model_of(rng, names, margin), qpos)
    assert (counts > 0).mean() > 0.3
    # shapes with faces or edges lie on each other in some states
    is_round = "sphere" in names or "ellipsoid" in names
    assert counts.max() == 1 if is_round else counts.max() >= 2


@pytest.mark.parametrize("option", ['ccd_iterations="4"', 'ccd_tolerance="1e-3"'])
@pytest.mark.parametrize("names", ["cylinder rock", "ellipsoid box"])
def test_a_search_that_ends_early_ends_where_mujocos_does(names, option):
    rng = np.random.default_rng(8)
    model = model_of(rng, names, 0.0, option)
    assert_mujocos(model, np.array([any_pose(rng) for _ in range(300)]))


def test_without_multiccd_each_pair_has_one_point():
    rng = np.random.default_rng(9)
    model = model_of(rng, "box brick", 0.0, flags='<flag multiccd="disable"/>')
    assert assert_mujocos(model, np.array([nearly_flat(rng) for _ in range(200)])).max() == 1


@pytest.mark.parametrize("tolerance", ["0", "-1"])
@pytest.mark.parametrize("names", ["capsule rock", "cylinder brick", "brick drum", "ellipsoid cylinder"])
def test_shapes_with_one_centre_leave_each_other(names, tolerance):
    model = model_of(np.random.default_rng(12), names, 0.001, f'ccd_tolerance="{tolerance}"')
    offsets = np.array([0, 1e-17, 1e-15, 1e-12, 1e-6])
    qpos = np.hstack([offsets[:, None], np.zeros((5, 2)), np.tile([1.0, 0, 0, 0], (5, 1))])
    points, qacc = pair_points(model, qpos)
    assert np.isfinite(qacc).all() and all(np.isfinite(row).all() for row in points)
    # where the centres differ, there is a way out
    assert all(len(row) for row in points[3:])


def test_a_face_with_too_many_corners_has_own_points():
    angles = np.linspace(0, 2 * np.pi, 600, endpoint=False)
    disc = np.array([[0.1 * np.cos(a), 0.1 * np.sin(a), z] for z in (0, 0.02) for a in angles])
    # a rounding of the vertices must not leave the plane
    text = " ".join(f"{x:.9f}" for x in disc.ravel())
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="0.002"/><asset><mesh name="disc" vertex="{text}"/></asset><worldbody>
        <geom type="box" size=".3 .3 .1" pos="0 0 -.1"/>
        <body pos="0 0 .02"><freejoint/><geom type="mesh" mesh="disc"/></body></worldbody></mujoco>"""
    )
    with tl.launch(tl.Scene.from_mujoco(model), worlds=1, precision="f64", fields=("qpos", "contact_count")) as sim:
        for _ in range(300):
            frame = sim.step()
        assert 3 <= frame.contact_count[0] <= 4
        assert abs(frame.qpos[0, 3]) > 0.999


def test_a_hull_beside_its_file_s_origin_meets_geoms(tmp_path):
    # the middle of the box around it is outside, and so is the origin of its file
    corners = np.array([[0, 0, 0], [0.3, 0, 0], [0, 0.3, 0], [0, 0, 0.3]]) + 1.0
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + ["f 1 3 2", "f 1 2 4", "f 1 4 3", "f 2 3 4"]
    (tmp_path / "corner.obj").write_text("\n".join(lines))
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><option gravity="0 0 0"/><worldbody><body><freejoint/>
        <geom type="ellipsoid" size=".1 .1 .08" mass="1"/></body></worldbody></mujoco>"""
    )
    scene = tl.Scene.from_mujoco(model)
    scene.add_mesh(tmp_path / "corner.obj", pos=(-1, -1, -1), name="corner")
    places = np.array([[0.3, 0.3, 0.3], [0.12, 0.12, 0.12], [0.1, 0.1, -0.05], [-0.05, 0.1, 0.1], [2, 2, 2]])
    with tl.launch(scene, worlds=5, precision="f64", fields=("contact_count", "contact_distance")) as sim:
        frame = sim.write(joint_q=np.hstack([places, np.tile([0, 0, 0, 1.0], (5, 1))]))
        assert frame.contact_count.tolist() == [0, 1, 1, 1, 0]
        # from below and from the side the depth is the radius along that axis less the distance
        np.testing.assert_allclose(frame.contact_distance[[2, 3], 0], [0.05 - 0.08, 0.05 - 0.1], atol=1e-6)


HEAP = ("box", "rock", "brick", "drum", "rock", "brick")


def heap(rng: Generator) -> mujoco.MjModel:
    """Six polytopes above a tray of boxes."""
    bodies = "".join(
        f'<body pos="{x} {y} {0.25 + 0.1 * k}"><freejoint/>{geom(name, 0.0)}</body>'
        for k, (name, (x, y)) in enumerate(zip(HEAP, rng.uniform(-0.15, 0.15, (6, 2)), strict=True))
    )
    stones = assets(rng, list(HEAP))
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option tolerance="0" iterations="100" ls_iterations="50"/><asset>{stones}</asset><worldbody>
        <geom type="box" size=".4 .4 .05"/><geom type="box" size=".05 .4 .2" pos=".4 0 .2"/>
        <geom type="box" size=".05 .4 .2" pos="-.4 0 .2"/>{bodies}</worldbody></mujoco>"""
    )


def run(model: mujoco.MjModel, start: Array, steps: int) -> Array:
    data = mujoco.MjData(model)
    data.qpos[:] = start
    mujoco.mj_step(model, data, steps)
    return data.qpos.copy()


def test_a_heap_falls_as_in_mujoco():
    steps, worlds = 200, 16
    rng = np.random.default_rng(10)
    model = heap(rng)
    starts = np.tile(model.qpos0, (worlds, 1))
    for start in starts:
        for body in range(len(HEAP)):
            quat = rng.normal(size=4)
            start[7 * body + 3 : 7 * body + 7] = quat / np.linalg.norm(quat)
    order = np.concatenate([7 * body + np.array([0, 1, 2, 4, 5, 6, 3]) for body in range(len(HEAP))])
    with tl.launch(tl.Scene.from_mujoco(model), worlds=worlds, precision="f64", fields=("qpos",)) as sim:
        sim.write(joint_q=starts[:, order])
        for _ in range(steps):
            frame = sim.step()
        ours = np.array(frame.qpos)
    compared = 0
    for start, end in zip(starts, ours, strict=True):
        theirs = run(model, start, steps)
        # some heaps grow a difference of a rounding to more than a micrometre
        if np.abs(run(model, start + 1e-15 * rng.normal(size=len(start)), steps) - theirs).max() > 1e-8:
            continue
        compared += 1
        assert np.abs(end - theirs).max() < 1e-6
    assert compared > worlds // 2, compared
