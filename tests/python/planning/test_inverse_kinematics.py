"""Inverse kinematics: frames reach their targets within limits, and each result is the same alone or among others."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import mujoco
import numpy as np
import pytest
from test_dynamics import WALKER

import tightloop as tl
from conftest import URDF
from processes import started

POSITION, ROTATION = 1e-3, np.radians(0.1)
HOME = [0.0, -0.8, 0.0, -2.4, 0.0, 1.6, 0.8, 0.04, 0.04]
GYMNASIUM = ("ant", "half_cheetah", "hopper", "humanoid", "pusher", "reacher", "swimmer", "walker2d")

BODY = """<inertial><mass value="1"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial>"""
# A slide that another one mirrors, on a turn without end: a gripper that a rail carries
GRIPPER = """<robot name="gripper">
  <link name="base"/>
  <link name="cart">BODY</link>
  <link name="wrist">BODY</link>
  <link name="left">BODY</link>
  <link name="right">BODY</link>
  <joint name="rail" type="prismatic"><parent link="base"/><child link="cart"/><axis xyz="1 0 0"/>
    <limit lower="-2" upper="3" effort="1" velocity="1"/></joint>
  <joint name="turn" type="continuous"><parent link="cart"/><child link="wrist"/><axis xyz="0 0.6 0.8"/></joint>
  <joint name="grip" type="prismatic"><parent link="wrist"/><child link="left"/><origin xyz="0.1 0 0.2"/>
    <axis xyz="0 1 0"/><limit lower="0" upper="0.1" effort="1" velocity="1"/></joint>
  <joint name="mirror" type="prismatic"><parent link="wrist"/><child link="right"/><origin xyz="0.1 0 0.2"/>
    <axis xyz="0 1 0"/><limit lower="-0.06" upper="0" effort="1" velocity="1"/>
    <mimic joint="grip" multiplier="-0.7" offset="-0.01"/></joint>
</robot>
""".replace("BODY", BODY)


@pytest.fixture(scope="module")
def fr3() -> tl.Scene:
    scene = tl.Scene()
    scene.add_urdf(URDF, name="arm").joint_q = HOME
    return scene


def reachable(scene: tl.Scene, count: int, seed: int = 1) -> np.ndarray:
    """Random joint positions within limits, ``(count, coords)``."""
    robot = next(iter(scene.robots.values()))
    low, high = np.array(robot.joint_range).T
    q = np.random.default_rng(seed).uniform(low, high, (count, len(low)))
    q[:, -1] = q[:, -2]  # a finger mirrors the other
    return q


def angles(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angles between quaternions, by the chord of the nearer of ±b."""
    chord = np.minimum(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))
    return 4.0 * np.arcsin(np.clip(0.5 * chord, 0.0, 1.0))


def test_mujoco_finds_the_hand_of_the_fr3_at_its_targets(fr3):
    targets = mujoco_poses(fr3, reachable(fr3, 10_000), "fr3_hand_tcp")
    solver = tl.ik(fr3, tl.Reach("arm/fr3_hand_tcp"))
    solved = solver.solve(targets[:, :3], targets[:, 3:], tolerance=(POSITION, ROTATION), threads=2)
    assert solved.success.mean() >= 0.995
    assert solved.iterations.min() >= 1
    assert solved.restarts.max() > 0
    found = mujoco_poses(fr3, solved.joint_q, "fr3_hand_tcp")
    distance = np.linalg.norm(found[:, :3] - targets[:, :3], axis=1)
    turn = angles(found[:, 3:], targets[:, 3:])
    # the URDF is written to MuJoCo with 9 digits or more, over a metre
    assert distance[solved.success].max() <= POSITION + 1e-7
    assert turn[solved.success].max() <= ROTATION + 1e-6
    np.testing.assert_allclose(solved.position_error, distance, atol=1e-7)
    np.testing.assert_allclose(solved.rotation_error, turn, atol=1e-6)
    low, high = np.array(fr3.robots["arm"].joint_range).T
    assert (solved.joint_q >= low).all()
    assert (solved.joint_q <= high).all()


def mujoco_poses(scene: tl.Scene, joint_q: np.ndarray, link: str) -> np.ndarray:
    """Positions and quaternions (x, y, z, w) of a link of a fixed robot, by MuJoCo's `mj_kinematics`."""
    spec = mujoco.MjSpec.from_file(str(next(iter(scene.robots.values())).urdf))
    spec.compiler.fusestatic = False
    spec.compiler.discardvisual = True
    model = spec.compile()
    data, body = mujoco.MjData(model), model.body(link).id
    poses = np.zeros((len(joint_q), 7))
    for row, data.qpos[:] in enumerate(joint_q):
        mujoco.mj_kinematics(model, data)
        poses[row] = *data.xpos[body], *data.xquat[body][[1, 2, 3, 0]]
    return poses


@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_results_are_the_same_bits_for_any_number_and_thread(fr3, precision):
    link = tl.Dynamics(fr3).body_names.index("arm/fr3_hand_tcp")
    targets = tl.Dynamics(fr3).forward_kinematics(reachable(fr3, 300))[:, link]
    solver = tl.ik(fr3, tl.Reach("arm/fr3_hand_tcp"))
    many = solver.solve(targets[:, :3], targets[:, 3:], precision=precision, threads=2)
    one = solver.solve(targets[0, :3], targets[0, 3:], precision=precision)
    assert one.joint_q.tobytes() == many.joint_q[0].tobytes()
    few = solver.solve(targets[:7, :3], targets[:7, 3:], precision=precision, threads=1)
    for some, all_of_them in zip(few, many, strict=True):
        assert some.tobytes() == all_of_them[:7].tobytes()
    other = solver.solve(targets[:, :3], targets[:, 3:], precision=precision, seed=1)
    assert (other.joint_q != many.joint_q).any()


def test_double_precision_reaches_a_millionth_of_a_millimetre(fr3):
    targets = mujoco_poses(fr3, reachable(fr3, 50), "fr3_hand_tcp")
    solver = tl.ik(fr3, tl.Reach("arm/fr3_hand_tcp"))
    solved = solver.solve(targets[:, :3], targets[:, 3:], precision="f64", tolerance=(1e-9, 1e-9))
    assert solved.success.all()
    assert solved.position_error.max() <= 1e-9


def test_two_hands_a_floating_base_and_a_ball_are_moved_together(tmp_path: Path):
    (tmp_path / "walker.urdf").write_text(WALKER)
    walker = tl.Scene()
    walker.add_urdf(tmp_path / "walker.urdf", pos=(0.3, 0.2, 0.7), floating=True)
    dynamics = tl.Dynamics(walker)
    random = np.random.default_rng(0)
    q = random.normal(size=(200, 12))
    for first in (3, 7):
        q[:, first : first + 4] /= np.linalg.norm(q[:, first : first + 4], axis=1, keepdims=True)
    names = ["walker/trunk", "walker/foot"]
    places = [dynamics.body_names.index(name) for name in names]
    targets = dynamics.forward_kinematics(q)[:, places]
    solver = tl.ik(walker, [tl.Reach(name) for name in names])
    position = {name: targets[:, k, :3] for k, name in enumerate(names)}
    orientation = {name: targets[:, k, 3:] for k, name in enumerate(names)}
    solved = solver.solve(position, orientation)
    assert solved.success.all()
    found = dynamics.forward_kinematics(solved.joint_q)[:, places]
    assert np.linalg.norm(found[..., :3] - targets[..., :3], axis=-1).max() <= 1e-4
    assert angles(found[..., 3:], targets[..., 3:]).max() <= 1e-3
    # held, the base stays
    joint = tl.ik(walker, tl.Reach("walker/foot", orientation_weight=0), joints=["walker/hip", "walker/knee"])
    held = joint.solve([0.3, 0.3, 0.4])
    assert joint.start is not None
    np.testing.assert_array_equal(held.joint_q[:7], joint.start[:7])
    assert held.position_error < 1e-4 or not held.success


def test_a_mimic_joint_follows_within_both_limits(tmp_path: Path):
    (tmp_path / "gripper.urdf").write_text(GRIPPER)
    scene = tl.Scene()
    scene.add_urdf(tmp_path / "gripper.urdf", name="g")
    dynamics = tl.Dynamics(scene)
    grip = np.random.default_rng(0).uniform(0.0, 0.05 / 0.7, 100)
    turn = np.random.default_rng(1).uniform(-3, 3, 100)
    rail = np.random.default_rng(2).uniform(-2, 3, 100)
    q = np.stack([rail, turn, grip, -0.7 * grip - 0.01], axis=1)
    right = dynamics.body_names.index("g/right")
    targets = dynamics.forward_kinematics(q)[:, right]
    solved = tl.ik(scene, tl.Reach("g/right")).solve(targets[:, :3], targets[:, 3:])
    assert solved.success.all()
    np.testing.assert_allclose(solved.joint_q[:, 3], -0.7 * solved.joint_q[:, 2] - 0.01, atol=1e-15)
    found = dynamics.forward_kinematics(solved.joint_q)[:, right]
    assert np.linalg.norm(found[:, :3] - targets[:, :3], axis=1).max() <= 1e-4
    # far away, both stop at the limit that comes first: 0.05 / 0.7
    far = tl.ik(scene, tl.Reach("g/right", orientation_weight=0)).solve([0.1, -9.0, 0.2])
    assert not far.success
    assert far.joint_q[3] >= -0.06 - 1e-15
    assert 0.0 <= far.joint_q[2] <= 0.05 / 0.7 + 1e-15


def test_a_frame_reaches_a_pose_on_another_link(fr3):
    dynamics = tl.Dynamics(fr3)
    links = [dynamics.body_names.index(f"arm/{name}") for name in ("fr3_hand_tcp", "fr3_link3")]

    def relative(q: np.ndarray) -> np.ndarray:
        hand, link = dynamics.forward_kinematics(q)[links]
        back, position, quat = np.zeros(4), np.zeros(3), np.zeros(4)
        mujoco.mju_negQuat(back, link[[6, 3, 4, 5]])
        mujoco.mju_rotVecQuat(position, hand[:3] - link[:3], back)
        mujoco.mju_mulQuat(quat, back, hand[[6, 3, 4, 5]])
        return np.concatenate([position, quat[[1, 2, 3, 0]]])

    solver = tl.ik(fr3, tl.Reach("arm/fr3_hand_tcp", relative_to="arm/fr3_link3"))
    for q in reachable(fr3, 30):
        target = relative(q)
        solved = solver.solve(target[:3], target[3:])
        found = relative(solved.joint_q)
        np.testing.assert_allclose(np.linalg.norm(found[:3] - target[:3]), solved.position_error, atol=1e-12)
        np.testing.assert_allclose(angles(found[3:], target[3:]), solved.rotation_error, atol=1e-7)
        assert solved.success
        assert solver.start is not None
        # joints below the other link move neither against it
        np.testing.assert_array_equal(solved.joint_q[:3], solver.start[:3])


def test_a_tool_may_turn_about_its_axis_where_that_weight_is_0(fr3):
    solver = tl.ik(fr3, tl.Reach("arm/fr3_hand_tcp", orientation_weight=(1, 1, 0)))
    solved = solver.solve([[0.4, y, 0.4] for y in np.linspace(-0.3, 0.3, 20)], [1, 0, 0, 0])
    assert solved.success.all()
    poses = tl.Dynamics(fr3).forward_kinematics(solved.joint_q)[
        :, tl.Dynamics(fr3).body_names.index("arm/fr3_hand_tcp")
    ]
    x, y = poses[:, 3], poses[:, 4]
    # the tool's axis points down, whatever its turn: a quaternion in the plane of x and y
    np.testing.assert_allclose(np.hypot(x, y), 1.0, atol=1e-6)
    assert np.abs(y).max() > 0.01


def test_a_posture_is_kept_near_to_without_keeping_the_hand_away(fr3):
    link = tl.Dynamics(fr3).body_names.index("arm/fr3_hand_tcp")
    targets = tl.Dynamics(fr3).forward_kinematics(reachable(fr3, 500))[:, link]
    reach = tl.Reach("arm/fr3_hand_tcp", targets[:, :3], targets[:, 3:])
    free = tl.ik(fr3, reach).solve()
    posed = tl.ik(fr3, [reach, tl.Posture(HOME)]).solve()
    assert posed.success.mean() >= 0.995
    distance = [np.linalg.norm(result.joint_q - HOME, axis=1).mean() for result in (free, posed)]
    assert distance[1] < 0.95 * distance[0]


@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_a_daemon_solves_from_where_its_worlds_are(fr3, precision):
    targets = np.random.default_rng(0).uniform((0.3, -0.3, 0.2), (0.5, 0.3, 0.6), (20, 3))
    near = HOME + np.random.default_rng(1).uniform(-0.1, 0.1, (20, 9)) * (np.arange(9) < 7)
    with tl.launch(fr3, worlds=20, precision=precision, fields=("joint_q",), threads=2) as sim:
        before = sim.reset(joint_q=near).joint_q.copy()
        solver = sim.ik(tl.Reach("arm/fr3_hand_tcp"))
        solved = solver.solve(targets, (1, 0, 0, 0), precision=precision)
        assert solved.success.all()
        own = tl.ik(fr3, tl.Reach("arm/fr3_hand_tcp"))
        expected = own.solve(targets, (1, 0, 0, 0), joint_q=before, precision=precision)
        for ours, theirs in zip(solved, expected, strict=True):
            assert ours.tobytes() == theirs.tobytes()
        # no world has moved
        np.testing.assert_array_equal(sim.forward().joint_q, before)
        assert not sim.forward().step.any()
        # given a start, problems need not be as many as worlds
        assert solver.solve(targets[:3], (1, 0, 0, 0), joint_q=HOME).joint_q.shape == (3, 9)
        with pytest.raises(tl.ArgumentError, match="worlds has 20"):
            solver.solve(targets[:3], (1, 0, 0, 0))
        with pytest.raises(tl.CommandRefused, match="no link or site `arm/tool`; give one of arm/base"):
            sim.ik(tl.Reach("arm/tool")).solve(targets, (1, 0, 0, 0))
        assert sim.step().step.all()


@pytest.mark.parametrize("question", [b"", b"abc", b"\xff" * 40, b"\x02" + 7 * b"\0" + b"{}", b"\x00" * 64])
def test_a_daemon_refuses_what_is_no_question(fr3, tmp_path, question):
    file = tmp_path / "question"
    file.write_bytes(question)
    with tl.launch(fr3, worlds=1) as sim:
        with pytest.raises(tl.CommandRefused, match=r"no question.*; use sim\.ik"):
            sim._client.ik(str(file))
        with pytest.raises(tl.CommandRefused, match="cannot be opened"):
            sim._client.ik(str(tmp_path / "nowhere"))
        assert file.read_bytes() == question
        assert sim.step().step[0] == 1


@pytest.mark.parametrize("name", GYMNASIUM)
def test_mujoco_finds_bodies_of_its_models_at_their_targets(name):
    gymnasium = pytest.importorskip("gymnasium")
    path = Path(gymnasium.__file__).parent / f"envs/mujoco/assets/{name}.xml"
    model = mujoco.MjModel.from_xml_path(str(path))
    data, random = mujoco.MjData(model), np.random.default_rng(3)
    scene = tl.Scene.from_mujoco(path, name="m")
    body = max(range(1, model.nbody), key=lambda k: (len(dofs_of(model, k)), k))
    frame = f"m/{model.body(body).name}" if model.body(body).name else f"m/body{body}"
    solver = tl.ik(scene, tl.Reach(frame))
    targets, count = np.zeros((100, 7)), 100
    for row in range(count):
        data.qpos[:] = sample(model, random)
        mujoco.mj_kinematics(model, data)
        targets[row] = *data.xpos[body], *data.xquat[body][[1, 2, 3, 0]]
    solved = solver.solve(targets[:, :3], targets[:, 3:])
    assert solved.success.mean() >= 0.99
    for row in np.flatnonzero(solved.success):
        data.qpos[:] = solved.joint_q[row]
        for joint in free_joints(model):  # w comes first
            data.qpos[joint + 3 : joint + 7] = solved.joint_q[row, [joint + 6, joint + 3, joint + 4, joint + 5]]
        mujoco.mj_kinematics(model, data)
        assert np.linalg.norm(data.xpos[body] - targets[row, :3]) <= 1e-4 + 1e-9
        assert angles(data.xquat[body][[1, 2, 3, 0]], targets[row, 3:]) <= 1e-3 + 1e-7
        limited = model.jnt_limited.astype(bool)
        hinges = data.qpos[model.jnt_qposadr[limited]]
        low, high = model.jnt_range[limited].T
        assert ((hinges >= low) & (hinges <= high)).all()


def free_joints(model: mujoco.MjModel) -> list[int]:
    """Places of free joints in ``qpos``."""
    return model.jnt_qposadr[model.jnt_type == mujoco.mjtJoint.mjJNT_FREE].tolist()


def dofs_of(model: mujoco.MjModel, body: int) -> list[int]:
    """Dofs that move a body."""
    dofs: list[int] = []
    while body:
        first = model.body_dofadr[body]
        dofs += range(first, first + model.body_dofnum[body])
        body = model.body_parentid[body]
    return dofs


def sample(model: mujoco.MjModel, random: np.random.Generator) -> np.ndarray:
    """A random ``qpos`` within limits."""
    qpos = model.qpos0.copy()
    for joint in range(model.njnt):
        place = model.jnt_qposadr[joint]
        if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE:
            quat = random.normal(size=4)
            qpos[place : place + 3] += random.uniform(-1, 1, 3)
            qpos[place + 3 : place + 7] = quat / np.linalg.norm(quat)
        else:
            low, high = model.jnt_range[joint] if model.jnt_limited[joint] else (-1.0, 1.0)
            qpos[place] = random.uniform(low, high)
    return qpos


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda s: tl.ik(s, tl.Reach("arm/fr3_hand_tc")), "did you mean `arm/fr3_hand_tcp`"),
        (lambda s: tl.ik(s, tl.Reach("arm/base")), "no joint that may move moves `arm/base`"),
        (lambda s: tl.ik(s, tl.Reach("arm/fr3_hand"), joints=["arm/fr3_joint9"]), "arm/fr3_joint"),
        (lambda s: tl.ik(s, [tl.Reach("arm/fr3_hand")] * 2), "one per frame"),
        (lambda s: tl.ik(s, [tl.Reach("arm/fr3_hand"), tl.Posture(), tl.Posture()]), "give one"),
        (lambda s: tl.ik(s, [tl.Reach("arm/fr3_hand"), tl.Posture(weight=[1.0] * 3)]), r"\(9,\)"),
        (lambda s: tl.ik(s, tl.Reach("arm/fr3_hand")).solve([0, 0, 1]), "orientation_weight=0"),
        (lambda s: tl.ik(s, tl.Reach("arm/fr3_hand")).solve([0, 0, 1], [0, 0, 0, 2]), "length 2"),
        (lambda s: tl.ik(s, tl.Reach("arm/fr3_hand")).solve({"hand": [0, 0, 1]}, [0, 0, 0, 1]), "arm/fr3_hand"),
        (lambda s: tl.ik(s, tl.Reach("arm/fr3_hand")).solve(np.zeros((2, 3)), np.eye(4)[[3, 3, 3]]), "2 rows"),
        (lambda s: tl.Reach("a", position_weight=0, orientation_weight=0), "are 0"),
    ],
)
def test_mistakes_are_named_with_a_cure(fr3, call, said):
    with pytest.raises(tl.ArgumentError, match=said):
        call(fr3)


def test_inverse_kinematics_bounds_its_work_and_names_the_bound(pendulum):
    named = r"50 iterations .* 1000001 attempts; .*`iterations` and `restarts`.* 1000000"
    with pytest.raises(tl.ArgumentError, match=named):
        tl.ik(pendulum, tl.Reach("arm/lower", orientation_weight=0)).solve((9, 9, 9), restarts=10**6)
    with tl.launch(pendulum, worlds=2) as sim:
        with pytest.raises(tl.CommandRefused, match=named):
            sim.ik(tl.Reach("arm/lower", orientation_weight=0)).solve((9, 9, 9), restarts=10**6)
        sim.step()


SOLVING = """
solver = tl.ik(scene, tl.Reach("arm/fr3_hand_tcp"))
print("ready", flush=True)
solver.solve(np.full((300_000, 3), 9.0), (1, 0, 0, 0), iterations=1000, restarts=900)
"""
COMPILING = """
cube = ("[[body]]\\nname = 'cube%d'\\npos = [%d, 0, 1]\\nmass = 1.0\\n"
        "[[shape]]\\nname = 'box%d'\\ntype = 'box'\\nhalf_extents = [0.1, 0.1, 0.1]\\nbody = 'cube%d'\\n")
text = "dt = 0.002\\nsubsteps = 1\\n" + "".join(cube % (i, i, i, i) for i in range(340))
print("ready", flush=True)
tl._core.Ik(text, "/")
"""


@pytest.mark.parametrize("work", [SOLVING, COMPILING], ids=["solving", "compiling"])
def test_ctrl_c_ends_inverse_kinematics_in_this_process(work):
    code = f"""
import signal
import numpy as np
import tightloop as tl
signal.signal(signal.SIGINT, signal.default_int_handler)
scene = tl.Scene()
scene.add_urdf({str(URDF)!r}, name="arm")
try:
    exec({work!r})
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""
    with started([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        time.sleep(1.0)
        began = time.monotonic()
        process.send_signal(signal.SIGINT)
        assert process.stdout.readline() == "interrupted\n"
        assert time.monotonic() - began < 2.0
        process.wait(2.0)
