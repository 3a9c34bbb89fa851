"""Every task of mjlab, with tightloop beside MuJoCo-Warp from the same states."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
import pytest
from both_sides import Ours, Step, Theirs, run, state
from mjlab.tasks.registry import list_tasks
from numpy.typing import NDArray

Mask = NDArray[np.bool_]

FLAT = (
    "Mjlab-Cartpole-Balance",
    "Mjlab-Cartpole-Swingup",
    "Mjlab-Lift-Cube-Yam",
    "Mjlab-Tracking-Flat-Unitree-G1",
    "Mjlab-Tracking-Flat-Unitree-G1-No-State-Estimation",
    "Mjlab-Velocity-Flat-Unitree-G1",
    "Mjlab-Velocity-Flat-Unitree-Go1",
)
ROUGH = ("Mjlab-Velocity-Rough-Unitree-G1", "Mjlab-Velocity-Rough-Unitree-Go1")
CAMERAS = ("Mjlab-Lift-Cube-Yam-Depth", "Mjlab-Lift-Cube-Yam-Rgb", "Mjlab-Multi-Cube-Seg-Yam")

STEPS = 50
#: Largest difference, over the largest value of a term and at least 1.
TOLERANCE = 1e-4
#: Distance at which the rounding of a position decides whether there is a contact: 8 roundings at a metre. [m]
GRAZING = 8 * float(np.finfo(np.float32).eps)
#: Forces are compared with MuJoCo C in `test_sensors.py`: those of MuJoCo-Warp are up to 0.3 N off.
OF_FORCES = ("critic foot_contact_forces",)
#: MuJoCo-Warp has one contact of a geom with a height field, where MuJoCo C and tightloop have several.
OF_CONTACTS = (
    "critic foot_contact",
    "critic foot_contact_forces",
    "critic foot_air_time",
    "reward air_time",
    "reward foot_slip",
    "reward foot_swing_height",
    "reward self_collisions",
    "reward shank_collision",
    "reward trunk_head_collision",
    "reward soft_landing",
)
#: MuJoCo-Warp's rays down from a foot in the ground miss the height field, those of MuJoCo C and tightloop meet it.
OF_FOOT_RAYS = ("critic foot_height", "reward foot_clearance")


def grazing(model: Any, steps: list[Step]) -> Mask:
    """Return the worlds in which rounding decides on a contact, in the substeps of each step, ``(steps, worlds)``."""
    wide = copy.copy(model)
    # a pair has the larger margin
    wide.geom_margin[:] += GRAZING
    data = mujoco.MjData(wide)
    found = np.zeros((len(steps), len(steps[0].state["qpos"])), bool)
    for number, step in enumerate(steps):
        before = [] if number == 0 else [steps[number - 1].state]
        for one in (*before, *step.states, step.state):
            for world, qpos in enumerate(one["qpos"]):
                data.qpos[:] = qpos
                mujoco.mj_kinematics(wide, data)
                mujoco.mj_comPos(wide, data)
                mujoco.mj_collision(wide, data)
                found[number, world] |= bool((np.abs(data.contact.dist) < GRAZING).any())
    return found


def wrong(theirs: list[Step], ours: list[Step], compared: Mask, without: tuple[str, ...]) -> dict[str, str]:
    """Return the terms that differ, with where and how much."""
    found = {}
    for number, (one, other) in enumerate(zip(theirs, ours, strict=True)):
        assert one.values.keys() == other.values.keys()
        for name in one.values.keys() - set(without):
            left, right = (side.values[name].astype(np.float64) for side in (one, other))
            scale = max(1.0, np.abs(left).max(initial=0.0))
            off = np.abs(left - right).reshape(len(left), -1).max(axis=1, initial=0.0) / scale
            off[~compared[number]] = 0.0
            if not (off <= TOLERANCE).all():
                found.setdefault(name, f"step {number}, world {off.argmax()}: {off.max():.1e} of {scale:.3g}")
    return found


def test_all_tasks_of_mjlab_are_here() -> None:
    assert sorted((*FLAT, *ROUGH, *CAMERAS)) == list_tasks()


@pytest.mark.parametrize("task", FLAT)
def test_a_task_from_the_same_states_is_that_of_mujoco_warp(task: str, env_of: Callable[..., Any]) -> None:
    env = env_of(task, Theirs)
    theirs = run(env, STEPS)
    ours = run(env_of(task, Ours), STEPS, theirs)
    compared = ~grazing(env.sim.mj_model, theirs)
    assert compared.mean() > 0.8
    assert wrong(theirs, ours, compared, OF_FORCES) == {}
    for one, other in zip(theirs[1:], ours[1:], strict=True):
        for name in one.ends:
            assert np.array_equal(one.ends[name], other.ends[name])


@pytest.mark.parametrize("task", ROUGH)
def test_a_task_on_height_fields_sees_the_same_states_as_mujoco_warp(task: str, env_of: Callable[..., Any]) -> None:
    theirs = run(env_of(task, Theirs), STEPS)
    ours = run(env_of(task, Ours), STEPS, theirs, each_substep=True)
    assert wrong(theirs, ours, np.ones((STEPS + 1, 8), bool), (*OF_CONTACTS, *OF_FOOT_RAYS)) == {}
    buried = np.array([step.buried for step in theirs])
    # rewards look at rays of the step before
    seen = ~(buried | np.vstack([buried[:1], buried[:-1]]))
    assert seen.mean() > 0.5
    assert wrong(theirs, ours, seen, OF_CONTACTS) == {}
    assert "actor height_scan" in theirs[0].values


@pytest.mark.parametrize("task", ["Mjlab-Cartpole-Balance", "Mjlab-Cartpole-Swingup"])
def test_a_cart_that_runs_freely_stays_with_that_of_mujoco_warp(task: str, env_of: Callable[..., Any]) -> None:
    theirs, ours = (run(env_of(task, side), STEPS) for side in (Theirs, Ours))
    for one, other in zip(theirs, ours, strict=True):
        for name in ("qpos", "qvel"):
            scale = max(1.0, np.abs(one.state[name]).max())
            assert np.abs(one.state[name] - other.state[name]).max() <= TOLERANCE * scale


def test_a_task_with_a_camera_runs_and_sees_what_mujoco_warp_draws(env_of: Callable[..., Any]) -> None:
    theirs, ours = (env_of(CAMERAS[0], side, 2) for side in (Theirs, Ours))
    assert np.array_equal(state(theirs)["qpos"], state(ours)["qpos"])
    first, second = (run(env, 1) for env in (theirs, ours))
    assert wrong(first[:1], second[:1], np.ones((1, 2), bool), ()) == {}
