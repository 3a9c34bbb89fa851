"""A driven ball joint: its target is a rotation vector."""

from __future__ import annotations

import numpy as np

import tightloop as tl

URDF = """
<robot name="ball">
  <link name="base"/>
  <link name="top"><inertial><mass value="1"/>
    <inertia ixx="0.02" iyy="0.03" izz="0.04" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="neck" type="spherical"><parent link="base"/><child link="top"/></joint>
</robot>
"""


def test_ball_settles_where_its_rotation_vector_points_and_holds_its_start(tmp_path):
    (tmp_path / "ball.urdf").write_text(URDF)
    scene = tl.Scene(dt=1e-3, substeps=10, gravity=(0, 0, 0))
    robot = scene.add_urdf(tmp_path / "ball.urdf", name="ball")
    robot.joint_target_ke, robot.joint_target_kd = 4.0, 0.8
    angle = 2.5
    axis = np.array([0.6, -0.64, 0.48])
    quat = [*(axis * np.sin(angle / 2)), np.cos(angle / 2)]
    with tl.launch(scene, worlds=2, precision="f64", fields=("joint_q", "joint_qd")) as sim:
        frame = sim.step()
        np.testing.assert_array_equal(frame.joint_q[0], [0, 0, 0, 1])
        target = np.zeros((2, 3))
        target[1] = angle * axis
        for _ in range(400):
            frame = sim.step(joint_target_q=target)
        # 4 s are more than 20 time constants kd / ke of the drive
        np.testing.assert_allclose(frame.joint_q[1], quat, atol=1e-6)
        np.testing.assert_allclose(frame.joint_qd[1], 0, atol=1e-6)
        np.testing.assert_array_equal(frame.joint_q[0], [0, 0, 0, 1])


def test_ball_near_its_target_swings_at_the_frequency_of_its_stiffness(tmp_path):
    (tmp_path / "ball.urdf").write_text(URDF)
    scene = tl.Scene(dt=1e-4, substeps=10, gravity=(0, 0, 0))
    scene.add_urdf(tmp_path / "ball.urdf", name="ball").joint_target_ke = 4.0
    small = 1e-3
    with tl.launch(scene, worlds=3, precision="f64", fields=("joint_q",)) as sim:
        q = np.zeros((3, 4))
        q[:, :3], q[:, 3] = 0.5 * small * np.eye(3), np.cos(0.5 * small)
        sim.write(joint_q=q)
        periods = 2 * np.pi * np.sqrt(np.array([0.02, 0.03, 0.04]) / 4.0)
        turns = np.array([2 * sim.step().joint_q[[0, 1, 2], [0, 1, 2]] for _ in range(1000)])
    times = np.arange(1, 1001) * 1e-3
    expected = small * np.cos(2 * np.pi * times[:, None] / periods)
    # the method's phase error is of order dt: 1e-4 of a period's swing a step, far below 1 % in a second
    np.testing.assert_allclose(turns, expected, atol=0.01 * small)
