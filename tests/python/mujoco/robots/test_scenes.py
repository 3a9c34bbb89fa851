"""What surrounds the joints, each against MuJoCo: gravity, bases, fixed links, several robots, steps and frames."""

from __future__ import annotations

import numpy as np
import pytest
from comparison import MOTION, assert_close, assert_dynamics, assert_link_frames, assert_motion, running, scene_of
from random_trees import Features, random_urdf

TREES = pytest.mark.parametrize(("seed", "dofs"), [(10, 2), (11, 6), (12, 11)])
EVERYTHING = Features(limits=True, friction=True, damping=True, effort=True, mimics=2)

# Three fixed links with mass between two joints, one behind the other and side by side, and a massless one at the end
FIXED = """<robot name="fixed">
  <link name="floor"/>
  <joint name="stand" type="fixed"><parent link="floor"/><child link="base"/>
    <origin xyz="0.1 -0.2 0.3" rpy="0.4 -0.5 0.6"/></joint>
  <link name="base">{inertial}</link>
  <joint name="first" type="revolute"><parent link="base"/><child link="upper"/>
    <origin xyz="0 0.1 0.2" rpy="1 0.3 -2"/><axis xyz="0.6 0 -0.8"/><limit lower="-9" upper="9"/></joint>
  <link name="upper">{inertial}</link>
  <joint name="weld" type="fixed"><parent link="upper"/><child link="bracket"/>
    <origin xyz="0.3 0 0.1" rpy="-0.7 0.2 1.1"/></joint>
  <link name="bracket">{inertial}</link>
  <joint name="weld2" type="fixed"><parent link="bracket"/><child link="motor"/>
    <origin xyz="0 -0.2 0.1" rpy="0 1.5707963267948966 0"/></joint>
  <link name="motor">{inertial}</link>
  <joint name="weld3" type="fixed"><parent link="upper"/><child link="cover"/><origin xyz="-0.1 0 0"/></joint>
  <link name="cover">{inertial}</link>
  <joint name="second" type="prismatic"><parent link="motor"/><child link="lower"/>
    <origin xyz="0 0 0.4" rpy="0 0.5 0"/><axis xyz="1 2 2"/><limit lower="-9" upper="9"/></joint>
  <link name="lower">{inertial}</link>
  <joint name="tip" type="fixed"><parent link="lower"/><child link="tool"/><origin xyz="0 0 0.2" rpy="0 0 1"/></joint>
  <link name="tool"/>
</robot>
""".format(
    inertial='<inertial><origin xyz="0.02 -0.1 0.05" rpy="0.2 0.4 -0.3"/><mass value="1.5"/>'
    '<inertia ixx="0.03" iyy="0.04" izz="0.02" ixy="0.002" ixz="-0.001" iyz="0.003"/></inertial>'
)


@pytest.mark.parametrize("gravity", [(0, 0, 0), (3.0, -4.0, 5.0), (0, 0, -1.62), (100.0, 0, 0)])
@TREES
def test_any_gravity_is_mujocos(tmp_path, seed, dofs, gravity):
    with running(scene_of(tmp_path, random_urdf(seed, dofs), gravity=gravity), seed=seed) as case:
        assert_dynamics(case)
        assert_motion(case)


@TREES
def test_a_base_may_stand_anywhere_and_anyhow(tmp_path, seed, dofs):
    scene = scene_of(tmp_path, random_urdf(seed, dofs))
    robot, rng = scene.robots["r0"], np.random.default_rng(seed)
    turn = rng.normal(size=4)
    robot.pos, robot.quat = (100.0, -20.0, 3.0), tuple(turn / np.linalg.norm(turn))
    with running(scene, seed=seed) as case:
        assert_dynamics(case)
        assert_motion(case)


def test_fixed_links_move_with_what_carries_them(tmp_path):
    with running(scene_of(tmp_path, FIXED), worlds=8) as case:
        assert case.sim.body_names == [
            f"r0/{name}" for name in "floor base upper bracket motor lower tool cover".split()
        ]
        assert_dynamics(case)
        assert_motion(case)


@TREES
def test_several_robots_are_as_mujocos(tmp_path, seed, dofs):
    texts = [random_urdf(seed + robot, size, EVERYTHING) for robot, size in enumerate((dofs, 3, 1))]
    scene = scene_of(tmp_path, *texts)
    rng = np.random.default_rng(seed)
    for robot in scene.robots.values():
        turn = rng.normal(size=4)
        robot.pos, robot.quat = tuple(rng.normal(size=3)), tuple(turn / np.linalg.norm(turn))
        robot.joint_target_ke, robot.joint_target_kd = rng.uniform(0, 100), rng.uniform(0, 10)
        robot.joint_armature = 0.1
    with running(scene, seed=seed) as case:
        case.q *= 0.3
        case.commands.joint_f[:] = rng.uniform(-1, 1, case.commands.joint_f.shape)
        frame, _ = assert_dynamics(case)
        # one robot's dofs do not feel the other's
        blocks = list(case.sim.dofs.values())
        assert not frame.mass_matrix.reshape(-1, case.reference.dofs, case.reference.dofs)[
            :, blocks[0], blocks[1]
        ].any()
        assert_motion(case)


@pytest.mark.parametrize("substeps", [1, 3, 8])
@TREES
def test_commands_are_held_over_any_number_of_substeps(tmp_path, seed, dofs, substeps):
    scene = scene_of(tmp_path, random_urdf(seed, dofs, EVERYTHING), substeps=substeps)
    robot = scene.robots["r0"]
    robot.joint_target_ke, robot.joint_target_kd, robot.joint_armature = 100.0, 10.0, 0.1
    rng = np.random.default_rng(seed)
    with running(scene, seed=seed, frames=200 // substeps) as case:
        case.q *= 0.3
        shape = case.commands.joint_f.shape
        case.commands.joint_f[:] = rng.uniform(-5, 5, shape)
        case.commands.joint_target_q += rng.uniform(-0.2, 0.2, shape)
        assert_motion(case)


@pytest.mark.parametrize("rate", [60, 250, 2000, 10_000])
@TREES
def test_any_length_of_a_step_is_mujocos(tmp_path, seed, dofs, rate):
    # at 60 Hz the limits' time constants are shorter than two steps, and are lengthened to that (refsafe)
    scene = scene_of(tmp_path, random_urdf(seed, dofs, EVERYTHING), dt=1 / rate)
    scene.robots["r0"].joint_armature = 0.2
    with running(scene, seed=seed) as case:
        case.q *= 0.3
        case.qd *= 0.3
        assert_dynamics(case)
        assert_motion(case)


@TREES
def test_fields_of_a_frame_belong_to_its_state(tmp_path, seed, dofs):
    scene = scene_of(tmp_path, random_urdf(seed, dofs, EVERYTHING), substeps=3)
    scene.robots["r0"].joint_armature = 0.1
    with running(scene, seed=seed) as case:
        case.sim.write(joint_q=0.3 * case.q, joint_qd=case.qd)
        held = case.commands.at(0)
        for _ in range(20):
            frame = case.sim.step(**held)
        expected = case.reference.evaluate(frame.joint_q, frame.joint_qd, *held.values())
        assert_close("mass_matrix", frame.mass_matrix, expected.mass_matrix, 1e-8)
        assert_close("bias_force", frame.bias_force, expected.bias_force, 1e-8)
        assert_close("joint_qdd", frame.joint_qdd, expected.joint_qdd, 1e-8)
        assert_link_frames(frame.body_q, expected.body_q, 1e-12)


@TREES
def test_what_a_step_leaves_out_keeps_its_last_value(tmp_path, seed, dofs):
    scene = scene_of(tmp_path, random_urdf(seed, dofs))
    robot = scene.robots["r0"]
    robot.joint_target_ke, robot.joint_target_kd, robot.joint_target_mode = 100.0, 10.0, "both"
    with running(scene, seed=seed, frames=60) as case:
        sim, commands, rng = case.sim, case.commands, np.random.default_rng(seed)
        for values in vars(commands).values():
            values[:] = rng.uniform(-1, 1, values[:, :1].shape)
        sim.write(joint_q=case.q, joint_qd=case.qd)
        first = commands.at(0)
        sim.step(**first)
        for name, values in vars(commands).items():
            values[:, 20:] = rng.uniform(-1, 1, values[:, :1].shape) if name == "joint_f" else values[:, 20:]
            values[:, 40:] = rng.uniform(-1, 1, values[:, :1].shape) if name == "joint_target_q" else values[:, 40:]
        for number in range(1, 60):
            changed = {20: ("joint_f",), 40: ("joint_target_q",)}.get(number, ())
            frame = sim.step(**{name: commands.at(number)[name] for name in changed})
        theirs, _ = case.reference.trajectory(case.q, case.qd, commands, sim.substeps)
        assert np.abs(frame.joint_q - theirs[:, -1]).max() <= MOTION


def test_an_impossible_inertia_is_balanced_as_mujocos(tmp_path):
    # 0.02 + 0.03 < 0.06: no body has such moments
    text = FIXED.replace('ixx="0.03" iyy="0.04" izz="0.02"', 'ixx="0.03" iyy="0.06" izz="0.02"')
    scene = scene_of(tmp_path, text)
    assert any("principal moment" in note for note in scene.robots["r0"].notes)
    with running(scene, balance_inertia=True) as case:
        assert_dynamics(case)
        assert_motion(case)
