"""Policies of `examples/trained` run inside of rollouts, by their files alone."""

from __future__ import annotations

import json

import numpy as np
import onnx_files
import pytest

import tightloop as tl
from conftest import REPOSITORY
from tightloop.planning.policy_terms import Gravity, Values
from tightloop.tasks.cartpole import CartPoleSwingUp
from tightloop.tasks.humanoid import HumanoidVelocityFlat
from tightloop.tasks.kinematics import projected_gravity, rotate_inverse
from tightloop.tasks.quadruped import QuadrupedVelocityFlat
from tightloop.tasks.reach import FrankaReach

TRAINED = REPOSITORY / "examples/trained"
WALKING = {"QuadrupedVelocityFlat": QuadrupedVelocityFlat, "HumanoidVelocityFlat": HumanoidVelocityFlat}


def exact(function, values):
    """A sine or cosine of float32 with at most half a unit of error."""
    return function(values.astype(np.float64)).astype(values.dtype)


def launched(name, worlds, **options):
    """A task's scene with its robots at rest, and the policy that was trained for it."""
    task = WALKING[name](pushes=0.0)
    return tl.launch(task.scene(), worlds=worlds, fields=("joint_q", "joint_qd"), **options)


def stepped(sim, task, policy, command, frames):
    """What a walking policy does in a loop of steps."""
    scale, offset = (np.array(policy.metadata[f"action_{name}"].split(","), np.float32) for name in ("scale", "offset"))
    low, high = (np.array(policy.act[0].low, np.float32), np.array(policy.act[0].high, np.float32))
    robot, gait = task.robot, np.float32(2 * np.pi * task.gait * 0.02)
    coords, dofs = ([names.index(name) for name in robot.dofs] for names in (sim.coord_names, sim.dof_names))
    frame, action = sim.forward(), np.zeros((sim.worlds, len(dofs)), np.float32)
    phase, seen, states = np.zeros(sim.worlds, np.float32), [], []
    for _ in range(frames):
        quats = frame.joint_q[:, 3:7]
        parts = [
            rotate_inverse(np, quats, frame.joint_qd[:, 0:3]),
            rotate_inverse(np, quats, frame.joint_qd[:, 3:6]),
            projected_gravity(np, quats),
            np.tile(np.float32(command), (sim.worlds, 1)),
            frame.joint_q[:, coords] - np.float32(robot.standing),
            frame.joint_qd[:, dofs],
            action,
            np.stack([exact(np.sin, phase), exact(np.cos, phase)], 1),
        ]
        sizes = [part.shape[1] for part in parts]
        low_seen, high_seen = (
            np.array(policy.metadata[f"observation_{end}"].split(","), np.float32) for end in ("low", "high")
        )
        assert sum(sizes) == len(low_seen)
        seen.append(np.clip(np.concatenate(parts, 1), low_seen, high_seen))
        action = np.clip(policy(seen[-1]), np.float32(-4), np.float32(4))
        targets = np.clip(offset + scale * action, low, high)
        joints = dict(zip(robot.dofs, targets.T, strict=True))
        frame = sim.step(joint_target_q=joints)
        states.append(frame.joint_q.copy())
        phase = phase + gait
    return np.stack(seen), np.stack(states)


@pytest.mark.parametrize("name", WALKING)
def test_a_walking_policy_has_the_bits_of_a_loop_of_steps(name):
    task, policy = WALKING[name](), tl.Policy(TRAINED / f"{name}.onnx")
    command = (0.5, 0.1, -0.3)
    with launched(name, 5) as sim:
        sim.reset(seed=3)
        start = sim.snapshot()
        seen, states = stepped(sim, task, policy, command, 100)
        rollout = sim.rollout(
            policy=policy, frames=100, inputs={"command": command}, fields=("joint_q", "observation"), start=start
        )
    assert np.array_equal(rollout.observation, seen)
    assert np.array_equal(rollout.joint_q, states)


@pytest.mark.parametrize(("name", "most"), [("QuadrupedVelocityFlat", 0.06), ("HumanoidVelocityFlat", 0.1)])
def test_trained_robots_walk_by_their_files_alone(name, most):
    with launched(name, 16) as sim:
        sim.reset(seed=1)
        rollout = sim.rollout(
            policy=TRAINED / f"{name}.onnx",
            frames=500,
            inputs={"command": (0.5, 0.0, 0.0)},
            fields=("joint_q", "observation"),
        )
    velocity = rollout.observation[100:, :, 0:2]
    # docs/pages/use/walking.md has 0.04 and 0.05 m/s
    assert np.linalg.norm(velocity - [0.5, 0.0], axis=2).mean() < most
    assert rollout.joint_q[-1, :, 2].min() > 0.2
    assert not rollout.faulted.any()


def test_other_policies_run_by_their_files_alone():
    with tl.launch(CartPoleSwingUp().scene(), worlds=32, fields=("joint_q", "joint_qd")) as sim:
        sim.reset(seed=2)
        rollout = sim.rollout(policy=TRAINED / "CartPoleSwingUp.onnx", frames=400, fields=("joint_q",))
    assert (np.cos(rollout.joint_q[-1, :, 1]) > np.cos(0.2)).mean() > 0.9
    task = FrankaReach()
    with tl.launch(task.scene(), worlds=8, fields=("joint_q", "joint_qd", "site_q")) as sim:
        goal = {"goal: position": (0.5, 0.1, 0.3), "goal: orientation": (1.0, 0.0, 0.0, 0.0)}
        rollout = sim.rollout(policy=TRAINED / "FrankaReach.onnx", frames=120, inputs=goal, fields=("site_q",))
    assert np.linalg.norm(rollout.site_q[-1, :, 0, :3] - goal["goal: position"], axis=1).max() < 0.03


def test_a_robot_may_have_another_name_than_in_training():
    task = QuadrupedVelocityFlat(pushes=0.0)
    scene = tl.Scene(dt=1 / 200, substeps=4)
    scene.add_ground()
    robot = scene.add_urdf(task.robot.file, name="rex", floating=True, pos=(0.0, 0.0, task.robot.height))
    pose = dict(zip(task.robot.joints, task.robot.standing, strict=True))
    robot.joint_q, robot.joint_target_q = pose, pose
    robot.joint_target_ke, robot.joint_target_kd = task.robot.stiffness, task.robot.damping
    with tl.launch(scene, worlds=4, fields=("joint_q", "joint_qd")) as sim:
        rollout = sim.rollout(
            policy=TRAINED / "QuadrupedVelocityFlat.onnx", frames=150, inputs={"command": (0.5, 0, 0)}
        )
    assert rollout.joint_q[-1, :, 0].min() > 0.8


def test_the_metadata_of_a_task_has_what_it_sees_and_drives(envs):
    from tightloop.env import policy_metadata

    metadata = policy_metadata(envs("QuadrupedVelocityFlat", 1))
    assert len(json.loads(metadata["observation_terms"])) == 8
    assert (
        metadata["observation_terms"] == tl.Policy(TRAINED / "QuadrupedVelocityFlat.onnx").metadata["observation_terms"]
    )
    assert json.loads(metadata["action_drives"])[0]["command"] == "joint_target_q"
    # a control that reads the frame, and an observation that is more than columns
    assert "action_drives" not in policy_metadata(envs("FrankaReach", 1, control="torque"))
    assert "observation_terms" not in policy_metadata(envs("AntRun", 1))


@pytest.mark.parametrize(
    ("kind", "named", "match"),
    [
        (Values, {"field": "joint_q", "columns": 3}, "columns is 3; give a list of whole numbers"),
        (Values, {"field": "joint_q", "columns": "ab"}, "columns is 'ab'"),
        (Values, {"field": "joint_q", "columns": [0.5]}, r"columns is \[0\.5\]"),
        (Values, {"field": "joint_q", "of": 5}, "of is 5; give a name"),
        (Values, {"field": "joint_q", "scale": 1e39}, r"scale is 1e\+39; give numbers of single precision"),
        (Gravity, {"of": ["a"]}, r"of is \['a'\]"),
        (tl.Drive, {"command": "joint_f", "values": [1.5]}, r"values is \[1\.5\]"),
        (tl.Drive, {"command": "joint_f", "followers": [("a", "b")]}, r"give \(name, leader, multiplier, offset"),
        (tl.Drive, {"command": "joint_f", "followers": [("a", 5, 1.0, 0.0)]}, "follower or leader is 5"),
    ],
)
def test_parts_that_mean_nothing_are_refused_by_name(kind, named, match):
    with pytest.raises(tl.ArgumentError, match=match):
        kind(**named)


@pytest.mark.parametrize(
    ("key", "text", "match"),
    [
        ("action_drives", '[{"command":5}]', "metadata `action_drives`: Drive: command is 5"),
        ("action_drives", "[" * 100000, "is nested too deeply"),
        ("action_drives", '[{"command":"joint_f","of":' + "[" * 600 + "]" * 600 + "}]", "metadata `action_drives`"),
        ("observation_terms", '[{"kind":"values"}]', "field.*policy_metadata"),
    ],
)
def test_metadata_of_a_stranger_is_refused_by_name(tmp_path, key, text, match):
    path = onnx_files.write(tmp_path / "p.onnx", [onnx_files.linear([[0.0]], [0.0])], 1, {key: text})
    with pytest.raises(tl.ArgumentError, match=match):
        tl.Policy(path)


def test_names_in_a_file_are_no_regular_expressions(pendulum, tmp_path):
    drive = '[{"command":"joint_f","of":"arm/elbow"}]'
    with tl.launch(pendulum, worlds=1, fields=("joint_q",)) as sim:
        for name, works in (
            ("arm/elb*", True),
            ("*/el*w", True),
            ("arm/elb.w", False),
            ("(a|a)*(r|m)*/(e|e)*$", False),
        ):
            metadata = {
                "observation_terms": json.dumps([{"kind": "values", "field": "joint_q", "of": name}]),
                "action_drives": drive,
            }
            path = onnx_files.write(tmp_path / "p.onnx", [onnx_files.linear([[0.0]], [0.0])], 1, metadata)
            if works:
                sim.rollout(policy=path, frames=1)
                continue
            with pytest.raises(tl.ArgumentError, match="in this scene"):
                sim.rollout(policy=path, frames=1)
