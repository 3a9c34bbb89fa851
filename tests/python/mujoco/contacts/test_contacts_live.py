"""Contacts against MuJoCo: which there are, what they accelerate, and what they carry.

MuJoCo moves the bodies of each scene for a while; both sides are then asked at states of that motion, one per world.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import contextmanager
from pathlib import Path

import mujoco
import numpy as np
import pytest
from comparison import assert_close
from contact_scenes import ContactScene, MujocoReference, ours, states_of, turn
from mujoco_model import Array
from numpy.random import Generator
from random_robots import Coordinates

import tightloop as tl

SEEDS = range(8)
CONES = ["elliptic", "pyramidal"]
# What the project asks for, relative to the largest acceleration
TOLERANCES = {"f64": 1e-6, "f32": 1e-3}
# Points of one pair agree to rounding [m]
SAME = 1e-9
FIELDS = "joint_q joint_qd joint_qdd constraint_force contact_count contact_pos contact_distance contact_pair".split()
# Steps after which states are taken: falling, touching, and lying
STEPS = [40, 80, 110, 150, 200, 280, 400, 600]

ARM = """<robot name="arm">
  <link name="base"/>
  <link name="upper">{inertial}
    <collision name="ball"><origin xyz="0 0 0.15"/><geometry><sphere radius="0.06"/></geometry></collision></link>
  <link name="lower">{inertial}
    <collision name="bar"><origin xyz="0 0 0.15"/><geometry><box size="0.06 0.08 0.3"/></geometry></collision>
    <collision name="tip"><origin xyz="0 0 0.3"/><geometry><sphere radius="0.05"/></geometry></collision></link>
  <joint name="shoulder" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/></joint>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/><origin xyz="0 0 0.3"/>
    <axis xyz="0.6 0.8 0"/></joint>
</robot>
""".format(
    inertial='<inertial><origin xyz="0.01 -0.02 0.15"/><mass value="1.5"/>'
    '<inertia ixx="0.03" iyy="0.035" izz="0.01" ixy="0.001" ixz="0" iyz="-0.002"/></inertial>'
)


def random_surface(rng: Generator, *, margins: bool = True) -> dict:
    """Soft and hard, slippery and rough; half of them push before they touch, or are listed before."""
    return {
        "mu": rng.uniform(0.1, 1.5),
        "ke": rng.uniform(1000, 10_000),
        "kd": rng.uniform(60, 250),
        "kf": rng.uniform(300, 2000),
        "margin": margins * float(rng.choice([0.0, rng.uniform(0, 5e-3)])),
        "gap": margins * float(rng.choice([0.0, rng.uniform(0, 5e-3)])),
        "condim": int(rng.choice([1, 3, 3])),
    }


def random_size(rng: Generator, kind: str) -> dict:
    """A few centimetres."""
    if kind == "box":
        return {"half_extents": tuple(rng.uniform(0.04, 0.12, 3))}
    if kind == "sphere":
        return {"radius": rng.uniform(0.04, 0.1)}
    return {"radius": rng.uniform(0.03, 0.08), "half_height": rng.uniform(0.05, 0.12)}


def random_contact_scene(
    rng: Generator, kinds: list[str], cone: str, impratio: float, *, margins: bool = True, off: float = 0.0
) -> ContactScene:
    """One to twelve bodies that fall onto a ground, or onto a table and each other.

    Centres of mass lie up to `off` [m] from the origin of the body's frame along each axis.
    """
    contact_scene = ContactScene(cone=cone, impratio=impratio)
    contact_scene.shape("plane", "ground", {}, quat=tilted(rng, 0.1), **random_surface(rng, margins=margins))
    if "box" in kinds:
        contact_scene.shape(
            "box", "table", {"half_extents": (0.4, 0.3, 0.1)}, pos=(0.3, 0, 0.1), **random_surface(rng, margins=margins)
        )
    for number in range(rng.integers(1, 13)):
        name, kind = f"b{number}", str(rng.choice(kinds))
        place = np.array([*rng.uniform(-0.12, 0.12, 2), 0.35 + 0.12 * number])
        contact_scene.body(name, place, turn(rng))
        shift = off * rng.uniform(-1, 1, 3)
        contact_scene.shape(
            kind,
            f"s{number}",
            random_size(rng, kind),
            pos=shift,
            quat=turn(rng),
            body=name,
            **random_surface(rng, margins=margins),
        )
    return contact_scene


def two_arms(folder: Path, rng: Generator, cone: str, impratio: float) -> ContactScene:
    """Two arms that hang over a table into each other, with a loose ball between them."""
    contact_scene = ContactScene(cone=cone, impratio=impratio)
    file = folder / "arm.urdf"
    file.write_text(ARM)
    contact_scene.shape("box", "table", {"half_extents": (0.5, 0.5, 0.05)}, pos=(0, 0, 0), **random_surface(rng))
    for number, x in enumerate((-0.25, 0.25)):
        contact_scene.robot(f"arm{number}", file, pos=(x, 0.05 * number, 0.3), **random_surface(rng))
        contact_scene.shape(
            "box",
            f"hand{number}",
            {"half_extents": (0.03, 0.04, 0.06)},
            pos=(0.0, 0.0, 0.37),
            quat=turn(rng),
            body=f"arm{number}/upper",
            **random_surface(rng),
        )
    contact_scene.body("ball", np.array([0.0, 0.0, 0.2]), turn(rng))
    contact_scene.shape("sphere", "skin", {"radius": 0.06}, body="ball", **random_surface(rng))
    return contact_scene


def tilted(rng: Generator, angle: float) -> Array:
    """Off the vertical by up to an angle [rad], or not at all."""
    axis = rng.normal(size=3) * [1, 1, 0] * rng.choice([0, 1])
    half = rng.uniform(0, angle) / 2
    length = np.linalg.norm(axis) or 1.0
    return np.array([*(np.sin(half) * axis / length), np.cos(half)]) if axis.any() else np.array([0.0, 0, 0, 1])


@contextmanager
def touching(
    contact_scene: ContactScene, rng: Generator, precision: str, *, push: float = 1.0, steps: list[int] = STEPS
):
    """A running scene at states of MuJoCo's motion: the frame, the reference and the states."""
    model = contact_scene.compile()
    # names are known once the scene runs: one world for them
    with tl.launch(contact_scene.scene, worlds=len(steps), precision=precision, threads=1, fields=FIELDS) as sim:
        reference = MujocoReference(model, sim)
        q, qd = states_of(model, Coordinates(model, sim), steps, push * rng.normal(size=model.nv))
        frame = sim.write(joint_q=q, joint_qd=qd)
        yield frame, reference, frame.joint_q.astype(float), frame.joint_qd.astype(float)


def assert_accelerations(contact_scene: ContactScene, rng: Generator, precision: str) -> list[int]:
    """Those of every state are MuJoCo's; how many contacts the states have."""
    with touching(contact_scene, rng, precision) as (frame, reference, q, qd):
        assert not frame.status.any()
        results = [reference.at(*state) for state in zip(q, qd, strict=True)]
        counts = [count for _, count in results]
        # which points there are is another test's matter
        same = frame.contact_count == counts
        assert same.sum() >= len(q) - 1, f"{frame.contact_count} contacts, MuJoCo {counts}"
        ours, theirs = frame.joint_qdd[same], np.array([acceleration for acceleration, _ in results])[same]
        # in single precision forces that cancel keep the rounding of their parts
        assert_close("joint_qdd", ours, theirs, TOLERANCES[precision], over_worlds=precision == "f32")
    return counts


@pytest.mark.parametrize("precision", TOLERANCES)
@pytest.mark.parametrize("cone", CONES)
@pytest.mark.parametrize("kinds", [["sphere", "box"], ["sphere", "capsule"]], ids="-".join)
def test_accelerations_of_piles_are_mujocos(kinds, cone, precision):
    counts = []
    for seed in SEEDS:
        rng = np.random.default_rng([seed, len(kinds[1])])
        impratio = float(rng.choice([1.0, 10.0, 1000.0]))
        counts += assert_accelerations(random_contact_scene(rng, kinds, cone, impratio), rng, precision)
    assert max(counts) >= (15 if "box" in kinds else 5), "some states have many contacts"
    assert min(counts) == 0, "some have none"


@pytest.mark.parametrize("cone", CONES)
def test_friction_of_0_is_mujocos_least(cone):
    # of a pyramid with 1e-5: at an impratio of 1000 its edges are 5e12 times as stiff as the normal
    contact_scene = ContactScene(cone=cone, impratio=1.0)
    contact_scene.shape("plane", "ground", {}, mu=0.0)
    for number in range(3):
        contact_scene.body(f"b{number}", np.array([0.3 * number, 0, 0.1]), turn(np.random.default_rng(number)))
        contact_scene.shape("box", f"s{number}", {"half_extents": (0.05, 0.06, 0.07)}, body=f"b{number}", mu=0.0)
    assert max(assert_accelerations(contact_scene, np.random.default_rng(0), "f64")) >= 3


@pytest.mark.parametrize("precision", TOLERANCES)
@pytest.mark.parametrize("cone", CONES)
def test_a_centre_of_mass_may_lie_anywhere(cone, precision):
    # MuJoCo's constraints act on accelerations of its coordinates: those of the origin of a free body's frame
    for seed in SEEDS:
        rng = np.random.default_rng([seed, 4])
        assert_accelerations(random_contact_scene(rng, ["sphere", "box"], cone, 1.0, off=0.05), rng, precision)


@pytest.mark.parametrize("precision", TOLERANCES)
@pytest.mark.parametrize("cone", CONES)
def test_accelerations_of_arms_that_touch_are_mujocos(tmp_path, cone, precision):
    counts = []
    for seed in SEEDS:
        rng = np.random.default_rng([seed, 3])
        counts += assert_accelerations(two_arms(tmp_path, rng, cone, 1000.0), rng, precision)
    assert max(counts) >= 3


@pytest.mark.parametrize("precision", TOLERANCES)
def test_surfaces_combine_as_those_of_mujocos_geoms(precision):
    # MuJoCo mixes geoms by itself, but knows no kf of them, which pyramids do not read either
    for seed in SEEDS:
        rng = np.random.default_rng([seed, 7])
        contact_scene = random_contact_scene(rng, ["sphere", "box"], "pyramidal", 1.0, margins=False)
        contact_scene.by_pairs = False
        assert max(assert_accelerations(contact_scene, rng, precision)) >= 1


def shallow(rng: Generator, kind: str) -> tuple[Array, Array]:
    """Where a box of half extents 0.1, 0.08, 0.06 stands a little below z = 0: by a face, an edge, or anyhow."""
    spin = rng.uniform(-np.pi, np.pi)
    quat = np.array([0, 0, np.sin(spin / 2), np.cos(spin / 2)])
    height = 0.06
    if kind != "face":
        tip = rng.uniform(0.02, 0.5)
        # about an axis of its own, so that an edge lies level, or about any
        axis = np.array([1.0, 0, 0]) if kind == "edge" else np.append(rng.normal(size=2), 0)
        axis /= np.linalg.norm(axis)
        roll = np.append(np.sin(tip / 2) * axis, np.cos(tip / 2))
        product = np.empty(4)
        mujoco.mju_mulQuat(product, np.roll(quat, 1), np.roll(roll, 1))
        quat = np.roll(product, -1)
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, np.roll(quat, 1))
    height = np.abs(rotation.reshape(3, 3)[2]) @ [0.1, 0.08, 0.06]
    return np.array([*rng.uniform(-0.35, 0.35, 2), height - rng.uniform(0, 4e-3)]), quat


@pytest.mark.parametrize("precision", ["f64"])
@pytest.mark.parametrize("other", ["plane", "box"])
def test_contacts_of_a_box_with_a_plane_or_a_box_are_mujocos(other, precision):
    rng = np.random.default_rng(5)
    contact_scene = ContactScene()
    if other == "plane":
        contact_scene.shape("plane", "floor", {}, margin=1e-3)
    else:
        contact_scene.shape("box", "floor", {"half_extents": (0.3, 0.2, 0.1)}, pos=(0, 0, -0.1), margin=1e-3)
    contact_scene.body("b", np.zeros(3), np.array([0.0, 0, 0, 1]))
    contact_scene.shape("box", "s", {"half_extents": (0.1, 0.08, 0.06)}, body="b", gap=2e-3)
    model, worlds = contact_scene.compile(), 300
    poses = [np.r_[shallow(rng, ("face", "edge", "any")[world % 3])] for world in range(worlds)]
    seen, odd = set(), []
    with tl.launch(contact_scene.scene, worlds=worlds, precision=precision, threads=1, fields=FIELDS) as sim:
        reference = MujocoReference(model, sim)
        frame = sim.write(joint_q=np.array(poses))
        for world in range(worlds):
            reference.at(frame.joint_q[world], frame.joint_qd[world])
            theirs = reference.contacts()
            count = int(frame.contact_count[world])
            if count != len(theirs):
                odd.append((poses[world], count, theirs))
                continue
            seen.add(count)
            points, distances = frame.contact_pos[world, :count], frame.contact_distance[world, :count]
            for _, distance, point in theirs:
                near = np.linalg.norm(points - point, axis=1).argmin()
                assert np.abs(points[near] - point).max() <= SAME, f"world {world}: {points}, MuJoCo {point}"
                assert abs(distances[near] - distance) <= SAME
    assert seen >= {1, 2, 4}
    # MuJoCo now and then adds points beside an edge that crosses an edge
    assert len(odd) <= (worlds // 100 if other == "box" else 0), odd


# Shapes whose contacts are found by iteration, and may be other points than MuJoCo's: what lies on what, and how
LYING = {"quat": (0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5))}
CYLINDER = {"radius": 0.08, "half_height": 0.1}
CAPSULE = {"radius": 0.08, "half_height": 0.1}
WEDGE = np.array([[x, y, z] for x in (-0.1, 0.1) for y in (-0.08, 0.08) for z in (-0.07, 0.05)]) * [1, 1, 1]
WEDGE[WEDGE[:, 2] > 0, :2] *= 0.6
REST: dict[str, Callable[[Path], tuple]] = {
    "capsule lying": lambda _: ("capsule", CAPSULE, LYING, 0.08),
    "cylinder standing": lambda _: ("cylinder", CYLINDER, {}, 0.1),
    "cylinder lying": lambda _: ("cylinder", CYLINDER, LYING, 0.08),
    "hull": lambda folder: ("mesh", {"points": WEDGE, "file": folder / "wedge.obj"}, {}, 0.07),
}


@pytest.mark.parametrize("precision", TOLERANCES)
@pytest.mark.parametrize("floor", ["plane", "box", "mesh"])
@pytest.mark.parametrize("thing", REST)
def test_a_body_at_rest_is_carried_as_mujocos(tmp_path, thing, floor, precision):
    kind, size, frame_of_shape, height = REST[thing](tmp_path)
    contact_scene = ContactScene(dt=1 / 480, substeps=96)
    if floor == "plane":
        contact_scene.shape("plane", "floor", {})
    elif floor == "box":
        contact_scene.shape("box", "floor", {"half_extents": (0.5, 0.4, 0.1)}, pos=(0, 0, -0.1))
    else:
        slab = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.4, 0.4) for z in (-0.2, 0)])
        contact_scene.shape("mesh", "floor", {"points": slab, "file": tmp_path / "slab.obj"})
    contact_scene.body("b", np.array([0.02, 0.01, height + 1e-4]), np.array([0.0, 0, 0, 1]))
    contact_scene.shape(kind, "s", size, body="b", **frame_of_shape)
    model = contact_scene.compile()
    with tl.launch(contact_scene.scene, worlds=2, precision=precision, threads=1, fields=FIELDS) as sim:
        reference = MujocoReference(model, sim)
        start = sim.reset().joint_q[0].astype(float)
        weight = model.body_mass[1] * 9.81
        # the second world is pushed along what lies, and leaned on
        push = np.zeros((2, 6))
        push[1] = [0.2 * weight, 0, -0.3 * weight, 0, 0.01 * weight, 0]
        for _ in range(20):
            frame = sim.step(joint_f=push)
        for world in range(2):
            reference.at(start, np.zeros(6), push[world])
            for _ in range(20 * 96):
                mujoco.mj_step(model, reference.data)
            carried = reference.constraint_force(ours(reference.to, reference.data)[0])
            # torques about an arm of a tenth of a metre count as forces
            scale = weight * np.array([1, 1, 1, 0.1, 0.1, 0.1])
            error = np.abs(frame.constraint_force[world] - carried) / scale
            assert error.max() <= 0.01, f"world {world}: {frame.constraint_force[world]}, MuJoCo {carried}"
            assert np.abs(frame.joint_qd[world]).max() < 1e-3, "it rests"
