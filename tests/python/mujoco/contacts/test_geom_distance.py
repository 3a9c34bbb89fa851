"""Distances and normals of cylinders against MuJoCo's `mj_geomDistance`, which is not how it finds contacts."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from contact_scenes import ContactScene, turn
from mujoco_model import Array
from numpy.random import Generator
from random_robots import Coordinates

import tightloop as tl

# 10,000 configurations, of all kinds together
WORLDS = 2000
# Distance up to which shapes are reported [m]
FAR = 0.5
# The cylinder and what it is near, as `add_*` takes them
CYLINDER = {"radius": 0.06, "half_height": 0.08}
OTHERS: dict[str, dict] = {
    "sphere": {"radius": 0.07},
    "capsule": {"radius": 0.05, "half_height": 0.09},
    "box": {"half_extents": (0.05, 0.07, 0.09)},
    "cylinder": {"radius": 0.08, "half_height": 0.05},
    "mesh": {},
}
WEDGE = np.array([[x, y, z] for x in (-0.08, 0.08) for y in (-0.06, 0.06) for z in (-0.05, 0.07)])
WEDGE[WEDGE[:, 2] > 0, :2] *= 0.5
# Of the size of the shapes, some 0.1 m [–]
CLOSE = 1e-5
SIZE = 0.1


def poses(rng: Generator) -> Array:
    """Of the free cylinder about the other, touching or not. ``(worlds, 7)``"""
    way = rng.normal(size=(WORLDS, 3))
    way /= np.linalg.norm(way, axis=1)[:, None]
    place = way * rng.uniform(0.11, 0.35, (WORLDS, 1))
    return np.hstack([place, [turn(rng) for _ in range(WORLDS)]])


@pytest.mark.parametrize("kind", OTHERS)
def test_distances_of_cylinders_are_those_of_geom_distance(tmp_path, kind):
    rng = np.random.default_rng(list(OTHERS).index(kind))
    contact_scene = ContactScene()
    size = OTHERS[kind] or {"points": WEDGE, "file": tmp_path / "wedge.obj"}
    contact_scene.shape(kind, "other", size, gap=FAR, quat=turn(rng))
    contact_scene.body("c", np.zeros(3), np.array([0.0, 0, 0, 1]))
    contact_scene.shape("cylinder", "round", CYLINDER, body="c")
    model = contact_scene.compile()
    data = mujoco.MjData(model)
    geoms = [model.geom(name).id for name in ("other", "c/round")]
    fields = ("joint_q", "contact_count", "contact_distance", "contact_normal", "contact_pair")
    with tl.launch(contact_scene.scene, worlds=WORLDS, precision="f64", fields=fields) as sim:
        to = Coordinates(model, sim)
        frame = sim.write(joint_q=poses(rng)).copy()
        other = sim.shape_names.index("other")
    apart = shallow = 0
    for world in range(WORLDS):
        data.qpos[:] = to.positions(frame.joint_q[world])
        mujoco.mj_kinematics(model, data)
        segment = np.zeros(6)
        truth = mujoco.mj_geomDistance(model, data, *geoms, FAR, segment)
        if truth >= 0.9 * FAR or truth < -0.1 * SIZE:
            continue
        count = frame.contact_count[world]
        nearest = frame.contact_distance[world, :count].argmin()
        distance = frame.contact_distance[world, nearest]
        assert abs(distance - truth) < CLOSE * SIZE, f"world {world}: {distance}, MuJoCo {truth}"
        apart, shallow = apart + (truth > 0), shallow + (truth <= 0)
        if truth > 0.1 * SIZE:
            # the segment's ends are good to MuJoCo's tolerance of 1e-6 m
            normal = (segment[3:] - segment[:3]) / np.linalg.norm(segment[3:] - segment[:3])
            sign = 1.0 if frame.contact_pair[world, nearest, 0] == other else -1.0
            off = np.linalg.norm(sign * frame.contact_normal[world, nearest] - normal)
            assert off < 1e-3, f"world {world}: normal off by {off}"
    assert apart > WORLDS // 3 and shallow > WORLDS // 50
