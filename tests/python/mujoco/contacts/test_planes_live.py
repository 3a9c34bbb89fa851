"""Cylinders and meshes on planes: MuJoCo's points, distances, normals and accelerations in random states, in f64.

A cylinder stands, nearly stands, lies, nearly lies or is tilted. A mesh rests on corners, edges and faces.
"""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from live_model import Array, live, relative
from numpy.random import Generator
from test_closed_forms import FIELDS, SAME_QACC, assert_mujocos, at_rest

from tiers import sweep

# Of each size or mesh, margin and plane
WORLDS = 4_000
PLANES = {"level": "", "tilted": 'quat=".9 .3 -.2 .1" pos=".1 -.2 .3"'}
XML = """<mujoco><option gravity="0 0 0"/><asset>{mesh}</asset><worldbody>
<geom type="plane" size="0 0 1" margin="{margin}" {plane}/>
<body><freejoint/><geom {geom} mass="1"/></body></worldbody></mujoco>"""
# Quaternions (w, x, y, z) that carry axes to axes; the last two of six lie
STRAIGHT = np.array(
    [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1], [0.5**0.5, 0.5**0.5, 0, 0], [0.5**0.5, 0, 0.5**0.5, 0]]
)


def attitudes(rng: Generator, count: int) -> Array:
    """Turns of any kind: a third any, a third near a straight one by 1e-5 to 0.1, a third straight. ``(count, 4)``"""
    quats = rng.normal(size=(count, 4))
    third = count // 3
    quats[: 2 * third] = STRAIGHT[rng.integers(len(STRAIGHT), size=2 * third)]
    quats[:third] += rng.normal(size=(third, 4)) * 10 ** rng.uniform(-5, -1, (third, 1))
    return quats / np.linalg.norm(quats, axis=1)[:, None]


def poses(rng: Generator, model: mujoco.MjModel, count: int) -> Array:
    """Poses about the plane, from out of reach to deep in it.

    Ties are left out where rounding decides them in MuJoCo: which corners at the height of a mesh's centre count, and
    where a shape touches that stands straight on a tilted plane.
    """
    size = model.geom_rbound[1]
    plane = np.empty(9)
    mujoco.mju_quat2Mat(plane, model.geom_quat[0])
    plane = plane.reshape(3, 3)
    quats = attitudes(rng, count)
    if model.geom_quat[0, 0] < 1:
        quats = quats[np.abs(quats[:, None] - STRAIGHT).max(2).min(1) > 1e-9]
    at = rng.uniform(-1, 1, (len(quats), 3)) * 3
    at[:, 2] = rng.uniform(-0.5, 1.1, len(quats)) * size
    if model.geom_type[1] == mujoco.mjtGeom.mjGEOM_MESH:
        straight = np.abs(quats[:, None] - STRAIGHT).max(2).min(1) < 1e-6
        at[straight, 2] = rng.uniform(0.025, 1.1 * size, straight.sum())
    for row in quats:
        mujoco.mju_mulQuat(row, model.geom_quat[0], row.copy())
    return np.hstack([at @ plane.T + model.geom_pos[0], quats])


def compare(model: mujoco.MjModel, qpos: Array, *, ties: float = 0.0) -> set[int]:
    """Assert that every world has MuJoCo's points, but for a share of ties at most; how many they have."""
    with live(model, worlds=len(qpos), fields=FIELDS) as pair:
        frame = pair.place(at_rest(pair.model, qpos))
        qpos = frame.qpos.astype(float)
        points, qacc = mujocos(pair.model, qpos)
        others = [
            world
            for world, own in enumerate(points)
            if apart(frame.contact_pos[world, : frame.contact_count[world]], own)
        ]
        assert len(others) <= ties * len(qpos)
        # MuJoCo decides a tie otherwise where the pose moves by roundings
        for world in others:
            near = qpos[world] + np.random.default_rng(10).normal(size=(64, 7)) * 1e-15
            assert any(apart(moved, points[world]) for moved in mujocos(pair.model, near)[0]), qpos[world].tolist()
        # points that are nearly in one place: MuJoCo's own accelerations move more than its positions
        moved = [mujocos(pair.model, np.nextafter(qpos, side)) for side in (-np.inf, np.inf)]
        firm = [world for world, own in enumerate(points) if not any(apart(other[world], own) for other, _ in moved)]
        moves = max(relative(other[firm], qacc[firm]) for _, other in moved)
        assert moves < 1e-6
        return set(assert_mujocos(pair.model, frame, qpos, left_out=others, same_qacc=max(SAME_QACC, moves)))


def mujocos(model: mujoco.MjModel, qpos: Array) -> tuple[list[Array], Array]:
    """MuJoCo's points and accelerations."""
    data, points, qacc = mujoco.MjData(model), [], []
    for pose in qpos:
        mujoco.mj_resetData(model, data)
        data.qpos[:] = pose
        mujoco.mj_forward(model, data)
        points.append(data.contact.pos.copy())
        qacc.append(data.qacc.copy())
    return points, np.array(qacc)


def apart(one: Array, other: Array) -> bool:
    """Whether points are others than these, in any order."""
    return len(one) != len(other) or any(np.abs(other - point).max(1).min() > 1e-6 for point in one)


@pytest.mark.parametrize("plane", PLANES)
@pytest.mark.parametrize("margin", [0.0, 0.02])
@pytest.mark.parametrize("size", sweep(["0.08 0.05", "0.02 0.2", "0.3 0.01"], daily=1))
def test_points_of_a_cylinder_on_a_plane_are_mujocos(size, margin, plane):
    rng = np.random.default_rng([6, len(size), int(100 * margin)])
    geom = f'type="cylinder" size="{size}"'
    model = mujoco.MjModel.from_xml_string(XML.format(mesh="", geom=geom, margin=margin, plane=PLANES[plane]))
    assert compare(model, poses(rng, model, WORLDS)) == {0, 1, 2, 3, 4}


@pytest.mark.parametrize("tilt", [0.0, 1e-16, 1e-5])
def test_a_cylinder_that_stands_has_three_points(tilt):
    model = mujoco.MjModel.from_xml_string(
        XML.format(mesh="", geom='type="cylinder" size=".08 .05"', margin=0, plane="")
    )
    assert compare(model, np.array([[0.1, 0.2, 0.049, 1, tilt, 0, 0], [0, 0, 0.049, 0, 1, 0, tilt]])) == {3}


def prism(count: int) -> Array:
    """Two regular polygons above each other."""
    angles = np.arange(count) / count * 2 * np.pi
    return np.array([[0.1 * np.cos(at), 0.1 * np.sin(at), z] for z in (-0.05, 0.05) for at in angles])


def scattered(seed: int, count: int) -> Array:
    return np.random.default_rng([7, seed]).normal(size=(count, 3)) * [0.1, 0.08, 0.05]


def ball(seed: int, count: int) -> Array:
    points = scattered(seed, count)
    return points / np.linalg.norm(points / [0.1, 0.09, 0.08], axis=1)[:, None]


GOLDEN = (1 + 5**0.5) / 2
CUBE = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * 0.1
RECTANGLES = [point for a in (-1, 1) for b in (-GOLDEN, GOLDEN) for point in ((0, a, b), (a, b, 0), (b, 0, a))]
MESHES = {
    "tetrahedron": np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) * 0.1,
    "cube": CUBE,
    "long box": CUBE * [1, 2, 0.3],
    # looked at first, and of no polygon
    "cube and the middle of a face": np.vstack([[[0, 0, -0.1]], CUBE]),
    "octahedron": np.vstack([np.eye(3), -np.eye(3)]) * 0.1,
    "lattice": np.array([[x, y, z] for x in range(4) for y in range(4) for z in range(3)]) * 0.05,
    "icosahedron": np.array(RECTANGLES) * 0.05,
    "prism of 5": prism(5),
    "prism of 16": prism(16),
    "prism of 64": prism(64),
    "6 points": scattered(0, 6),
    "12 points": scattered(1, 12),
    "200 points": scattered(2, 200),
    "ball of 60": ball(3, 60),
    "ball of 500": ball(4, 500),
    # more than tables have
    "ball of 1500": ball(5, 1500),
}
# One with flat faces, one with many corners in a face, two without faces
DAILY = ("cube", "prism of 16", "ball of 60", "ball of 1500")


def mesh_model(points: Array, margin: float, plane: str = "level") -> mujoco.MjModel:
    vertices = " ".join(map(repr, map(float, points.ravel())))
    mesh = f'<mesh name="m" vertex="{vertices}"/>'
    text = XML.format(mesh=mesh, geom='type="mesh" mesh="m"', margin=margin, plane=PLANES[plane])
    return mujoco.MjModel.from_xml_string(text)


@pytest.mark.parametrize("margin", [0.0, 0.02])
@pytest.mark.parametrize("name", sweep(sorted(MESHES, key=lambda name: name not in DAILY), daily=len(DAILY)))
def test_points_of_a_mesh_on_a_plane_are_mujocos(name, margin):
    rng = np.random.default_rng([8, list(MESHES).index(name), int(100 * margin)])
    model = mesh_model(MESHES[name], margin, "level" if margin else "tilted")
    # straight ones on an edge, 1.8 % of all, have two sides that face the plane alike
    ties = 0.02 if name == "icosahedron" else 0.0
    assert compare(model, poses(rng, model, WORLDS), ties=ties) >= {0, 2, 3}


def test_a_prism_rests_on_mujocos_corners_of_its_many():
    # the largest quadrilateral of a face at a vertex is not always that which MuJoCo chooses
    rng = np.random.default_rng(9)
    for _ in range(20):
        angles = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(5, 16)))
        points = [[np.cos(at), np.sin(at), z] for z in (-0.5, 0.5) for at in angles]
        model = mesh_model(np.array(points) * 0.1, 0.5)
        quats = np.array([1, 0, 0, 0]) + 0.1 * rng.normal(size=(100, 4))
        quats[::2] = quats[::2, [1, 0, 3, 2]] * [-1, 1, -1, 1]
        quats /= np.linalg.norm(quats, axis=1)[:, None]
        assert 4 in compare(model, np.hstack([np.zeros((100, 3)), quats]))
