"""Pairs of geoms with a closed form in MuJoCo: its points, distances, normals and accelerations in random states.

A still geom and a free one start anywhere around each other: apart, touching, deep, and by faces, edges and corners.
"""

from __future__ import annotations

from collections.abc import Collection

import mujoco
import numpy as np
import pytest
from geom_pairs import at_rest, pair_model, random_poses
from live_model import Array, live, relative

import tightloop as tl
from tiers import nightly

# In the daily tier, and in the nightly one
STATES = [1_000, nightly(10_000)]
# Of points and distances [m]
SAME = 1e-10
# Normals are differences of points over their length [–]
SAME_NORMAL = 1e-8
# Accelerations, relative to the largest of a world
SAME_QACC = 1e-8
FIELDS = ("contact_count", "contact_pos", "contact_distance", "contact_normal", "contact_pair")

CAPSULE_BOXES = {
    "alike": (("capsule", (0.05, 0.09)), ("box", (0.05, 0.08, 0.11)), 0.0),
    "long and thin": (("capsule", (0.02, 0.5)), ("box", (0.05, 0.08, 0.11)), 0.0),
    "short and fat": (("capsule", (0.2, 0.05)), ("box", (0.05, 0.08, 0.11)), 0.02),
    "box inside": (("capsule", (0.2, 0.2)), ("box", (0.02, 0.03, 0.025)), 0.0),
    "on a plate": (("capsule", (0.05, 0.3)), ("box", (1.0, 1.0, 0.1)), 0.01),
    "cube": (("capsule", (0.05, 0.1)), ("box", (0.1, 0.1, 0.1)), 0.0),
}
PAIRS = {
    "sphere and box": (("sphere", (0.06,)), ("box", (0.05, 0.08, 0.11)), 0.0),
    "sphere and cube": (("sphere", (0.02,)), ("box", (0.1, 0.1, 0.1)), 0.01),
    "sphere and sphere": (("sphere", (0.06,)), ("sphere", (0.09,)), 0.01),
    "sphere and capsule": (("sphere", (0.06,)), ("capsule", (0.05, 0.09)), 0.0),
    "sphere and cylinder": (("sphere", (0.06,)), ("cylinder", (0.08, 0.05)), 0.0),
    "small sphere and cylinder": (("sphere", (0.01,)), ("cylinder", (0.08, 0.1)), 0.01),
    "sphere and plane": (("sphere", (0.06,)), ("plane", (0, 0, 1)), 0.01),
    "capsule and plane": (("capsule", (0.05, 0.09)), ("plane", (0, 0, 1)), 0.0),
    "ellipsoid and plane": (("ellipsoid", (0.05, 0.08, 0.11)), ("plane", (0, 0, 1)), 0.0),
    "box and plane": (("box", (0.05, 0.08, 0.11)), ("plane", (0, 0, 1)), 0.01),
}

# Pose, then of each point distance and normal from the capsule to the box, then acceleration: of MuJoCo C 3.17
CASES: dict[str, tuple[list[float], list[tuple[float, ...]], list[float]]] = {
    "flat across the top": (
        [0, 0, 0.155, 0.707106781, 0, 0.707106781, 0],
        [(-0.005, 0, 0, -1)],
        [2.62965, 0, 9.59355, 0, 61.1885, 0],
    ),
    "the same, tilted": (
        [0.03, 0, 0.157, 0.714067156, 0, 0.699785813, 0.0201968691],
        [(-0.004659, 0.02061, 0, -0.99979), (-0.002607, 0, 0, -1)],
        [2.23964, 0.0667808, 7.79439, 1.51212, 52.0433, 0.00629157],
    ),
    "its end on the face": (
        [0, 0.02, 0.23, 0.987233302, 0.151107138, 0.050369046, 0],
        [(-0.015433, 0, 0, -1)],
        [1.87201, -5.61604, 37.2058, 48.6013, 16.2004, 0],
    ),
    "over an edge": (
        [0.095, 0, 0.13, 0.925148905, 0.100559664, 0.351958822, 0.100559664],
        [(-0.065431, -1, 0, 0)],
        [118.947, -7.70475, 48.9252, -109.576, -695.81, 0],
    ),
    "its axis inside": (
        [0.06, 0.05, 0.1, 0.697485832, 0.581238194, 0.348742916, 0.232495277],
        [(-0.048827, -1, 0, 0)],
        [121.094, -4.15282, 0.519102, 16.672, -133.376, 0],
    ),
}


def assert_mujocos(
    model: mujoco.MjModel, frame: tl.Frame, qpos: Array, *, left_out: Collection[int] = (), same_qacc: float = SAME_QACC
) -> list[int]:
    """Points and accelerations of each world are MuJoCo's; how many points they have."""
    data, counts, qacc = mujoco.MjData(model), [], []
    for world, pose in enumerate(qpos):
        if world in left_out:
            qacc.append(frame.qacc[world])
            continue
        mujoco.mj_resetData(model, data)
        data.qpos[:] = pose
        mujoco.mj_forward(model, data)
        counts.append(data.ncon)
        qacc.append(data.qacc.copy())
        assert frame.contact_count[world] == data.ncon, f"{pose.tolist()}: {frame.contact_distance[world]}"
        for contact in data.contact:
            # our first shape is that which stands still
            way = -1.0 if contact.geom[0] else 1.0
            # the corners of a box come in another order
            at = int(np.abs(frame.contact_pos[world, : data.ncon] - contact.pos).sum(1).argmin())
            found = [getattr(frame, f"contact_{name}")[world, at] for name in ("pos", "distance", "normal")]
            assert np.abs(found[0] - contact.pos).max() < SAME, f"{pose.tolist()}: {found}, MuJoCo {contact.pos}"
            assert abs(found[1] - contact.dist) < SAME, f"{pose.tolist()}: {found}, MuJoCo {contact.dist}"
            off = np.abs(found[2] - way * contact.frame[:3]).max()
            assert off < SAME_NORMAL, f"{pose.tolist()}: {found}, MuJoCo {way * contact.frame[:3]}"
    assert relative(frame.qacc, np.array(qacc)) < same_qacc
    return counts


@pytest.mark.parametrize("states", STATES)
@pytest.mark.parametrize("name", CAPSULE_BOXES | PAIRS)
def test_points_and_accelerations_are_mujocos(name, states):
    free, still, margin = (CAPSULE_BOXES | PAIRS)[name]
    rng = np.random.default_rng(list(CAPSULE_BOXES | PAIRS).index(name))
    qpos = random_poses(rng, free, still, states)
    with live(pair_model(free, still, margin), worlds=states, fields=FIELDS) as pair:
        frame = pair.place(at_rest(pair.model, qpos))
        counts = assert_mujocos(pair.model, frame, frame.qpos.astype(float))
    most = {"box": 2, "plane": 2}.get(still[0], 1) if free[0] == "capsule" else 1
    # small spheres start within the margin
    assert min(counts) == (1 if name in ("sphere and cube", "sphere and plane") else 0)
    assert sum(count >= most for count in counts) > states // 20


@pytest.mark.parametrize("name", CASES)
def test_a_capsule_at_a_box_is_moved_as_by_mujoco(name):
    pose, points, qacc = CASES[name]
    free, still, margin = CAPSULE_BOXES["alike"]
    with live(pair_model(free, still, margin), worlds=1, fields=FIELDS) as pair:
        frame = pair.place(at_rest(pair.model, np.array([pose])))
        assert_mujocos(pair.model, frame, frame.qpos.astype(float))
    assert frame.contact_count[0] == len(points)
    for at, (distance, *normal) in enumerate(points):
        # figures have six digits; ours points from the box to the capsule
        assert abs(frame.contact_distance[0, at] - distance) < 1e-6
        assert np.abs(frame.contact_normal[0, at] + normal).max() < 1e-5
    assert np.abs(frame.qacc[0] - qacc).max() < 1e-5 * np.abs(qacc).max()


def test_a_sphere_at_the_centre_of_a_box_leaves_as_in_mujoco():
    # between equal faces the first counts
    free, still, margin = PAIRS["sphere and cube"]
    qpos = np.array(
        [[x, y, z, 1, 0, 0, 0] for x in (-0.02, 0, 0.02) for y in (-0.02, 0, 0.02) for z in (-0.02, 0, 0.02)]
    )
    with live(pair_model(free, still, margin), worlds=len(qpos), fields=FIELDS) as pair:
        frame = pair.place(at_rest(pair.model, qpos))
        assert set(assert_mujocos(pair.model, frame, qpos)) == {1}
