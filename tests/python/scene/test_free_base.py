"""A floating robot: where it starts, how it falls, and what is refused of its free joint."""

from __future__ import annotations

import numpy as np
import pytest

import tightloop as tl

URDF = """
<robot name="box">
  <link name="trunk"><inertial><origin xyz="0.1 0 0"/><mass value="2"/>
    <inertia ixx="0.1" iyy="0.2" izz="0.25" ixy="0" ixz="0" iyz="0"/></inertial></link>
</robot>
"""
TURN = (0.0, 0.6, 0.0, 0.8)


@pytest.fixture
def scene(tmp_path) -> tl.Scene:
    (tmp_path / "box.urdf").write_text(URDF)
    scene = tl.Scene(dt=1e-3, substeps=10)
    scene.add_urdf(tmp_path / "box.urdf", name="box", pos=(1, 2, 3), quat=TURN, floating=True)
    return scene


@pytest.fixture
def sim(scene):
    with tl.launch(scene, worlds=3, precision="f64", fields=("joint_q", "joint_qd", "body_q", "body_qd")) as sim:
        yield sim


def test_state_has_a_quaternion_and_starts_at_the_robots_pose(scene, sim):
    robot = scene.robots["box"]
    assert robot.dof_names == [f"floating_base.{part}" for part in ("vx", "vy", "vz", "wx", "wy", "wz")]
    assert sim.coords["box"] == slice(0, 7) and sim.dofs["box"] == slice(0, 6)
    assert sim.coord_names[3] == "box/floating_base.qx"
    np.testing.assert_allclose(robot.joint_q, [1, 2, 3, *TURN])
    frame = sim.reset()
    np.testing.assert_allclose(frame.joint_q, [[1, 2, 3, *TURN]] * 3, atol=1e-15)
    np.testing.assert_allclose(frame.body_q[:, 0], frame.joint_q, atol=1e-15)


def test_free_fall_keeps_spin_about_the_vertical_and_follows_the_parabola(sim):
    q, qd = np.array(sim.reset().joint_q), np.zeros((3, 6))
    q[:, 3:] = [0, 0, 0, 1]
    qd[:, :] = [0.5, 0, 2, 0, 0, 3]
    start = sim.write(joint_q=q, joint_qd=qd)
    center = start.joint_q[0, :3] + [0.1, 0, 0]
    frame = start
    for _ in range(50):
        frame = sim.step()
    # the centre of mass falls by semi-implicit Euler: g h² n (n + 1) / 2
    n, h, t = 500, 1e-3, 0.5
    expected = center + np.array([0.5 * t, 0, 2 * t - 9.81 * h * h * n * (n + 1) / 2])
    turned = np.array([0.1 * np.cos(3 * t), 0.1 * np.sin(3 * t), 0])
    # the frame is stepped by the velocity of its origin, whose circle has the error of the method, r ω² h t
    np.testing.assert_allclose(frame.joint_q[0, :3] + turned, expected, atol=0.1 * 9 * h * t)
    np.testing.assert_allclose(frame.joint_qd[0, 3:], [0, 0, 3], atol=1e-12)
    np.testing.assert_allclose(frame.body_qd[:, 0], frame.joint_qd, atol=1e-12)


def test_quaternions_are_made_unit_and_those_without_direction_refused(sim):
    q = np.array(sim.reset().joint_q)
    q[1, 3:] = [0, 0, 0, 5]
    np.testing.assert_array_equal(sim.write(joint_q=q).joint_q[1, 3:], [0, 0, 0, 1])
    for nothing in (0.0, 1e200):
        q[1, 3:] = nothing
        with pytest.raises(tl.CommandRefused, match=r"box/floating_base.qx` has no direction in world 1"):
            sim.write(joint_q=q)
    np.testing.assert_array_equal(sim.forward().joint_q[1, 3:], [0, 0, 0, 1])


@pytest.mark.parametrize("nothing", [0.0, np.nan])
def test_what_stands_in_worlds_outside_the_mask_is_not_looked_at(sim, nothing):
    before = np.array(sim.reset().joint_q)
    q = np.full_like(before, nothing)
    q[1] = [7, 8, 9, 0, 0, 0, 1]
    after = sim.write(joint_q=q, joint_qd=np.zeros((3, 6)), mask=[False, True, False])
    np.testing.assert_array_equal(after.joint_q[1], q[1])
    np.testing.assert_array_equal(after.joint_q[[0, 2]], before[[0, 2]])
    with pytest.raises(tl.CommandRefused, match="in world 2"):
        sim.write(joint_q=q, mask=[False, True, True])
    with pytest.raises(tl.CommandRefused, match="in world 0"):
        sim.write(joint_q=q)


def test_targets_of_a_free_body_are_refused_and_the_daemon_serves_on(scene, sim):
    targets = np.zeros((3, 6))
    sim.step(joint_target_q=targets, joint_target_qd=targets)
    targets[2, 1] = 0.5
    for field in ("joint_target_q", "joint_target_qd"):
        with pytest.raises(tl.CommandRefused, match=rf"{field}` is 0.5 in world 2 for `box/floating_base.vy`.*joint_f"):
            sim.step(**{field: targets})
    assert sim.forward().step[0] == 1
    scene.robots["box"].joint_target_q = [0.1] * 6
    with pytest.raises(tl.SceneError, match="`floating_base` is free and cannot be driven"):
        tl.launch(scene, worlds=1)


def test_single_gain_spares_the_free_joint(scene):
    scene.robots["box"].joint_target_ke = 100
    tl.launch(scene, worlds=1).close()
