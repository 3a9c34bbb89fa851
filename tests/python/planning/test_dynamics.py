"""Kinematics and dynamics at given states: the same numbers as a simulation's, and no world of it is touched."""

from __future__ import annotations

import numpy as np
import pytest

import tightloop as tl
from conftest import PENDULUM, REPOSITORY

FIELDS = ("joint_q", "joint_qd", "joint_qdd", "body_q", "body_qd", "body_jacobian", "mass_matrix", "bias_force")

# A floating base and a ball, so that coordinates are more than dofs; damped, so that this part of the force shows
WALKER = """<robot name="walker">
  <link name="trunk"><inertial><origin xyz="0.1 0 0.02"/><mass value="3"/>
    <inertia ixx="0.1" iyy="0.2" izz="0.25" ixy="0.01" ixz="0" iyz="0"/></inertial></link>
  <link name="leg"><inertial><origin xyz="0 0.03 -0.2"/><mass value="1"/>
    <inertia ixx="0.02" iyy="0.03" izz="0.01" ixy="0" ixz="0.001" iyz="0"/></inertial></link>
  <link name="foot"><inertial><origin xyz="0 0 -0.1"/><mass value="0.5"/>
    <inertia ixx="0.002" iyy="0.003" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="hip" type="spherical"><parent link="trunk"/><child link="leg"/><origin xyz="0 0.1 -0.1"/>
    <dynamics damping="0.3"/></joint>
  <joint name="knee" type="continuous"><parent link="leg"/><child link="foot"/><origin xyz="0 0 -0.4"/>
    <axis xyz="0 1 0"/><dynamics damping="0.7"/></joint>
</robot>
"""


@pytest.fixture
def walker(tmp_path) -> tl.Scene:
    (tmp_path / "walker.urdf").write_text(WALKER)
    scene = tl.Scene(dt=1e-3, substeps=2)
    scene.add_urdf(tmp_path / "walker.urdf", pos=(0.3, 0.2, 0.7), floating=True).joint_armature = [0] * 6 + [0.02] * 4
    return scene


def states(worlds: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Random positions, velocities and accelerations of walkers."""
    random = np.random.default_rng(4)
    q = random.normal(size=(worlds, 12))
    for first in (3, 7):
        q[:, first : first + 4] /= np.linalg.norm(q[:, first : first + 4], axis=1, keepdims=True)
    return q, random.normal(size=(worlds, 10)), 10 * random.normal(size=(worlds, 10))


def test_they_are_those_of_the_simulation(walker):
    q, qd, qdd = states(5)
    with tl.launch(walker, worlds=5, precision="f64", fields=FIELDS) as sim:
        frame = sim.write(joint_q=q, joint_qd=qd)
        dynamics = sim.dynamics
        assert (dynamics.forward_kinematics(frame.joint_q) == frame.body_q).all()
        assert (dynamics.body_velocity(frame.joint_q, qd) == frame.body_qd).all()
        assert (dynamics.body_jacobian(frame.joint_q) == frame.body_jacobian).all()
        assert (dynamics.mass_matrix(frame.joint_q) == frame.mass_matrix).all()
        newton_euler = np.einsum("wij,wj->wi", frame.mass_matrix, qdd) + frame.bias_force
        forces = sim.inverse_dynamics(frame.joint_q, qd, qdd, damping=False)
        np.testing.assert_allclose(forces, newton_euler, rtol=1e-13, atol=1e-12)


def test_its_force_gives_the_acceleration_asked_for(walker):
    q, qd, qdd = states(5)
    with tl.launch(walker, worlds=5, precision="f64", fields=FIELDS) as sim:
        sim.step(joint_f=sim.inverse_dynamics(q, qd, qdd))
        frame = sim.write(joint_q=q, joint_qd=qd)
        np.testing.assert_allclose(frame.joint_qdd, qdd, rtol=1e-9, atol=1e-9)


def test_positions_alone_give_what_holds_the_robot(pendulum):
    with tl.launch(pendulum, worlds=1, precision="f64", fields=("joint_q", "joint_qd")) as sim:
        held = sim.inverse_dynamics([0.3, -0.2])
        assert held.shape == (2,) and abs(held[0]) > 1.0
        frame = sim.step(joint_f=held)
        for _ in range(9):
            frame = sim.step()
        np.testing.assert_allclose(frame.joint_q, [[0.3, -0.2]], atol=1e-12)


def test_no_world_is_touched(walker):
    q, qd, qdd = states(1)
    with tl.launch(walker, worlds=2, fields=FIELDS) as sim:
        before = sim.step(joint_f=np.ones(10)).copy()
        sim.forward_kinematics(q)
        sim.inverse_dynamics(q, qd, qdd)
        after = sim.forward()
        for field in ("joint_q", "joint_qd", "step"):
            assert (getattr(after, field) == getattr(before, field)).all()


def test_velocities_of_one_call_do_not_stay_for_the_next(walker):
    q, qd, _ = states(1)
    dynamics = tl.Dynamics(walker)
    still = dynamics.inverse_dynamics(q[0])
    assert (dynamics.inverse_dynamics(q[0], qd[0]) != still).any()
    assert (dynamics.inverse_dynamics(q[0]) == still).all()


def test_one_state_goes_with_many(walker):
    q, qd, qdd = states(7)
    dynamics = tl.Dynamics(walker)
    forces = dynamics.inverse_dynamics(q[0], qd, qdd[0])
    assert forces.shape == (7, 10)
    assert (forces[4] == dynamics.inverse_dynamics(q[0], qd[4], qdd[0])).all()
    assert dynamics.forward_kinematics(q.astype(np.float32)).shape == (7, 3, 7)
    assert dynamics.dof_names[6:] == ["walker/hip.wx", "walker/hip.wy", "walker/hip.wz", "walker/knee"]


def test_a_robot_that_cannot_move_has_poses(tmp_path):
    (tmp_path / "post.urdf").write_text('<robot name="post"><link name="post"/></robot>')
    scene = tl.Scene()
    scene.add_urdf(tmp_path / "post.urdf", pos=(1, 2, 3))
    dynamics = tl.Dynamics(scene)
    np.testing.assert_array_equal(dynamics.forward_kinematics([]), [[1, 2, 3, 0, 0, 0, 1]])
    assert dynamics.forward_kinematics(np.empty((4, 0))).shape == (4, 1, 7)
    assert dynamics.inverse_dynamics([]).shape == (0,)


@pytest.mark.parametrize(
    "arguments, says",
    [
        (([0.0] * 3,), r"joint_q has shape \(3,\); give \(12,\), or \(n, 12\)"),
        ((np.zeros((2, 12)), np.zeros((3, 10))), "arrays of 2 and 3 states"),
        ((np.zeros((0, 12)),), "arrays of 0 states"),
        ((["a"] * 12,), "joint_q: .*real number"),
        ((np.zeros(12),), "quaternion"),
        ((np.ones(12), np.full(10, np.nan)), "joint_qd` is NaN"),
        ((np.ones((3, 12)), np.eye(3, 10), np.full((3, 10), np.inf)), "joint_qdd"),
    ],
)
def test_wrong_arguments_are_refused_by_name(walker, arguments, says):
    with pytest.raises(tl.ArgumentError, match=says):
        tl.Dynamics(walker).inverse_dynamics(*arguments)


def test_an_observer_computes_too_and_a_changed_file_is_noticed(tmp_path):
    urdf = tmp_path / "pendulum.urdf"
    urdf.write_text(PENDULUM)
    scene = tl.Scene()
    scene.add_urdf(urdf, name="arm")
    with tl.launch(scene, worlds=1) as sim:
        observer = tl.attach(sim.name)
        assert observer.inverse_dynamics([0.3, 0.0]).shape == (2,)
        observer.close()
        urdf.write_text(PENDULUM.replace('<mass value="1"/>', '<mass value="2"/>'))
        with pytest.raises(tl.SceneError, match="have changed since"):
            sim.inverse_dynamics([0.3, 0.0])


def test_the_published_fingers_are_found_by_name():
    scene = tl.Scene()
    scene.add_urdf(REPOSITORY / "examples/assets/fr3/fr3_franka_hand.urdf", name="arm")
    dynamics = tl.Dynamics(scene)
    poses = dynamics.forward_kinematics(np.zeros(9))
    left, right = (poses[dynamics.body_names.index(f"arm/fr3_{side}finger")] for side in ("left", "right"))
    np.testing.assert_allclose(left[:3], right[:3], atol=1e-12)  # closed fingers have one frame's origin
