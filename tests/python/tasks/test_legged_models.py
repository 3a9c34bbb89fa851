"""Robots of any make in the velocity tasks: what is found in a file, that it stands, and what is refused."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

import tightloop as tl
from tightloop.assets import CARTPOLE, FR3, HUMANOID, QUADRUPED
from tightloop.env import VectorEnv, policy_metadata
from tightloop.tasks.humanoid import HumanoidVelocityFlat
from tightloop.tasks.legged import LeggedModel
from tightloop.tasks.quadruped import ROBOT, QuadrupedVelocityFlat
from tightloop.tasks.quadruped_rough import QuadrupedVelocityRough

#: Without types.
mujoco: Any = import_module("mujoco")
ANT = Path(gymnasium.__file__).parent / "envs/mujoco/assets/ant.xml"
FEET = ("FL_foot", "FR_foot", "RL_foot", "RR_foot")


def spec() -> Any:
    """The quadruped as MuJoCo reads its URDF: fixed links are merged, and its base is fixed to the world."""
    text = QUADRUPED.read_text()
    head = text.index(">", text.index("<robot")) + 1
    keep = '<mujoco><compiler fusestatic="false" discardvisual="true"/></mujoco>'
    return mujoco.MjSpec.from_string(text[:head] + keep + text[head:])


def file_of(tmp_path: Path) -> Path:
    """The same as MJCF, in a scene with a floor, a ball, motors and a keyframe."""
    own = spec()
    own.compile()
    own.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0, 0, 1))
    own.worldbody.first_body().add_freejoint()
    ball = own.worldbody.add_body(name="ball", pos=(2, 0, 1))
    ball.add_freejoint()
    ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(0.1, 0, 0))
    for joint in ROBOT.joints:
        motor = own.add_actuator(name=f"{joint}_motor", trntype=mujoco.mjtTrn.mjTRN_JOINT, target=joint)
        motor.forcelimited, motor.forcerange = True, (-20.0, 20.0)
    pose = [0, 0, 0.3, 1, 0, 0, 0, *[0.0, 0.7, -1.4] * 4, 2, 0, 1, 1, 0, 0, 0]
    own.add_key(name="home", qpos=pose)
    path = tmp_path / "dog.xml"
    path.write_text(own.to_xml())
    return path


@pytest.fixture(params=["URDF", "MJCF", "MjSpec", "MjModel", "ant"])
def model(request: pytest.FixtureRequest, tmp_path: Path) -> Any:
    given = {
        "URDF": lambda: QUADRUPED,
        "MJCF": lambda: file_of(tmp_path),
        "MjSpec": spec,
        "MjModel": lambda: spec().compile(),
        "ant": lambda: str(ANT),
    }
    return given[request.param]()


@pytest.mark.parametrize("task", ["QuadrupedVelocityFlat", "QuadrupedVelocityRough"])
def test_a_quadruped_of_any_make_stands(task: str, model: Any, envs: Any) -> None:
    env = envs(task, 4, model=model, pushes=0.0, **({"level": 0, "kinds": ["flat"]} if "Rough" in task else {}))
    obs, _ = env.reset(seed=0)
    own = env.task
    for step in range(300):
        obs, reward, terminated, truncated, _ = env.step(np.zeros(env.action_space.shape))
        assert not (terminated | truncated).any(), f"{0.02 * step:.2f} s"
        assert np.isfinite(obs).all() and np.isfinite(reward).all()
        if step > 50:
            feet = own.foot_heights(np, env.evaluation.worlds)
            assert np.abs(feet).max() < 0.03 * own.robot.hip_height + 0.01
    np.testing.assert_allclose(own.base_height(np, env.evaluation.worlds), own.robot.height, rtol=0.1)
    size = len(own.robot.joints)
    assert np.abs(obs[:, 12 : 12 + size]).max() < 0.15, "it stands in its pose"


def test_its_own_robot_is_found_as_it_is_declared() -> None:
    robot = QuadrupedVelocityFlat(model=QUADRUPED).robot
    assert robot.joints == ROBOT.joints and robot.flip is not None and ROBOT.flip is not None
    assert [link for link, _ in robot.feet.values()] == [*FEET]
    np.testing.assert_allclose(robot.standing, ROBOT.standing, atol=0.1)
    np.testing.assert_allclose((robot.height, robot.radius, robot.mass), (0.32, 0.02, 14.68), atol=0.02)
    np.testing.assert_array_equal(robot.flip[0], ROBOT.flip[0])
    np.testing.assert_array_equal(robot.flip[1], ROBOT.flip[1])
    assert isinstance(robot.stiffness, dict) and isinstance(robot.damping, dict)
    np.testing.assert_allclose([*robot.stiffness.values()], 40.0, rtol=0.15)
    np.testing.assert_allclose([*robot.damping.values()], 1.0, rtol=0.15)


def test_the_humanoid_is_found_as_it_is_declared() -> None:
    declared, robot = HumanoidVelocityFlat().robot, HumanoidVelocityFlat(model=HUMANOID).robot
    assert robot.joints == declared.joints and robot.quiet == declared.quiet and robot.flip is not None
    assert [link for link, _ in robot.feet.values()] == ["left_foot", "right_foot"]
    np.testing.assert_allclose(robot.standing[:12], declared.standing[:12], atol=0.1)
    np.testing.assert_allclose((robot.height, robot.mass), (declared.height, declared.mass), atol=0.03)
    stiffness: Any = robot.stiffness
    for joint, own in {"left_hip_roll": 100.0, "right_knee": 150.0, "waist_yaw": 120.0, "left_elbow": 40.0}.items():
        np.testing.assert_allclose(stiffness[joint], own, rtol=0.15)


def test_a_model_of_mujoco_is_the_robot_alone(tmp_path: Path) -> None:
    """The floor, the ball, the motors and what the keyframe says of the ball are gone; its pose stays."""
    robot: Any = QuadrupedVelocityFlat(model=file_of(tmp_path)).robot
    assert robot.standing == pytest.approx((0.0, 0.7, -1.4) * 4)
    assert [robot.model.joint(place).name for place in range(1, robot.model.njnt)] == [*ROBOT.joints]
    assert robot.model.nu == 12
    np.testing.assert_allclose(robot.model.actuator_forcerange[:, 1], 20.0)
    # an MjModel of the same makes the same robot
    rebuilt: Any = QuadrupedVelocityFlat(model=spec().compile()).robot
    direct: Any = QuadrupedVelocityFlat(model=spec()).robot
    np.testing.assert_allclose(rebuilt.standing, direct.standing, atol=1e-6)
    np.testing.assert_allclose(rebuilt.model.body_inertia, direct.model.body_inertia, rtol=1e-9)


def test_what_follows_a_robot_in_its_file_is_no_matter(tmp_path: Path) -> None:
    file = tmp_path / "dog.urdf"
    for end in (b"</robot>\n\x00", b"</robot >", b"</robot\n>\n"):
        file.write_bytes(QUADRUPED.read_bytes().replace(b"</robot>", end))
        assert QuadrupedVelocityFlat(model=file).robot.mass == pytest.approx(14.68)


def test_ball_joints_are_no_joints_of_the_action() -> None:
    own = spec()
    for joint in own.joints:
        joint.type = mujoco.mjtJoint.mjJNT_BALL if joint.name.endswith("_hip") else joint.type
        joint.limited = False
    robot = QuadrupedVelocityFlat(model=own).robot
    assert len(robot.joints) == 8, "thighs and calves are legs of their own"


def test_options_replace_what_is_found() -> None:
    task = QuadrupedVelocityFlat(
        model=QUADRUPED,
        standing={".*_thigh": 0.6, ".*_calf": -1.2, "FL_thigh": 0.65},
        stiffness=55.0,
        damping={".*_calf": 2.0},
        scale={".*_hip": 0.1},
    )
    pose = dict(zip(task.robot.joints, task.robot.standing, strict=True))
    assert (pose["FL_thigh"], pose["FR_thigh"], pose["RR_calf"]) == (0.65, 0.6, -1.2)
    stiffness, damping, scale = (getattr(task.robot, name) for name in ("stiffness", "damping", "scale"))
    assert set(stiffness.values()) == {55.0} and scale[:3] == (0.1, 0.3, 0.3)
    assert damping["RL_calf"] == 2.0 and damping["RL_hip"] != 2.0
    assert task.robot.flip is None, "the left thigh is not the right one's mirror image"


def test_options_without_a_model_change_nothing_else_of_the_own_robot() -> None:
    assert QuadrupedVelocityRough().robot is ROBOT
    assert QuadrupedVelocityFlat(standing={}).robot == ROBOT
    assert QuadrupedVelocityFlat(scale=0.3).robot == replace(ROBOT, scale=(0.3,) * 12)
    assert QuadrupedVelocityFlat(stiffness=55.0).robot == replace(ROBOT, stiffness=dict.fromkeys(ROBOT.joints, 55.0))
    declared, task = HumanoidVelocityFlat(), HumanoidVelocityFlat(damping={".*_knee": 5.0})
    own: Any = task.robot.damping
    assert (own["left_knee"], own["left_elbow"], own["waist_yaw"]) == (5.0, 1.5, 4.0)
    assert replace(task.robot, damping=declared.robot.damping) == declared.robot
    assert (task.lowest, task.swing, task.pushes) == (declared.lowest, declared.swing, declared.pushes)
    # a lower pose is a lower base, with the feet as high as before; two links of 0.213 m
    low = QuadrupedVelocityFlat(standing={".*_thigh": 1.0, ".*_calf": -2.0}).robot
    assert low.standing == (0.0, 1.0, -2.0) * 4 and low.stiffness == 40.0 and low.flip == ROBOT.flip
    assert ROBOT.height - low.height == pytest.approx(0.426 * (np.cos(0.8) - np.cos(1.0)), abs=1e-5)


def test_metadata_of_a_robot_from_mjcf_have_its_pose_and_gains(tmp_path: Path, envs: Any) -> None:
    env = envs("QuadrupedVelocityFlat", 1, model=file_of(tmp_path), stiffness={".*_calf": 50.0})
    said, robot = policy_metadata(env), env.task.robot
    lists = {name: text.split(",") for name, text in said.items() if name.startswith(("joint_", "default"))}
    assert lists["joint_names"] == [*ROBOT.joints] == said["action_names"].split(",")
    numbers = {name: np.array(texts, float) for name, texts in lists.items() if name != "joint_names"}
    np.testing.assert_allclose(numbers["default_joint_pos"], robot.standing)
    np.testing.assert_allclose(numbers["joint_stiffness"], [*robot.stiffness.values()])
    np.testing.assert_allclose(numbers["joint_damping"], [*robot.damping.values()])
    assert (numbers["joint_effort_limit"] == 20.0).all() and (numbers["joint_armature"] > 0.0).all()
    assert numbers["joint_stiffness"][2] == 50.0
    assert json.loads(said["task_options"]) == {"model": str(tmp_path / "dog.xml"), "stiffness": {".*_calf": 50.0}}
    assert "task_options" not in policy_metadata(envs("QuadrupedVelocityFlat", 1))


@pytest.mark.parametrize("model", [None, str(ANT)])
def test_a_subclass_adds_fields_and_draws(model: Any, envs: Any) -> None:
    class Own(QuadrupedVelocityFlat):
        fields = (*QuadrupedVelocityFlat.fields, "body_q")
        initial_draws = 3

        def initial_state(self, xp: Any, worlds: Any, draws: Any) -> Any:
            assert worlds.body_q.shape[0] == len(draws) and draws.shape[1] == 3 + self.robot.start_draws
            return super().initial_state(xp, worlds, draws[:, 3:])

    env = envs(Own, 2, model=model)
    assert np.isfinite(env.reset(seed=0)[0]).all()
    # without a method of its own, the robot's draws come first
    Own.initial_state = QuadrupedVelocityFlat.initial_state  # pyright: ignore[reportAttributeAccessIssue]
    assert np.isfinite(env.reset(seed=1)[0]).all()


@pytest.mark.parametrize("standing", [{".*_thigh": 0.4}, {"FL_calf": -1.0}, {"F._thigh": 1.2}])
@pytest.mark.parametrize("kind", ["own", "URDF", "MJCF"])
def test_it_stands_with_some_joints_given(kind: str, standing: dict[str, float], tmp_path: Path, envs: Any) -> None:
    model = {"own": lambda: None, "URDF": lambda: QUADRUPED, "MJCF": lambda: file_of(tmp_path)}[kind]()
    env = envs("QuadrupedVelocityFlat", 4, model=model, pushes=0.0, standing=standing)
    env.reset(seed=0)
    robot = env.task.robot
    ((pattern, value),) = standing.items()
    assert all(q == value for j, q in zip(robot.joints, robot.standing, strict=True) if re.fullmatch(pattern, j))
    for _ in range(250):
        _, _, terminated, _, _ = env.step(np.zeros(env.action_space.shape))
        assert not terminated.any()
    assert np.abs(env.task.foot_heights(np, env.evaluation.worlds)).max() < 0.01
    np.testing.assert_allclose(env.frame.joint_q[:, 2], robot.height, rtol=0.1)


@pytest.mark.parametrize("model", [None, QUADRUPED])
def test_a_pose_that_cannot_be_held_is_refused(model: Any) -> None:
    with pytest.raises(tl.ArgumentError, match=r"standing of 'FL_calf' is 5; give -2\.7 to -0\.9, its limits"):
        QuadrupedVelocityFlat(model=model, standing={".*_calf": 5.0})
    crooked = {"F._thigh": 1.3, "F._calf": -2.6, "R._thigh": 0.6, "R._calf": -1.2}
    with pytest.raises(tl.ArgumentError, match=r"FL_foot 0\.1\d\d m, .*RR_foot 0\.000 m; give FL_hip, .* too"):
        QuadrupedVelocityFlat(model=model, standing=crooked)


@pytest.mark.parametrize("option", ["scale", "stiffness", "damping"])
@pytest.mark.parametrize("model", [None, QUADRUPED])
def test_one_sided_options_leave_no_mirror_image(option: str, model: Any) -> None:
    given: dict[str, Any] = {option: {"FL_.*": 10.0}}
    assert QuadrupedVelocityFlat(model=model, **given).robot.flip is None
    given = {option: {".*_calf": 10.0}}
    assert QuadrupedVelocityFlat(model=model, **given).robot.flip is not None


@pytest.mark.parametrize(
    ("task", "options", "said"),
    [
        (QuadrupedVelocityFlat, {"model": FR3}, r"fr3_franka_hand\.urdf has .*give a quadruped"),
        (QuadrupedVelocityFlat, {"model": CARTPOLE}, r"cartpole\.urdf:4: .*add <inertial>"),
        (QuadrupedVelocityFlat, {"model": HUMANOID}, r"2 chains .*give a quadruped.*HumanoidVelocityFlat"),
        (HumanoidVelocityFlat, {"model": QUADRUPED}, r"4 chains .*give a humanoid.*QuadrupedVelocityFlat"),
        (QuadrupedVelocityFlat, {"model": "no/dog.urdf"}, r"dog\.urdf does not exist; give the path"),
        (QuadrupedVelocityFlat, {"model": QUADRUPED.parent}, r"is a folder; give the path"),
        (QuadrupedVelocityFlat, {"model": Path(__file__)}, r"test_legged_models\.py is neither.*give the path"),
        (QuadrupedVelocityFlat, {"model": ""}, r"model is empty; give the path"),
        (QuadrupedVelocityFlat, {"pushes": np.nan}, r"pushes is nan; give a finite number"),
        (HumanoidVelocityFlat, {"pushes": -1}, r"pushes is -1; it must be at least 0"),
        (QuadrupedVelocityFlat, {"pushes": "x"}, r"pushes is 'x'; give a number"),
        (QuadrupedVelocityFlat, {"model": 3}, r"model is int; give the path"),
        (QuadrupedVelocityFlat, {"standing": {"FL_knee": 1.0}}, r"standing has 'FL_knee', which no joint matches"),
        (QuadrupedVelocityFlat, {"standing": 1.0}, r"standing is 1\.0; give a dict"),
        (QuadrupedVelocityFlat, {"stiffness": -1.0}, r"stiffness is -1; it must be at least 0"),
        (HumanoidVelocityFlat, {"damping": {"left_knee": "soft"}}, r"damping of 'left_knee' is 'soft'; give a number"),
    ],
)
def test_what_no_robot_of_the_task_is_is_refused(task: Any, options: dict[str, Any], said: str) -> None:
    with pytest.raises((tl.ArgumentError, tl.SceneError), match=said):
        task(**options)


def test_an_environment_takes_a_model_by_name(envs: Any) -> None:
    assert envs("QuadrupedVelocityFlat", 2, model=str(ANT)).single_action_space.shape == (8,)
    with pytest.raises(tl.SignatureError, match="model"):
        VectorEnv("QuadrupedVelocityFlat", 2, modell=str(ANT))


@pytest.mark.parametrize("kind", ["MJCF", "ant"])
def test_mujoco_moves_a_robot_from_mjcf_on_its_plane_as_tightloop_does(kind: str, tmp_path: Path) -> None:
    task = QuadrupedVelocityFlat(model=file_of(tmp_path) if kind == "MJCF" else ANT)
    assert isinstance(task.robot, LeggedModel)
    theirs = task.robot.on_ground()
    data, rng = mujoco.MjData(theirs), np.random.default_rng(0)
    touched = 0
    with tl.launch(task.scene(), worlds=1, precision="f64", fields=task.fields) as sim:
        start = task.robot.start_q
        frame = sim.write(joint_q=start, joint_qd=np.zeros(theirs.nv))
        data.qpos[:] = start[[0, 1, 2, 6, 3, 4, 5, *range(7, len(start))]]
        for _ in range(40):
            controls = task.robot.standing + rng.uniform(-0.3, 0.3, theirs.nu)
            frame, data.ctrl[:] = sim.step(ctrl=controls), controls
            mujoco.mj_step(theirs, data, 4)
            touched = max(touched, data.ncon)
            np.testing.assert_allclose(frame.joint_q[0, 7:], data.qpos[7:], atol=1e-9)
            np.testing.assert_allclose(frame.joint_q[0, :3], data.qpos[:3], atol=1e-9)
    assert touched >= 3


@pytest.mark.parametrize(("calf", "is_kept"), [(-1.4, True), (-0.3, False)])
def test_a_keyframe_beyond_the_limits_of_joints_is_no_pose_to_stand_in(
    calf: float, is_kept: bool, tmp_path: Path
) -> None:
    file = file_of(tmp_path)
    text = file.read_text()
    assert text.count("0.7 -1.4") == 4
    file.write_text(text.replace("0.7 -1.4", f"0.2 {calf}"))  # calves turn from -2.7 to -0.9 rad
    robot = QuadrupedVelocityFlat(model=file).robot
    assert (robot.standing[2] == pytest.approx(calf)) is is_kept
    assert all(-2.7 <= angle <= -0.9 for angle in robot.standing[2::3])
