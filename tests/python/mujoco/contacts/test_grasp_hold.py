"""The grasp demo's cube stays in the fingers for a minute, and slips no more than in MuJoCo."""

from __future__ import annotations

import itertools

import mujoco
import numpy as np
import pytest
from contact_scenes import lesson
from mujoco_model import Array
from random_robots import Coordinates, matrix

import tightloop as tl
from conftest import REPOSITORY

SECONDS = 60


@pytest.mark.parametrize("precision", ["f64", "f32"])
def test_the_cube_slips_no_more_than_mujocos(precision):
    targets = np.loadtxt(REPOSITORY / "tests/data/grasp_targets.csv", delimiter=",", dtype=np.float32)
    contact_scene, compiled = lesson(driven=True)
    contact_scene.body("cube", np.array([0.0, -0.35, 0.125]), np.array([0.0, 0, 0, 1]))
    contact_scene.shape("box", "skin", {"half_extents": (0.025,) * 3}, body="cube", density=400.0, margin=1e-3)
    model = compiled()
    with tl.launch(contact_scene.scene, worlds=1, precision=precision, threads=1, fields=("joint_q", "body_q")) as sim:
        to, data = Coordinates(model, sim), mujoco.MjData(model)
        data.qpos[:] = to.positions(sim.reset().joint_q[0].astype(float))
        hand, cube = (sim.body_names.index(name) for name in ("arm/fr3_hand", "cube/body"))
        ours, theirs = [], []
        for target in itertools.chain(targets, itertools.repeat(targets[-1], 60 * SECONDS)):
            frame = sim.step(joint_target_q={"arm": target})
            data.ctrl[:] = to.control(np.r_[target.astype(float), np.zeros(6)], np.zeros(15))
            mujoco.mj_step(model, data, sim.substeps)
            ours.append(in_hand(*frame.body_q[0, [hand, cube]].astype(float)))
            theirs.append(in_hand(*(pose(data, model.body(name).id) for name in ("arm/fr3_hand", "cube/body"))))
    assert not frame.status[0]
    # its place in the hand when it is lifted, and a minute later
    slip, most = (np.linalg.norm(places[-1] - places[len(targets) - 1]) for places in (ours, theirs))
    assert frame.body_q[0, cube, 2] > 0.2, "the cube is up"
    assert slip <= 1.2 * most + 1e-5, f"{slip:.2e} m, MuJoCo's {most:.2e} m"


def pose(data: mujoco.MjData, body: int) -> Array:
    """As in `body_q`."""
    return np.r_[data.xpos[body], np.roll(data.xquat[body], -1)]


def in_hand(hand: Array, cube: Array) -> Array:
    """Where the cube is in the hand's frame; poses as in `body_q`."""
    return matrix(hand[3:]).T @ (cube[:3] - hand[:3])
