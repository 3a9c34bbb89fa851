"""Pairs of boxes and of capsules against MuJoCo: number of points, distance, place, normal and acceleration, in f64."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np
import pytest
from geom_pairs import PAIR_FIELDS, assert_pair_is_mujocos
from numpy.random import Generator
from numpy.typing import NDArray

import tightloop as tl

Array = NDArray[np.float64]

XML = """<mujoco><option gravity="0 0 0" tolerance="0" iterations="200" ls_iterations="100"/><worldbody>
<geom type="{kind}" size="{a}" margin="{margin}"/>
<body><freejoint/><geom type="{kind}" size="{b}" mass="1"/></body></worldbody></mujoco>"""
WORLDS = 1250
#: Half extents of boxes, radius and half height of capsules [m]: of either shape.
BOXES = (
    (".05 .08 .11", ".05 .08 .11"),
    (".1 .1 .1", ".1 .1 .1"),
    (".2 .15 .002", ".06 .04 .09"),
    (".3 .2 .1", ".03 .03 .05"),
)
CAPSULES = (".05 .09", ".05 .09"), (".02 .2", ".07 .05"), (".1 .02", ".03 .12"), (".04 .1", ".04 .3")


def turn(axis: Array, angle: float) -> Array:
    """A quaternion (w, x, y, z)."""
    return np.append(np.cos(angle / 2), np.sin(angle / 2) * axis / np.linalg.norm(axis))


def after(first: Array, second: Array) -> Array:
    product = np.empty(4)
    mujoco.mju_mulQuat(product, first, second)
    return product


def rotation(quat: Array) -> Array:
    flat = np.empty(9)
    mujoco.mju_quat2Mat(flat, quat)
    return flat.reshape(3, 3)


def any_way(rng: Generator) -> Array:
    quat = rng.normal(size=4)
    return quat / np.linalg.norm(quat)


def quarters(rng: Generator) -> Array:
    """One of the turns that carry axes to axes, without rounding."""
    half = 0.5 * rng.choice([-1.0, 1.0], 4)
    return half if rng.random() < 0.5 else np.eye(4)[rng.integers(4)]


def nearly_square(rng: Generator) -> Array:
    """Up to 5 degrees from faces that are parallel, or turned on one of them."""
    quat = after(quarters(rng), turn(rng.normal(size=3), np.radians(rng.uniform(0, 5))))
    return after(quat, turn(np.eye(3)[rng.integers(3)], rng.uniform(0, 6))) if rng.random() < 0.5 else quat


def nearly_parallel(rng: Generator) -> Array:
    """Axes z that are parallel up to a sine of 1e-7 to 0.1, either way round."""
    tilt = turn(np.append(rng.normal(size=2), 0), 10 ** rng.uniform(-7, -1))
    return after(np.array([[1.0, 0, 0, 0], [0, 1.0, 0, 0]])[rng.integers(2)], after(tilt, spin(rng)))


def spin(rng: Generator) -> Array:
    return turn(np.array([0, 0, 1.0]), rng.uniform(-3, 3))


def reach_of(size: Array, axes: Array, kind: str) -> Array:
    """Half extents of a shape along the world's axes."""
    if kind == "capsule":
        return np.abs(axes[:, 2]) * size[1] + size[0]
    return np.abs(axes) @ size


def states(rng: Generator, model: mujoco.MjModel, kind: str, attitude: Callable, depth: float) -> Array:
    """Poses of the second shape, most of them up to `depth` of their extents inside the first, or a little apart."""
    qpos = np.empty((WORLDS, 7))
    sizes = model.geom_size[:, : 3 if kind == "box" else 2]
    for row in qpos:
        row[3:] = attitude(rng)
        both = reach_of(sizes[0], np.eye(3), kind) + reach_of(sizes[1], rotation(row[3:]), kind)
        row[:3] = rng.uniform(-1, 1, 3) * both
        # capsules touch by their sides
        axis = rng.integers(3 if kind == "box" else 2)
        row[axis] = rng.choice([-1, 1]) * both[axis] * (1.02 - rng.uniform(0, depth))
        if kind == "capsule":
            row[1 - axis] *= 0.4
    return qpos


def model_of(kind: str, sizes: tuple[str, str], margin: float) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(XML.format(kind=kind, a=sizes[0], b=sizes[1], margin=margin))


@pytest.mark.parametrize("margin", [0.0, 0.02])
@pytest.mark.parametrize("attitude", [any_way, nearly_square, quarters])
@pytest.mark.parametrize("sizes", BOXES, ids=str)
def test_points_of_two_boxes_are_mujocos(sizes, attitude, margin):
    rng = np.random.default_rng([3, BOXES.index(sizes)])
    model = model_of("box", sizes, margin)
    counts = set(assert_pair_is_mujocos(model, states(rng, model, "box", attitude, 0.1)).tolist())
    # those whose faces are parallel are within the margin or within no margin
    wanted = ({4} if margin else {0, 4}) if attitude is quarters else {0, 1, 2, 4}
    assert counts >= wanted, counts


def test_points_of_two_boxes_deep_in_each_other_are_mujocos():
    rng = np.random.default_rng(4)
    model = model_of("box", BOXES[0], 0.0)
    counts = assert_pair_is_mujocos(model, states(rng, model, "box", any_way, 1.0))
    assert counts.max() >= 7


@pytest.mark.parametrize("margin", [0.0, 0.02])
@pytest.mark.parametrize("attitude", [any_way, nearly_parallel, spin])
@pytest.mark.parametrize("sizes", CAPSULES, ids=str)
def test_points_of_two_capsules_are_mujocos(sizes, attitude, margin):
    rng = np.random.default_rng([5, CAPSULES.index(sizes)])
    model = model_of("capsule", sizes, margin)
    counts = set(assert_pair_is_mujocos(model, states(rng, model, "capsule", attitude, 0.2)).tolist())
    # parallel axes have two points, also where these are the same
    assert counts == {any_way: {0, 1}, nearly_parallel: {0, 1, 2}, spin: {0, 2}}[attitude]


#: Pose of the second of two boxes, points, their distances, a normal, and the acceleration, of MuJoCo 3.17.
TILTED = {
    "by 2.4 degrees": (
        [-0.083, 0.158, 0.013, 0.999779073, -0.00299933722, -0.0169962442, 0.0119973489],
        [-0.001931, -0.001386, -0.000614, -0.000241],
        [-0.02389, 0.99969, -0.00641],
        [-0.79926, 2.85409, 1.18604, 16.7047, -0.0120316, 9.36918],
    ),
    "by 2.5 degrees": (
        [0.001, 0.157, 0.057, 0.999758587, -0.000999758587, -0.0189954132, -0.0109973445],
        [-0.004270, -0.004130, -0.003955, -0.002149, -0.001928, -0.001812],
        [0.0, 1.0, 0.0],
        [-3.40499, 8.41505, 0.40353, 6.63246, 0.588426, 44.5337],
    ),
}


@pytest.mark.parametrize("case", TILTED)
def test_a_box_tilted_on_a_box_keeps_the_points_of_its_face(case):
    pose, distances, normal, acceleration = TILTED[case]
    model = model_of("box", BOXES[0], 0.0)
    with tl.launch(tl.Scene.from_mujoco(model), worlds=1, precision="f64", fields=PAIR_FIELDS) as sim:
        frame = sim.write(joint_q=[np.array(pose)[[0, 1, 2, 4, 5, 6, 3]]])
        assert frame.contact_count[0] == len(distances)
        np.testing.assert_allclose(np.sort(frame.contact_distance[0, : len(distances)]), distances, atol=1e-6)
        np.testing.assert_allclose(frame.contact_normal[0, : len(distances)], [normal] * len(distances), atol=1e-5)
        np.testing.assert_allclose(frame.qacc[0], acceleration, rtol=1e-5)


@pytest.mark.parametrize("kinds", ["sphere sphere", "sphere capsule", "capsule capsule"])
@pytest.mark.parametrize("quat", ["1 0 0 0", ".9 .1 .3 .2"])
def test_shapes_with_one_centre_have_mujocos_normal(kinds, quat):
    a, b = kinds.split()
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><geom type="{a}" size=".05 .08"/><body><freejoint/>'
        f'<geom type="{b}" size=".05 .08" quat="{quat}"/></body></worldbody></mujoco>'
    )
    assert_pair_is_mujocos(model, np.array([[0.0, 0, 0, 1, 0, 0, 0]]))
