"""`JointDelta` with a lead: targets stay near their joints."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray

import tightloop as tl
from tightloop.env import JointDelta, Observed, Task, VectorEnv
from tightloop.tasks import franka
from tightloop.tasks.pick_cube import START, FrankaPickCube

HEIGHT = 21  # of the tcp, in the observation
PRESS, LIFT = 30, 8  # steps
ANT_JOINTS = 8


class Delta(FrankaPickCube):
    """The arm alone, whose joints come in any order."""

    max_episode_steps = 1000
    noise = None

    order: ClassVar[Sequence[int]] = range(7)

    def controls(self) -> Sequence[Any]:
        return [JointDelta([franka.ARM[joint] for joint in self.order], 0.1, lead=self.lead)]


def delta(**attributes: Any) -> type[Delta]:
    return type("Changed", (Delta,), {"lead": 0.1, **attributes})


def heights(order: Sequence[int] = range(7), **attributes: Any) -> NDArray[np.float32]:
    """Heights of the tcp while the arm leans forward onto the ground, and then back."""
    envs = VectorEnv(delta(order=order, **attributes), 2)
    try:
        envs.reset(seed=0)
        shown = []
        for step in range(PRESS + LIFT):
            actions = np.zeros((2, 7), np.float32)
            actions[:, list(order).index(1)] = 1.0 if step < PRESS else -1.0
            shown.append(envs.step(actions)[0][:, HEIGHT].copy())
        return np.array(shown)
    finally:
        envs.close()


def test_an_arm_that_was_pressed_to_the_ground_comes_up_at_once_with_a_lead() -> None:
    free, led = heights(lead=None), heights()
    for pressed in (free, led):
        assert (pressed[PRESS - 1] < 0.05).all()
    assert (free[-1] - free[PRESS - 1] < 0.02).all()
    assert (led[-1] - led[PRESS - 1] > 0.06).all()


def test_a_lead_that_is_not_reached_changes_nothing() -> None:
    envs = [VectorEnv(delta(lead=lead), 2) for lead in (None, 3.0)]
    try:
        rng = np.random.default_rng(0)
        for env in envs:
            env.reset(seed=0)
        for _ in range(10):
            actions = rng.uniform(-1, 1, (2, 7)).astype(np.float32)
            shown = [env.step(actions)[0] for env in envs]
            assert np.array_equal(*shown)
    finally:
        for env in envs:
            env.close()


@pytest.mark.parametrize("order", [range(6, -1, -1), [3, 1, 5, 0, 2, 6, 4]])
def test_joints_may_come_in_any_order(order: Sequence[int]) -> None:
    assert np.allclose(heights(order), heights(), atol=1e-6)


class Second(Task):
    """The arm after a floating ant, which has one coordinate more than dofs."""

    fields = ("joint_q",)
    max_episode_steps = 1000

    def scene(self) -> tl.Scene:
        scene = tl.Scene(dt=1 / 200, substeps=10)
        scene.add_ground()
        scene.add_urdf(Path(tl.assets.__file__).parent / "ant.urdf", name="ant", pos=(3, 0, 1), floating=True)
        franka.add_arm(scene, START)
        return scene

    def controls(self) -> Sequence[Any]:
        return [JointDelta(franka.ARM, 0.1, lead=0.1)]

    def observed(self) -> Sequence[Observed]:
        return [Observed("joint positions", -6, 6, 7)]

    def observe(self, xp: Any, worlds: Any) -> Sequence[Any]:
        first = 7 + ANT_JOINTS
        return (worlds.joint_q[:, first : first + 7],)

    def reward(self, xp: Any, worlds: Any) -> Any:
        return worlds.joint_q[:, 0] * 0.0


def test_joints_after_a_floating_robot_stay_where_they_are_and_move_as_far_as_their_targets() -> None:
    envs = VectorEnv(Second, 2)
    try:
        envs.reset(seed=0)
        still = [envs.step(np.zeros((2, 7), np.float32))[0] for _ in range(20)][-1]
        assert np.abs(still - START[:7]).max() < 0.06  # the drives give in to the arm's weight
        moved = [envs.step(np.full((2, 7), -1.0, np.float32))[0] for _ in range(10)][-1]
        assert (moved < still - 0.15).all()
    finally:
        envs.close()
