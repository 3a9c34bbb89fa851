"""What holds a joint beside its drive, each against MuJoCo: limits, dry friction, mimic, damping, armature."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from comparison import DOUBLE, assert_dynamics, assert_motion, running, scene_of
from random_trees import Features, random_urdf

# The first one's joint has a range
TREES = pytest.mark.parametrize(("seed", "dofs"), [(24, 1), (1, 3), (2, 5), (3, 8), (4, 12)])
# Light links behind stiff limits are unstable, in MuJoCo as in ours
ARMATURE = 0.1

MIMIC_CHAIN = """<robot name="chain">
  <link name="base"/>
  {links}
  <joint name="c" type="revolute"><parent link="base"/><child link="l2"/><origin xyz="0.1 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-9" upper="9"/><mimic joint="b" multiplier="-0.5" offset="0.3"/></joint>
  <joint name="b" type="prismatic"><parent link="l2"/><child link="l1"/><origin xyz="0 0.2 0" rpy="0.3 0 0"/>
    <axis xyz="0 0 1"/><limit lower="-9" upper="9"/><mimic joint="a" multiplier="0.2" offset="-0.1"/></joint>
  <joint name="a" type="continuous"><parent link="base"/><child link="l0"/><axis xyz="1 0 0"/></joint>
</robot>
""".format(
    links="\n  ".join(
        f'<link name="l{n}"><inertial><origin xyz="0.1 0.05 -0.2"/><mass value="{1 + n}"/>'
        '<inertia ixx="0.03" iyy="0.04" izz="0.02" ixy="0.001" ixz="0" iyz="-0.002"/></inertial></link>'
        for n in range(3)
    )
)


@TREES
def test_limits_push_back_as_mujocos(tmp_path, seed, dofs):
    scene = scene_of(tmp_path, random_urdf(seed, dofs, Features(limits=True)))
    scene.robots["r0"].joint_armature = ARMATURE
    with running(scene, seed=seed, worlds=8) as case:
        case.q *= 0.3
        frame, _ = assert_dynamics(case)
        hit = frame.efc_D != 0
        assert hit.shape[1], "some joint has a range"
        assert hit.any()
        assert not hit.all()
        assert_motion(case)


@TREES
def test_a_limit_is_soft_within_a_millimetre_as_mujocos(tmp_path, seed, dofs):
    # the impedance rises over that width, along two parabolas
    scene = scene_of(tmp_path, random_urdf(seed, dofs, Features(limits=True)))
    with running(scene, seed=seed, worlds=32) as case:
        lower, upper = case.reference.model.jnt_range.T
        depth = np.linspace(0, 1.2e-3, 32)[:, None]
        case.q[:] = np.where(
            case.reference.model.jnt_limited, np.where(case.qd > 0, upper + depth, lower - depth), case.q
        )
        frame, _ = assert_dynamics(case)
        assert (frame.efc_D[1:] != 0).all()
        assert len(np.unique(frame.efc_D[:, 0])) > 20


@TREES
def test_a_start_outside_its_limits_settles_as_mujocos(tmp_path, seed, dofs):
    scene = scene_of(tmp_path, random_urdf(seed, dofs, Features(limits=True, damping=True)), gravity=(0, 0, 0))
    robot = scene.robots["r0"]
    with running(scene, seed=seed) as case:
        limited, (lower, upper) = case.reference.model.jnt_limited.astype(bool), case.reference.model.jnt_range.T
    narrow = limited & (upper < 1)
    assert narrow.any()
    # a tenth of the range outside, above and below in turn
    outside = np.where(np.arange(dofs) % 2, upper, lower) * 1.1
    robot.joint_q = np.where(narrow, outside, 0.0)
    robot.joint_armature = ARMATURE
    with running(scene, worlds=2, frames=400) as case:
        assert np.array_equal(case.sim.reset().joint_q, np.broadcast_to(robot.joint_q, (2, dofs)))
        case.q[:], case.qd[:] = robot.joint_q, 0.0
        frame, _ = assert_dynamics(case)
        assert (frame.efc_D != 0).sum() == 2 * narrow.sum()
        q = assert_motion(case)
    inside = (lower <= q) & (q <= upper)
    assert inside[..., narrow].any(axis=1).all(), "all came back"


@TREES
def test_dry_friction_sticks_and_slides_as_mujocos(tmp_path, seed, dofs):
    scene = scene_of(tmp_path, random_urdf(seed, dofs, Features(friction=True)), gravity=(0, 0, -0.2))
    with running(scene, seed=seed, worlds=8) as case:
        # from rest to fast
        case.qd *= np.linspace(0, 1, 8)[:, None] ** 4
        _, expected = assert_dynamics(case)
        loss = case.reference.model.dof_frictionloss[case.reference.model.dof_frictionloss > 0]
        slides = np.array([np.isclose(np.abs(rows.force), loss, rtol=1e-9) for rows in expected.rows])
        assert slides.any(), "some slide"
        assert not slides.all(), "some stick"
        assert_motion(case)


@TREES
def test_mimics_follow_as_mujocos(tmp_path, seed, dofs):
    features = Features(mimics=max(1, dofs // 2))
    scene = scene_of(tmp_path, random_urdf(seed, max(dofs, 2), features))
    scene.robots["r0"].joint_armature = ARMATURE
    with running(scene, seed=seed) as case:
        assert case.reference.model.neq == features.mimics
        case.q *= 0.1
        assert_dynamics(case)
        assert_motion(case)


def test_a_mimic_chain_with_ratios_and_offsets_is_mujocos(tmp_path):
    scene = scene_of(tmp_path, MIMIC_CHAIN)
    with running(scene, frames=400) as case:
        assert case.sim.dof_names == ["r0/c", "r0/b", "r0/a"], "followers stand before their leader"
        case.q *= 0.1
        frame, _ = assert_dynamics(case)
        # both follow `a`: c = 0.3 - 0.5 (-0.1 + 0.2 a)
        assert np.allclose(frame.efc_J[0].reshape(-1, 3)[:2], [[1, 0, 0.1], [0, 1, -0.2]], atol=1e-15)
        c, b, a = assert_motion(case)[:, -1].T
        # after 0.8 s the springs have drawn them together; what is left carries the load
        assert np.allclose(b, -0.1 + 0.2 * a, atol=0.02)
        assert np.allclose(c, 0.3 - 0.5 * b, atol=0.05)


@TREES
def test_mimics_meet_limits_and_friction_as_mujocos(tmp_path, seed, dofs):
    text = random_urdf(seed, max(dofs, 2), Features(mimics=2, limits=True, friction=True, damping=True))
    scene = scene_of(tmp_path, text)
    scene.robots["r0"].joint_armature = ARMATURE
    with running(scene, seed=seed) as case:
        case.q *= 0.2
        assert_dynamics(case)
        assert_motion(case)


@TREES
def test_joint_damping_is_mujocos(tmp_path, seed, dofs):
    text = random_urdf(seed, dofs, Features(damping=True))
    # a long step, where damping in the step and damping at its start differ
    scene = scene_of(tmp_path, text.replace('damping="1.', 'damping="31.'), dt=1 / 100)
    with running(scene, seed=seed) as case:
        assert case.reference.model.dof_damping.any()
        assert_dynamics(case)
        assert_motion(case)


@TREES
def test_armature_is_mujocos(tmp_path, seed, dofs):
    scene = scene_of(tmp_path, random_urdf(seed, dofs))
    armature = np.random.default_rng(seed).uniform(0.01, 2.0, dofs)
    with running(scene, seed=seed) as case:
        bare = case.evaluate()[0].mass_matrix.copy()
    scene.robots["r0"].joint_armature = armature
    with running(scene, seed=seed) as case:
        frame, _ = assert_dynamics(case)
        added = (frame.mass_matrix - bare).reshape(-1, dofs, dofs)
        assert np.allclose(added, np.diag(armature), atol=1e-12)
        assert_motion(case)


def test_axes_of_any_length_and_the_default_axis_are_mujocos(tmp_path):
    text = random_urdf(5, 6)
    axes = re.findall(r"<axis [^>]*>", text)
    lengths = ["", '<axis xyz="0 0 -1e-3"/>', '<axis xyz="3 4 12"/>', '<axis xyz="1e-7 0 -1"/>', *axes[4:]]
    for old, new in zip(axes, lengths, strict=True):
        text = text.replace(old, new)
    with running(scene_of(tmp_path, text)) as case:
        assert_dynamics(case)


def test_turns_of_many_rounds_are_mujocos(tmp_path):
    with running(scene_of(tmp_path, random_urdf(3, 6)), worlds=16) as case:
        case.q *= np.geomspace(1, 1e4, 16)[:, None] ** ~case.reference.slides
        assert np.abs(case.q).max() > 1e4
        # the angle itself is rounded, to 1e4 × 1e-16
        assert_dynamics(case, replace(DOUBLE, pose=1e-10))
