"""Drives and torques, each against MuJoCo: targets, gains, effort limits, and what stands beside them."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from comparison import Case, assert_dynamics, assert_motion, running, scene_of
from random_trees import Features, random_urdf

import tightloop as tl

TREES = pytest.mark.parametrize(("seed", "dofs"), [(0, 1), (1, 3), (2, 5), (3, 8), (4, 12)])
KE, KD = 200.0, 10.0


def driven(folder, seed: int, dofs: int, features: Features = Features(), **options: object) -> tl.Scene:  # noqa: B008
    """A tree with drives on all joints."""
    scene = scene_of(folder, random_urdf(seed, dofs, features), **options)
    robot = scene.robots["r0"]
    robot.joint_target_ke, robot.joint_target_kd, robot.joint_armature = KE, KD, 0.1
    return scene


def move_targets(case: Case, seed: int) -> None:
    """Targets of both kinds that differ from frame to frame, near the start."""
    rng = np.random.default_rng(seed)
    shape = case.commands.joint_f.shape
    case.commands.joint_target_q += rng.uniform(-0.3, 0.3, shape)
    case.commands.joint_target_qd[:] = rng.uniform(-2, 2, shape)


@pytest.mark.parametrize("mode", ["position", "velocity", "both"])
@TREES
def test_targets_pull_as_mujocos(tmp_path, seed, dofs, mode):
    scene = driven(tmp_path, seed, dofs)
    scene.robots["r0"].joint_target_mode = mode
    with running(scene, seed=seed) as case:
        move_targets(case, seed)
        frame, _ = assert_dynamics(case)
        moved = {}
        for name in ("joint_target_q", "joint_target_qd"):
            held = case.commands.at(0)
            case.sim.step(**(held | {name: held[name] + 1.0}))
            moved[name] = not np.array_equal(
                case.sim.write(joint_q=case.q, joint_qd=case.qd).joint_qdd, frame.joint_qdd
            )
        assert moved == {"joint_target_q": mode != "velocity", "joint_target_qd": mode != "position"}
        assert_motion(case)


@TREES
def test_modes_and_gains_may_differ_by_dof(tmp_path, seed, dofs):
    scene = driven(tmp_path, seed, dofs)
    rng, robot = np.random.default_rng(seed), scene.robots["r0"]
    robot.joint_target_mode = [("both", "position", "velocity")[dof % 3] for dof in range(dofs)]
    robot.joint_target_ke = rng.uniform(0, 500, dofs) * (rng.random(dofs) < 0.8)
    robot.joint_target_kd = rng.uniform(0, 50, dofs) * (rng.random(dofs) < 0.8)
    with running(scene, seed=seed) as case:
        move_targets(case, seed)
        assert_dynamics(case)
        assert_motion(case)


@pytest.mark.parametrize("mode", ["position", "velocity", "both"])
@TREES
def test_effort_limit_clamps_the_sum_of_the_drive_as_mujocos(tmp_path, seed, dofs, mode):
    scene = driven(tmp_path, seed, dofs, Features(effort=True))
    robot = scene.robots["r0"]
    robot.joint_target_mode = mode
    if not np.isfinite(robot.joint_effort_limit).any():
        robot.joint_effort_limit = 10.0
    limit = robot.joint_effort_limit
    with running(scene, seed=seed, worlds=8) as case:
        move_targets(case, seed)
        # the first world is so near that nothing clamps
        case.commands.joint_target_q[0], case.commands.joint_target_qd[0] = 1e-3, 1e-3
        _, expected = assert_dynamics(case)
        clamped = np.abs(expected.drive) == limit
        assert clamped.any(), "some drives are clamped"
        assert not clamped[0].any(), "some are not"
        assert_motion(case)


@TREES
def test_an_effort_limit_of_zero_leaves_only_the_damping_of_the_step(tmp_path, seed, dofs):
    scene = driven(tmp_path, seed, dofs)
    scene.robots["r0"].joint_effort_limit = 0.0
    with running(scene, seed=seed) as case:
        move_targets(case, seed)
        _, expected = assert_dynamics(case)
        assert not expected.drive.any()
        assert_motion(case)


@TREES
def test_joint_f_is_not_clamped(tmp_path, seed, dofs):
    scene = driven(tmp_path, seed, dofs)
    scene.robots["r0"].joint_effort_limit = 0.5
    with running(scene, seed=seed) as case:
        case.commands.joint_f[:] = np.random.default_rng(seed).uniform(-50, 50, case.commands.joint_f.shape)
        assert_dynamics(case)
        assert_motion(case)


@TREES
def test_a_torque_adds_to_gravity_and_nothing_else(tmp_path, seed, dofs):
    scene = scene_of(tmp_path, random_urdf(seed, dofs))
    with running(scene, seed=seed) as case:
        held = case.evaluate()[0].bias_force.copy()
        case.commands.joint_f[:] = held[:, None]
        frame, _ = assert_dynamics(case)
        # what holds the joints at zero acceleration is what the bias says
        assert np.abs(frame.joint_qdd).max() < 1e-9


@TREES
def test_joint_damping_stays_beside_kd(tmp_path, seed, dofs):
    text = random_urdf(seed, dofs, Features(damping=True, effort=True))
    scene = scene_of(tmp_path, text.replace('damping="0.0"', 'damping="3.0"'))
    robot = scene.robots["r0"]
    robot.joint_target_ke, robot.joint_target_kd, robot.joint_armature = KE, KD, 0.1
    with running(scene, seed=seed) as case:
        assert (case.reference.model.dof_damping > 0).all()
        move_targets(case, seed)
        assert_dynamics(case)
        assert_motion(case)


@TREES
def test_a_clamped_drive_keeps_the_derivative_of_kd(tmp_path, seed, dofs):
    scene = driven(tmp_path, seed, dofs, dt=1 / 100)
    robot = scene.robots["r0"]
    # h kd = 1 is as much as the inertia, and a tenth of a newton is all that the drive may give
    robot.joint_target_kd, robot.joint_effort_limit = 100.0, 0.1
    with running(scene, seed=seed, frames=50) as case:
        case.commands.joint_target_q += 1.0
        _, expected = assert_dynamics(case)
        assert (np.abs(expected.drive) == 0.1).mean() > 0.9
        ours = assert_motion(case)
        # MuJoCo drops the derivative when the actuators' own range clamps
        model = case.reference.model
        model.actuator_forcelimited[:] = True
        model.actuator_forcerange[:] = [-0.05, 0.05]
        dropped, _ = case.reference.trajectory(case.q, case.qd, case.commands, case.sim.substeps)
        assert np.abs(dropped - ours).max() > 1e-3
        assert model.opt.integrator == mujoco.mjtIntegrator.mjINT_IMPLICITFAST


@TREES
def test_stiff_drives_are_mujocos(tmp_path, seed, dofs):
    scene = driven(tmp_path, seed, dofs, Features(damping=True), dt=1 / 120)
    scene.robots["r0"].joint_target_ke, scene.robots["r0"].joint_target_kd = 1e5, 1e4
    with running(scene, seed=seed) as case:
        move_targets(case, seed)
        assert_dynamics(case)
        assert_motion(case)


@TREES
def test_drives_fight_limits_friction_and_mimics_as_mujocos(tmp_path, seed, dofs):
    features = Features(limits=True, friction=True, effort=True, mimics=dofs // 3)
    scene = driven(tmp_path, seed, dofs, features)
    with running(scene, seed=seed) as case:
        case.q *= 0.2
        case.commands.joint_target_q[:] = case.q[:, None]
        move_targets(case, seed)
        assert_dynamics(case)
        assert_motion(case)
