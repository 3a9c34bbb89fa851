"""Mimic joints: they start, are written and are commanded where their leaders put them."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import tightloop as tl
from tightloop.env import JointTarget, Observed, Task, VectorEnv

LINK = """<link name="{name}"><inertial><mass value="1"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>"""
JOINT = """<joint name="{name}" type="revolute"><parent link="base"/><child link="{name}_link"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" effort="10" velocity="10"/>{mimic}</joint>"""
#: ``next`` follows ``last``, which follows ``lead``: 0.2 * (-0.5 q + 0.1) + 0.3.
MIMICS = {
    "next": '<mimic joint="last" multiplier="0.2" offset="0.3"/>',
    "lead": "",
    "last": '<mimic joint="lead" multiplier="-0.5" offset="0.1"/>',
    "free": "",
}
FINGERS = ["arm/fr3_finger_joint1", "arm/fr3_finger_joint2"]


def row(lead: float, free: float = 0.0) -> list[float]:
    """Return positions of all joints, which are sorted as in the file."""
    return [0.2 * (-0.5 * lead + 0.1) + 0.3, lead, -0.5 * lead + 0.1, free]


@pytest.fixture
def scene(tmp_path: Path) -> tl.Scene:
    path = tmp_path / "robot.urdf"
    joints = "".join(LINK.format(name=f"{name}_link") + JOINT.format(name=name, mimic=m) for name, m in MIMICS.items())
    path.write_text(f'<robot name="m"><link name="base"/>{joints}</robot>')
    scene = tl.Scene(gravity=(0, 0, 0))
    scene.add_urdf(path)
    return scene


def start(scene: tl.Scene) -> Any:
    """Launch a scene, which may not warn, and return the positions of its first world before and after a step."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with tl.launch(scene, worlds=2, precision="f64", fields=("joint_q", "joint_qd")) as sim:
            first = np.array(sim.forward().joint_q[1])
            after = sim.step()
            assert np.abs(after.joint_qd).max() < 1e-9, "a robot at rest stays there"
            return first


def test_a_start_without_positions_has_the_offsets(scene):
    np.testing.assert_allclose(start(scene), row(0.0), atol=1e-15)
    np.testing.assert_allclose(scene.robots["m"].joint_q, row(0.0), atol=1e-15)


@pytest.mark.parametrize(
    ("given", "lead", "free"),
    [
        ({"lead": 0.7}, 0.7, 0.0),
        ({".*": -0.4}, -0.4, -0.4),
        (1.5, 1.5, 1.5),
        ({"lead": -1.3, "f.*": 0.2}, -1.3, 0.2),
    ],
    ids=str,
)
def test_the_start_of_a_leader_is_that_of_its_followers(scene, given, lead, free):
    robot = scene.robots["m"]
    robot.joint_q = given
    np.testing.assert_allclose(robot.joint_q, row(lead, free), atol=1e-15)
    np.testing.assert_allclose(robot.joint_target_q, row(lead, free), atol=1e-15)
    np.testing.assert_allclose(start(scene), row(lead, free), atol=1e-15)
    again = tl.Scene.from_toml(scene.to_toml(), ".")
    np.testing.assert_array_equal(again.robots["m"].joint_q, robot.joint_q)
    np.testing.assert_array_equal(start(again), start(scene))


def test_an_entry_of_a_leader_moves_its_followers_and_an_entry_of_theirs_counts(scene):
    robot = scene.robots["m"]
    positions = robot.joint_q
    positions[1] = 0.6
    np.testing.assert_allclose(positions, row(0.6), atol=1e-15)
    robot.joint_q[1:4] = [0.8, 0.25, -0.1]
    np.testing.assert_allclose(robot.joint_q, [row(0.8)[0], 0.8, 0.25, -0.1], atol=1e-15)
    robot.joint_q[3] = 0.5
    np.testing.assert_allclose(robot.joint_q, [row(0.8)[0], 0.8, 0.25, 0.5], atol=1e-15)


def test_a_follower_that_is_given_otherwise_starts_there_and_is_reported(scene):
    scene.robots["m"].joint_q = {"lead": 0.5, "last": 0.5}
    with (
        pytest.warns(tl.TightloopWarning, match=r"`m` starts with `last` at 0\.5000 rad.*`lead` puts it at -0\.1500"),
        tl.launch(scene, worlds=1, precision="f64") as sim,
    ):
        np.testing.assert_allclose(sim.forward().joint_q[0], [row(0.5)[0], 0.5, 0.5, 0.0], atol=1e-15)


def test_a_follower_whose_leader_puts_it_outside_of_its_limits_is_reported(tmp_path):
    joints = {"lead": "", "after": '<mimic joint="lead" multiplier="1" offset="2.5"/>'}
    parts = "".join(LINK.format(name=f"{name}_link") + JOINT.format(name=name, mimic=m) for name, m in joints.items())
    path = tmp_path / "robot.urdf"
    path.write_text(f'<robot name="m"><link name="base"/>{parts}</robot>')
    scene = tl.Scene(gravity=(0, 0, 0))
    scene.add_urdf(path)
    message = r"outside of joint limits: `after` at 2\.5000 rad \(-2\.0000 to 2\.0000\).*mend <mimic> or <limit>"
    with pytest.warns(tl.TightloopWarning, match=message):
        tl.launch(scene, worlds=1).close()


def test_equal_values_of_an_array_reach_the_daemon_as_they_are(scene):
    scene.robots["m"].joint_q = [0.3, 0.3, 0.3, 0.3]
    with pytest.warns(tl.TightloopWarning, match="starts with"), tl.launch(scene, worlds=1, precision="f64") as sim:
        assert sim.forward().joint_q[0].tolist() == [0.3] * 4


def test_a_scene_file_with_one_position_for_all_joints_has_followers_where_they_belong(scene):
    text = scene.to_toml().replace("[[robot]]", "[[robot]]\njoint_q = 0.5")
    assert "joint_q = 0.5" in text
    np.testing.assert_allclose(start(tl.Scene.from_toml(text, ".")), row(0.5, 0.5), atol=1e-15)


@pytest.mark.parametrize("call", ["write", "reset"])
def test_states_by_name_move_followers_in_the_worlds_of_the_mask(scene, call):
    mask = np.array([True, False, True])
    with tl.launch(scene, worlds=3, precision="f64") as sim:
        lead, speed = np.array([0.4, 9.9, -0.8]), np.array([1.0, 9.0, -2.0])
        frame = getattr(sim, call)(joint_q={"m/lead": lead}, joint_qd={"m": {"lead": speed}}, mask=mask)
        np.testing.assert_allclose(frame.joint_q, [row(0.4), row(0.0), row(-0.8)], atol=1e-15)
        expected = [[-0.1 * v, v, -0.5 * v, 0.0] for v in (1.0, 0.0, -2.0)]
        np.testing.assert_allclose(frame.joint_qd, expected, atol=1e-15)
        # what is given by name counts, and so does an array
        frame = getattr(sim, call)(joint_q={"m/lead": 0.3, "m/next": 0.31})
        np.testing.assert_allclose(frame.joint_q, [[0.31, 0.3, row(0.3)[2], 0.0]] * 3, atol=1e-15)
        given = [0.32, 0.4, -0.1, 0.2]
        assert getattr(sim, call)(joint_q=given).joint_q.tolist() == [given] * 3
        frame = getattr(sim, call)(joint_q={"m": given, "m/lead": 0.7})
        np.testing.assert_allclose(frame.joint_q, [row(0.7, 0.2)] * 3, atol=1e-15)


def test_written_positions_that_contradict_are_reported_once(scene):
    with tl.launch(scene, worlds=2) as sim:
        with pytest.warns(
            tl.TightloopWarning, match=r"joint_q of `m/next` is 0\.0000 in world 0, and its leader `m/lead`"
        ):
            sim.write(joint_q=np.zeros(4))
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            sim.write(joint_q=np.zeros(4))


def test_draws_of_a_leader_move_its_followers(scene):
    scene.robots["m"].joint_q = {"lead": 0.2}
    scene.randomize(joint_q={"m/lead": tl.Uniform(-1, 1)}, joint_qd={"m/lead": tl.Uniform(-1, 1)})
    with tl.launch(scene, worlds=50, precision="f64") as sim:
        for frame in (sim.forward(), sim.reset(), sim.reset(mask=np.arange(50) % 2 == 0)):
            lead, speed = frame.joint_q[:, 1], frame.joint_qd[:, 1]
            assert np.ptp(lead) > 1.0
            np.testing.assert_allclose(frame.joint_q, [row(one) for one in lead], atol=1e-15)
            np.testing.assert_allclose(frame.joint_qd[:, [0, 2]], np.outer(speed, [-0.1, -0.5]), atol=1e-15)


def test_a_gripper_that_is_commanded_by_its_leader_closes_as_one(lesson):
    start = np.array([*lesson(driven=True).robots["arm"].joint_q[:7], 0.04, 0.04])
    scene = lesson(driven=True)
    scene.robots["arm"].joint_q = start
    fields = ("joint_q", "joint_target_q", "joint_torque")
    with (
        tl.launch(scene, worlds=2, precision="f64", fields=fields) as alone,
        tl.launch(scene, worlds=2, precision="f64", fields=fields) as both,
    ):
        goals = np.array([0.01, 0.03])
        one = alone.forward()
        for _ in range(60):
            one = alone.step(joint_target_q={FINGERS[0]: goals})
            two = both.step(joint_target_q={FINGERS[0]: goals, FINGERS[1]: goals})
            np.testing.assert_array_equal(one.joint_q, two.joint_q)
            np.testing.assert_array_equal(one.joint_target_q[:, 8], goals)
            assert np.abs(one.joint_q[:, 7] - one.joint_q[:, 8]).max() < 1e-4, "both fingers move as one"
        np.testing.assert_allclose(one.joint_q[:, 7], goals, atol=1e-3)
        # a finger that is named goes its own way
        frame = alone.step(joint_target_q={FINGERS[0]: 0.01, FINGERS[1]: 0.02})
        assert frame.joint_target_q[:, 7:].tolist() == [[0.01, 0.02]] * 2


def test_velocity_targets_of_followers_are_scaled_and_forces_are_left_alone(scene):
    robot = scene.robots["m"]
    assert isinstance(robot, tl.Robot)
    robot.joint_target_mode, robot.joint_target_kd = "velocity", 1.0
    robot.joint_target_qd = {"lead": 0.5}
    assert robot.joint_target_qd.tolist() == [-0.05, 0.5, -0.25, 0.0]
    fields = ("joint_target_qd", "joint_f")
    with tl.launch(scene, worlds=1, precision="f64", fields=fields) as sim:
        frame = sim.step(joint_target_qd={"m/lead": 1.0}, joint_f={"m/lead": 2.0})
        assert frame.joint_target_qd[0].tolist() == [-0.1, 1.0, -0.5, 0.0]
        assert frame.joint_f[0].tolist() == [0.0, 2.0, 0.0, 0.0]


def test_an_array_of_targets_that_contradict_is_reported(lesson):
    scene = lesson(driven=True)
    targets = np.array(scene.robots["arm"].joint_q)
    with tl.launch(scene, worlds=1) as sim:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            sim.step(joint_target_q=targets)
        targets[7] = 0.01
        with pytest.warns(
            tl.TightloopWarning, match=r"`arm/fr3_finger_joint2` is 0\.0500.*`arm/fr3_finger_joint1`.*drives"
        ):
            sim.step(joint_target_q=targets)


def test_targets_of_the_scene_that_contradict_are_reported(lesson):
    scene = lesson(driven=True)
    arm = scene.robots["arm"]
    assert isinstance(arm, tl.Robot)
    arm.joint_target_q = {"fr3_finger_joint1": 0.01}
    assert arm.joint_target_q[8] == 0.01
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        tl.launch(scene, worlds=1).close()
    arm.joint_target_q[8] = 0.03
    with pytest.warns(
        tl.TightloopWarning, match=r"`arm` has targets with `fr3_finger_joint2` at 0\.0300 m.*work against"
    ):
        tl.launch(scene, worlds=1).close()


def test_a_control_of_a_task_that_moves_a_leader_moves_its_followers(lesson, envs):
    class Grip(Task):
        fields = ("joint_q",)
        max_episode_steps = 100

        def scene(self) -> tl.Scene:
            scene = lesson(driven=True)
            scene.robots["arm"].joint_q[7:] = 0.04
            return scene

        def controls(self) -> list[Any]:
            return [JointTarget([FINGERS[0]], 0.02)]

        def observed(self) -> list[Observed]:
            return [Observed("joints", -4, 4, 9)]

        def observe(self, xp: Any, worlds: Any) -> Any:
            return (worlds.joint_q,)

        def reward(self, xp: Any, worlds: Any) -> Any:
            return worlds.joint_q[:, 0]

    env: VectorEnv = envs(Grip, 2)
    env.reset(seed=0)
    for _ in range(60):
        env.step(np.array([[-1.0], [0.0]], np.float32))
    fingers = env.sim.forward().joint_q[:, 7:]
    np.testing.assert_allclose(fingers, [[0.02] * 2, [0.04] * 2], atol=1e-3)


def test_models_from_mujoco_keep_their_reference_positions():
    spec = """<mujoco><option gravity="0 0 0"/><worldbody>
        <body><joint name="a" axis="0 0 1"/><geom size="0.1"/></body>
        <body pos="1 0 0"><joint name="b" axis="0 0 1"/><geom size="0.1"/></body></worldbody>
        <equality><joint joint1="b" joint2="a" polycoef="0.1 -0.5 0 0 0"/></equality></mujoco>"""
    model = mujoco.MjModel.from_xml_string(spec)
    scene = tl.Scene.from_mujoco(model)
    data = mujoco.MjData(model)
    with tl.launch(scene, worlds=1, precision="f64") as sim:
        np.testing.assert_array_equal(sim.forward().joint_q[0], data.qpos)
        name = sim.coord_names[0]
        np.testing.assert_array_equal(sim.write(joint_q={name: 0.3}).joint_q[0], [0.3, 0.0])
