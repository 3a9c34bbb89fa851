"""Random trees of 1 to 12 dofs in random states against MuJoCo, in double precision and in single.

TIGHTLOOP_LIVE_TREES sets how many.
"""

from __future__ import annotations

import os
from collections.abc import Iterator

import numpy as np
import pytest
from comparison import (
    DOUBLE,
    SINGLE,
    Case,
    assert_close,
    assert_dynamics,
    assert_link_frames,
    assert_motion,
    running,
    scene_of,
)
from mujoco_model import Evaluation
from random_trees import PLAIN, Features, random_urdf

import tightloop as tl
from tiers import sweep

TREES = int(os.environ.get("TIGHTLOOP_LIVE_TREES", "48"))
# A tree of each number of dofs
DAILY = 12
WORLDS = 16
EVERYTHING = Features(limits=True, friction=True, damping=True, effort=True, mimics=2)


@pytest.fixture(scope="module", params=sweep(range(TREES), daily=DAILY))
def tree(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Case]:
    """A tree that only gravity and random torques move; every third has armatures."""
    seed, dofs = request.param, 1 + request.param % 12
    scene = scene_of(tmp_path_factory.mktemp("tree"), random_urdf(seed, dofs))
    rng = np.random.default_rng(seed)
    if seed % 3 == 0:
        scene.robots["r0"].joint_armature = rng.uniform(0, 0.3, dofs)
    with running(scene, worlds=WORLDS, seed=seed) as case:
        case.commands.joint_f[:] = rng.uniform(-2, 2, (WORLDS, 1, dofs))
        yield case


@pytest.fixture(scope="module")
def evaluated(tree: Case) -> tuple[tl.Frame, Evaluation]:
    """Both sides at the tree's states."""
    return tree.evaluate()


def test_mass_matrix_is_mujocos(evaluated):
    frame, expected = evaluated
    assert_close("mass_matrix", frame.mass_matrix, expected.mass_matrix, DOUBLE.dynamics)


def test_energy_is_mujocos(evaluated):
    frame, judge = evaluated
    energy = np.stack([frame.potential_energy, frame.kinetic_energy], axis=1)
    assert_close("energy", energy, judge.energy, DOUBLE.dynamics)


def test_bias_force_is_mujocos(evaluated):
    frame, expected = evaluated
    assert_close("bias_force", frame.bias_force, expected.bias_force, DOUBLE.dynamics)


def test_acceleration_is_mujocos(evaluated):
    frame, expected = evaluated
    assert_close("joint_qdd", frame.joint_qdd, expected.joint_qdd, DOUBLE.acceleration)


def test_link_frames_are_mujocos(evaluated):
    frame, expected = evaluated
    assert_link_frames(frame.body_q, expected.body_q, DOUBLE.pose)


def test_two_hundred_steps_follow_mujoco(tree):
    assert_motion(tree)


@pytest.mark.parametrize("features", [PLAIN, EVERYTHING], ids=["plain", "everything"])
@pytest.mark.parametrize("seed", sweep(range(TREES), daily=DAILY))
def test_single_precision_agrees_to_its_rounding(tmp_path, seed, features):
    dofs = 1 + seed % 12
    scene = scene_of(tmp_path, random_urdf(seed, dofs, features))
    with running(scene, worlds=WORLDS, seed=seed, precision="f32") as case:
        case.q *= 0.3
        case.commands.joint_f[:] = np.random.default_rng(seed).uniform(-2, 2, (WORLDS, 1, dofs))
        assert_dynamics(case, SINGLE)


@pytest.mark.parametrize("seed", range((TREES + 3) // 4))
def test_all_features_at_once_are_mujocos(tmp_path, seed):
    dofs = 1 + 5 * seed % 12
    rng = np.random.default_rng([seed, 2])
    texts = [random_urdf(100 * seed + robot, dofs, EVERYTHING) for robot in range(1 + seed % 2)]
    scene = scene_of(tmp_path, *texts, gravity=rng.normal(0, 5, 3), dt=1 / 1000)
    for robot in scene.robots.values():
        turn = rng.normal(size=4)
        robot.pos, robot.quat = tuple(rng.normal(size=3)), tuple(turn / np.linalg.norm(turn))
        robot.joint_armature = rng.uniform(0.05, 0.3, dofs)
        robot.joint_target_ke = rng.uniform(0, 300, dofs)
        robot.joint_target_kd = rng.uniform(0, 30, dofs)
        robot.joint_target_mode = [str(mode) for mode in rng.choice(["position", "velocity", "both"], dofs)]
    with running(scene, seed=seed) as case:
        case.q *= 0.3
        shape = case.commands.joint_f.shape
        case.commands.joint_f[:] = rng.uniform(-5, 5, shape)
        case.commands.joint_target_q += rng.uniform(-0.2, 0.2, shape)
        case.commands.joint_target_qd[:] = rng.uniform(-1, 1, shape)
        assert_dynamics(case)
        assert_motion(case)
