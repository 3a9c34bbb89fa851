"""Fields with MuJoCo's names against MuJoCo's data of random models, and of several models in a scene."""

from __future__ import annotations

import os
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from live_model import Live, live
from random_mjcf import CONSTRAINED, random_mjcf

import tightloop as tl

TREES = int(os.environ.get("TIGHTLOOP_LIVE_TREES", "48")) // 4
PLACES = tuple("xpos xquat xmat xipos ximat site_xpos site_xmat geom_xpos geom_xmat subtree_com cvel cinert".split())
FORCES = ("qfrc_actuator", "qfrc_constraint", "qfrc_bias", "qfrc_passive")
FIELDS = (*PLACES, *FORCES)
TOUCHING = replace(CONSTRAINED, geoms=True, equalities=False, connections=False, option='cone="elliptic"')


def assert_near(case: Live, seed: int, tolerance: float, fields: tuple[str, ...] = FIELDS) -> None:
    """Compare fields at random states, relative to the largest value of a world."""
    states = case.states(seed)
    frame = case.place(states)
    for world, data in enumerate(case.data(states)):
        mujoco.mj_forward(case.model, data)
        for name in fields:
            expected, found = getattr(data, name), getattr(frame, name)[world]
            assert found.shape == expected.shape, name
            scale = max(1.0, np.abs(expected).max(initial=0.0))
            error = np.abs(found - expected).max(initial=0.0) / scale
            assert error < tolerance, f"{name}: {error}"


@pytest.mark.parametrize("seed", range(TREES))
def test_fields_are_mujocos(seed: int) -> None:
    with live(random_mjcf(seed, 2 + seed % 6, CONSTRAINED), fields=FIELDS) as case:
        assert_near(case, seed, 1e-8)


@pytest.mark.parametrize("seed", range(TREES // 3))
def test_geoms_are_shown_also_where_they_touch_nothing(seed: int) -> None:
    text = random_mjcf(seed, 2 + seed % 5, TOUCHING)
    text = text.replace(
        "</worldbody>", '<geom name="seen" size=".1" pos="1 2 3" contype="0" conaffinity="0"/></worldbody>'
    )
    with live(text, fields=FIELDS) as case:
        assert case.model.ngeom > 1
        assert_near(case, seed, 1e-8, PLACES)


@pytest.mark.parametrize("seed", range(TREES // 3))
def test_fields_in_single_precision_are_near(seed: int) -> None:
    with live(random_mjcf(seed, 2 + seed % 6, CONSTRAINED), fields=FIELDS, precision="f32") as case:
        assert_near(case, seed, 1e-3)


def test_models_follow_each_other_and_leave_robots_out() -> None:
    models = [mujoco.MjModel.from_xml_string(random_mjcf(seed, 3, CONSTRAINED)) for seed in (1, 2)]
    scene = tl.Scene.from_mujoco(models[0], name="first")
    scene.add_sphere(radius=0.1, body=scene.add_body(name="ball", pos=(0, 0, 3)))
    scene.add_mujoco(models[1], name="second", pos=(1, 2, 3))
    with tl.launch(scene, worlds=2, fields=("xpos", "site_xpos", "subtree_com", "cvel"), precision="f64") as sim:
        frame = sim.forward()
        first, second = (model.nbody for model in models)
        assert frame.xpos.shape == (2, first + second, 3)
        placed = [(slice(0, first), (0, 0, 0)), (slice(first, first + second), (1, 2, 3))]
        for model, (rows, place) in zip(models, placed, strict=True):
            data = mujoco.MjData(model)
            mujoco.mj_forward(model, data)
            np.testing.assert_allclose(frame.xpos[0, rows], data.xpos + place, atol=1e-12)
            np.testing.assert_allclose(frame.subtree_com[1, rows], data.subtree_com + place, atol=1e-12)
        assert not frame.cvel.any()


def test_scenes_without_models_have_no_bodies_of_them() -> None:
    scene = tl.Scene(dt=0.01)
    scene.add_sphere(radius=0.1, body=scene.add_body(name="ball", pos=(0, 0, 3), mass=1.0))
    with tl.launch(scene, worlds=3, fields=("xpos", "site_xmat", "qfrc_bias", "qfrc_actuator")) as sim:
        frame = sim.step()
        assert frame.xpos.shape == (3, 0, 3)
        assert frame.site_xmat.shape == (3, 0, 9)
        np.testing.assert_allclose(frame.qfrc_bias[:, 2], 9.81, rtol=1e-6)
        assert not frame.qfrc_actuator.any()
