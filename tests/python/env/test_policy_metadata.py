"""What `policy_metadata` says of a task is what its environment does."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tightloop as tl
from tightloop.assets import QUADRUPED
from tightloop.env import VectorEnv, policy_metadata
from tightloop.env.registry import GYMNASIUM_TASKS, TASKS
from tightloop.tasks import velocity
from tightloop.tasks.cartpole import CartPoleBalance
from tightloop.tasks.quadruped import ROBOT, QuadrupedVelocityFlat


def numbers(text: str) -> Any:
    return np.array(text.split(","), np.float64)


@pytest.fixture
def metadata() -> Callable[..., dict[str, str]]:
    def of(task: Any) -> dict[str, str]:
        envs = VectorEnv(task, 1, threads=1)
        try:
            return policy_metadata(envs)
        finally:
            envs.close()

    return of


def test_a_quadruped_has_the_joints_gains_and_parts_of_its_task(metadata: Callable[..., dict[str, str]]) -> None:
    said = metadata("QuadrupedVelocityFlat")
    joints = list(ROBOT.joints)
    assert said["task"] == "tightloop/QuadrupedVelocityFlat-v0" and said["tightloop_version"] == tl.__version__
    assert said["robot_files"] == "quadruped.urdf"
    assert said["joint_names"].split(",") == joints == said["action_names"].split(",")
    assert set(said["action_types"].split(",")) == {"JointTarget"}
    expected: tuple[tuple[str, Any], ...] = (
        ("dt", velocity.DT),
        ("substeps", velocity.SUBSTEPS),
        ("control_dt", velocity.CONTROL_DT),
        ("joint_stiffness", ROBOT.stiffness),
        ("joint_damping", ROBOT.damping),
        ("joint_armature", ROBOT.armature),
        ("joint_effort_limit", (24.0, 24.0, 36.0) * 4),
        ("default_joint_pos", ROBOT.standing),
        ("action_scale", ROBOT.scale),
        ("action_offset", ROBOT.standing),
        ("action_low", -velocity.LIMIT),
        ("action_high", velocity.LIMIT),
        ("observation_sizes", (3, 3, 3, 3, 12, 12, 12, 2)),
        ("observation_history", 1),
    )
    for name, value in expected:
        assert (numbers(said[name]).astype(np.float32) == np.array(value, np.float32)).all(), name
    assert said["observation_names"].split(",")[3:5] == ["command", "joint positions"]
    # a comma within an entry would divide it
    assert said["observation_units"].split(",")[3] == "m/s; rad/s"


def test_scales_and_offsets_are_those_of_each_control(metadata: Callable[..., dict[str, str]]) -> None:
    said = metadata("FrankaPickCube")
    assert said["action_types"].split(",") == ["JointDelta"] * 7 + ["Gripper"]
    assert said["action_names"].split(",")[6:] == ["fr3_joint7", "fr3_finger_joint1"]
    # increments have no offset; the gripper goes from -1 cm, which presses, to 4 cm
    np.testing.assert_allclose(numbers(said["action_offset"]), [0.0] * 7 + [0.015])
    np.testing.assert_allclose(numbers(said["action_scale"]), [0.1] * 7 + [0.025])
    # the cube's free joint has no single coordinate
    assert len(said["joint_names"].split(",")) == len(said["default_joint_pos"].split(",")) == 9


def test_a_task_of_a_file_has_the_name_that_makes_it(metadata: Callable[..., dict[str, str]], tmp_path: Path) -> None:
    file = tmp_path / "own.py"
    file.write_text("from tightloop.tasks.cartpole import CartPoleBalance\nclass Own(CartPoleBalance): pass\n")
    assert metadata(f"{file}:Own")["task"] == f"{file}:Own"


def test_joints_keep_a_slash_in_their_names(metadata: Callable[..., dict[str, str]], tmp_path: Path) -> None:
    file = tmp_path / "dog.urdf"
    file.write_text(re.sub(r'joint name="(.._)(hip|thigh|calf)', r'joint name="\1/\2', QUADRUPED.read_text()))
    said = metadata(QuadrupedVelocityFlat(model=file))
    joints = [joint.replace("_", "_/") for joint in ROBOT.joints]
    assert said["joint_names"].split(",") == said["action_names"].split(",") == joints


@pytest.mark.parametrize("task", ["Ant-v5", *TASKS])
def test_lists_are_as_long_as_what_they_describe(task: str, metadata: Callable[..., dict[str, str]]) -> None:
    said = metadata(task)
    assert said["task"] == (f"tightloop/{task}" if task in GYMNASIUM_TASKS else f"tightloop/{task}-v0")
    envs = VectorEnv(said["task"], 1, threads=1)
    spaces = (envs.single_observation_space, envs.single_action_space)
    observed, actions = (int(np.prod(space.shape or ())) for space in spaces)
    envs.close()
    for name in ("action_names", "action_types", "action_scale", "action_offset", "action_low", "action_high"):
        assert len(said[name].split(",")) == actions
    assert (numbers(said["observation_sizes"]) * numbers(said["observation_history"])).sum() == observed
    assert len(numbers(said["observation_low"])) == len(numbers(said["observation_high"])) == observed


def test_a_task_adds_entries_and_the_environment_goes_on(metadata: Callable[..., dict[str, str]]) -> None:
    class Own(CartPoleBalance):
        def policy_metadata(self) -> dict[str, Any]:
            more = {"flag": np.True_, "one": np.array(0.1, np.float32), "flags": np.array([True, False])}
            return {"command_names": ("none, yet", "more"), "phase_hz": np.float32(2.5), "dt": "own", **more}

    said = metadata(Own)
    assert said["command_names"] == "none; yet,more" and said["phase_hz"] == "2.5" and said["dt"] == "own"
    assert (said["flag"], said["one"], said["flags"]) == ("True", "0.1", "True,False")
    assert said["task"].endswith("Own")
    ours, plain = VectorEnv(Own, 4, threads=1), VectorEnv(CartPoleBalance, 4, threads=1)
    for envs in (ours, plain):
        envs.reset(seed=1)
    policy_metadata(ours)
    actions = np.full((4, 1), 0.3, np.float32)
    for _ in range(5):
        assert np.array_equal(ours.step(actions)[0], plain.step(actions)[0])
    for envs in (ours, plain):
        envs.close()


def test_an_entry_that_is_no_text_is_refused(metadata: Callable[..., dict[str, str]]) -> None:
    class Own(CartPoleBalance):
        def policy_metadata(self) -> dict[str, Any]:
            return {"gait": {"hz": 2.5}}

    with pytest.raises(tl.ArgumentError, match=r"Own.policy_metadata: gait is \{'hz': 2.5\}; give a text, a number"):
        metadata(Own)


@pytest.mark.parametrize("envs", [3, None, "CartPoleBalance", CartPoleBalance])
def test_what_is_no_environment_is_refused(envs: Any) -> None:
    with pytest.raises(tl.ArgumentError, match=r"policy_metadata: envs is .*; give a tightloop.env.VectorEnv"):
        policy_metadata(envs)


class Chosen(QuadrupedVelocityFlat):
    """It chooses its robot itself, and takes no option that does."""

    def __init__(self, pushes: float | None = None) -> None:
        super().__init__(pushes, stiffness={".*_calf": 50.0})


def test_options_are_reported_of_tasks_that_take_them() -> None:
    for task, told in ((Chosen(), False), (QuadrupedVelocityFlat(stiffness={".*_calf": 50.0}), True)):
        envs = VectorEnv(task, 1)
        metadata = policy_metadata(envs)
        envs.close()
        assert ("task_options" in metadata) == told
