"""What is valid while a simulation runs and most likely a mistake: reported once, with the cure, at the user's line."""

from __future__ import annotations

import copy
import subprocess
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

import tightloop as tl
from tightloop.env import VectorEnv
from tightloop.tasks.cartpole import CartPoleBalance

#: A joint with limits in the world, and a body that moves freely.
ARM = """<robot name="arm">
  <link name="base"><inertial><mass value="1"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <link name="upper"><inertial><mass value="1"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <link name="wheel"><inertial><mass value="1"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <joint name="turn" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-2.5" upper="2.5" effort="10" velocity="1"/></joint>
  <joint name="roll" type="continuous"><parent link="upper"/><child link="wheel"/><axis xyz="0 1 0"/></joint>
</robot>
"""


@pytest.fixture
def scene(tmp_path) -> tl.Scene:
    path = tmp_path / "arm.urdf"
    path.write_text(ARM)
    scene = tl.Scene()
    arm = scene.add_urdf(path)
    arm.joint_target_ke, arm.joint_target_kd = 10.0, 1.0
    scene.add_cube(pos=(3, 0, 0.5))
    return scene


@contextmanager
def told_once(pattern: str, file: str = __file__) -> Iterator[None]:
    """Expect one warning, at a line of this file."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield
    messages = [str(warning.message) for warning in caught]
    assert len(messages) == 1, messages
    with pytest.warns(tl.TightloopWarning, match=pattern):
        warnings.warn(messages[0], caught[0].category, stacklevel=1)
    assert caught[0].filename == file


@contextmanager
def nothing_told() -> Iterator[None]:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def test_worlds_that_fault_are_reported_once_with_number_first_reason_and_cure():
    scene = tl.Scene(gravity=(0, 0, 0))
    scene.add_cube()
    push = np.zeros((4, 6))
    with tl.launch(scene, worlds=4) as sim:
        with nothing_told():
            sim.step(joint_f=push)
        push[[1, 3], 3:] = 300.0
        with told_once(
            r"2 worlds of 4 faulted: the first of them is world 1, after its step 1, .*joint_qd\| of 100000"
        ):
            sim.step(joint_f=push)
        push[:, 3:] = 300.0
        with nothing_told():
            sim.reset()
            sim.step(joint_f=push)


def test_a_world_with_a_command_that_is_nan():
    scene = tl.Scene()
    scene.add_cube(pos=(0, 0, 1))
    push = np.zeros((2, 6))
    push[1, 0] = np.nan
    with tl.launch(scene, worlds=2, on_nan="freeze", fields=("joint_q",)) as sim:
        sim.send(joint_f=push)
        with told_once(
            r"1 world of 2 faulted: it is world 1, after its step 0, since its joint_f of `cube/free\.vx` is NaN.*reset"
        ):
            sim.recv()


def test_the_speed_before_a_fault_is_named():
    scene = tl.Scene(gravity=(0, 0, 0))
    scene.add_cube(name="top")
    with tl.launch(scene, worlds=1, bounds={"joint_qd": 60.0}) as sim:
        sim.write(joint_qd=[0, 0, 0, 0, 0, 50.0])
        with told_once(r"`top/free\.wz` was fastest, at 58"):
            for _ in range(3):
                sim.step(joint_f=[0, 0, 0, 0, 0, 0.01])


def test_a_fault_as_an_error_leaves_the_simulation_usable():
    scene = tl.Scene(gravity=(0, 0, 0))
    scene.add_cube()
    with tl.launch(scene, worlds=1) as sim, nothing_told():
        with pytest.raises(tl.TightloopWarning, match="1 world of 1 faulted"):
            sim.step(joint_f=[0, 0, 0, 300, 300, 300])
        assert sim.reset().status[0] == 0
        assert sim.step(joint_f=np.zeros(6)).step[0] == 1


def test_faults_of_an_environment_are_reported_at_the_line_that_steps_it():
    envs = VectorEnv(CartPoleBalance, 2)
    try:
        envs.reset(seed=1)
        actions = np.zeros((2, 1))
        actions[1] = np.nan
        with told_once("1 world of 2 faulted: it is world 1"):
            envs.step(actions)
    finally:
        envs.close()


@pytest.mark.parametrize("send", [False, True])
@pytest.mark.parametrize("by", ["array", "list", "robot"])
def test_targets_in_degrees(scene, by, send):
    targets = {"array": np.zeros((3, 8)), "list": [0.0] * 8, "robot": {"arm": np.zeros((3, 2), np.float32)}}[by]
    with tl.launch(scene, worlds=3) as sim:
        with nothing_told():
            sim.step(joint_target_q=targets)
        if by == "list":
            targets[0] = 90
        elif by == "robot":
            targets["arm"][1, 0] = 90
        else:
            targets[1, 0] = 90
        world = 0 if by == "list" else 1
        with told_once(
            rf"joint_target_q of `arm/turn` is 90 rad in world {world}, .* -2\.5000 to 2\.5000: .*np\.radians"
        ):
            if send:
                sim.send(joint_target_q=targets)
                sim.recv()
            else:
                sim.step(joint_target_q=targets)
        with nothing_told():
            sim.step(joint_target_q=targets)


def test_targets_beyond_limits_and_turns_of_wheels_are_no_degrees(scene):
    with tl.launch(scene, worlds=2) as sim, nothing_told():
        sim.step(joint_target_q={"arm": [4.0, 90.0]})
        sim.write(joint_q={"arm": [2.5, 400.0]})
        with pytest.raises(tl.CommandRefused, match="inf"):
            sim.step(joint_target_q={"arm": [np.inf, 0.0]})


def test_positions_in_degrees(scene):
    with tl.launch(scene, worlds=2) as sim:
        with nothing_told():
            sim.write(joint_q={"arm": [[132.0, 0.0], [0.0, 0.0]]}, mask=[False, True])
        with told_once(r"joint_q of `arm/turn` is -132 rad in world 1, .*np\.radians"):
            sim.write(joint_q={"arm": [[0.0, 0.0], [-132.0, 0.0]]})


def test_noise_in_degrees(scene):
    with tl.launch(scene, worlds=1, params=("joint_q_noise",)) as sim:
        with nothing_told():
            sim.params.joint_q_noise = [0.1, 0.1, *[0.0] * 6]
        with told_once(r"params\.joint_q_noise of `arm/turn` is 5, which looks like degrees"):
            sim.params.joint_q_noise = [5.0, 0.1, *[0.0] * 6]


def test_a_quaternion_with_w_first(scene):
    with tl.launch(scene, worlds=2) as sim:
        with nothing_told():
            sim.write(joint_q={"cube": [0, 0, 1, -1, 0, 0, 0]})
            sim.write(joint_q={"cube": [0, 0, 1, 0, 0, 0, 1]})
        with told_once(
            r"joint_q of `cube.*` turns by 180°.*\(1, 0, 0, 0\).*\(x, y, z, w\).*\(0, 0, 0, 1\) for no turn"
        ):
            sim.write(joint_q=np.array([[0, 0, 0, 0, 1, 0, 0, 0, 1], [0, 0, 0, 0, 1, 1, 0, 0, 0]], float))


def test_a_quaternion_of_a_mocap_body_with_w_last():
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string("""<mujoco>
      <worldbody><body name="hand" mocap="true"><geom size=".1"/></body></worldbody>
      <keyframe><key name="over" mquat="0 0 0 1"/></keyframe></mujoco>""")
    with tl.launch(tl.Scene.from_mujoco(model, name="m"), worlds=2) as sim:
        with nothing_told():
            sim.step(mocap_quat=[[1, 0, 0, 0]])
            sim.reset(keyframe="over")
        with told_once(
            r"mocap_quat of `m/hand` .*\(0, 0, 0, 1\).*\(w, x, y, z\), as in MuJoCo.*\(1, 0, 0, 0\) for no turn"
        ):
            sim.step(mocap_quat=[[0, 0, 0, 1]])


def test_a_mocap_body_that_turns_in_either_order_before_it_makes_half_a_turn():
    mujoco = pytest.importorskip("mujoco")
    text = '<mujoco><worldbody><body name="hand" mocap="true" quat="{}"><geom size=".1"/></body></worldbody></mujoco>'
    turning = mujoco.MjModel.from_xml_string(text.format("1 0 0 0"))
    for before in ([0.6, 0, 0, 0.8], [0, 0, 0, -1]):
        with tl.launch(tl.Scene.from_mujoco(turning), worlds=2) as sim, nothing_told():
            sim.step(mocap_quat=[before])
            sim.step(mocap_quat=[[0, 0, 0, 1]])
    turned = mujoco.MjModel.from_xml_string(text.format("0 0 0 1"))
    with tl.launch(tl.Scene.from_mujoco(turned), worlds=2) as sim, nothing_told():
        sim.step(mocap_quat=[[0, 0, 0, 1]])


def test_gravity_that_is_one_number(scene):
    with tl.launch(scene, worlds=2, params=("gravity",)) as sim:
        with nothing_told():
            sim.params.gravity = (0, 0, -5)
            sim.params.gravity = 0
        with told_once(r"params\.gravity is \((-9\.81\d*(, )?){3}\) in world 0.*\(0, 0, -9\.81\)"):
            sim.params.gravity = -9.81


def test_torques_against_drives_that_hold(scene):
    with tl.launch(scene, worlds=2) as sim:
        with nothing_told():
            sim.step(joint_f={"cube": [0.1] * 6})
        with told_once(r"joint_f acts on `arm/turn` beside its drive.*joint_target_ke and joint_target_kd.*to 0"):
            sim.step(joint_f={"arm": [1.0, 0.0]})


@pytest.mark.parametrize("aims", ["together", "before", "scene", "gains vary", "no gains"])
def test_torques_that_are_meant_to_be_added(scene, aims):
    arm = scene.robots["arm"]
    if aims == "no gains":
        arm.joint_target_ke = 0.0
    if aims == "scene":
        arm.joint_target_q = 0.3
    with tl.launch(scene, worlds=2, params=("joint_target_ke",) if aims == "gains vary" else ()) as sim, nothing_told():
        if aims == "before":
            sim.step(joint_target_q={"arm": [0.1, 0.1]})
        given: dict[str, Any] = {"joint_target_q": {"arm": [0.1, 0.1]}} if aims == "together" else {}
        sim.step(joint_f={"arm": [1.0, 0.0]}, **given)


def test_positions_far_outside_of_limits(scene):
    with tl.launch(scene, worlds=2) as sim:
        with nothing_told():
            sim.write(joint_q={"arm": [[2.6, 0.0], [0.0, 0.0]]})
        with told_once(
            r"joint_q of `arm/turn` is 3\.0000 rad in world 1, far outside of its limits, -2\.5000 to 2\.5000"
        ):
            sim.write(joint_q={"arm/turn": [0.0, 3.0]})


def test_parameters_are_looked_at_as_the_scene_is(scene):
    scene.add_ground()
    names = ("gravity", "joint_effort_limit", "body_mass", "body_inertia", "shape_mu")
    with tl.launch(scene, worlds=2, params=names) as sim:
        with nothing_told():
            sim.params.gravity = [[0, 0, -9.0], [0, 0, -10.0]]
            sim.params.joint_effort_limit = 5.0
            sim.params.body_mass = sim.params.body_mass * 1.1
            sim.params.body_inertia = sim.params.body_inertia * 1.1
            sim.params.shape_mu[:, 0] = 0.3
            sim.params.shape_mu = 0.3
        cube = sim.body_names.index("cube/cube") if "cube/cube" in sim.body_names else len(sim.body_names) - 1
        with told_once(r"params\.gravity is \(0, 1, 9\.81\) in world 1, which points up, .*give \(0, 0, -9\.81\)"):
            sim.params.gravity = [[0, 0, -9.0], [0, 1, 9.81]]
        with told_once(
            r"joint_effort_limit is 0 for all drives, such as `arm/turn`.*1e30 for none.*joint_target_kd to 0"
        ):
            sim.params.joint_effort_limit = 0.0
        with told_once(r"body_mass of `cube.*` is 0 in world 1: .*Give a mass above 0"):
            sim.params.body_mass[1, cube] = 0.0
        with told_once(r"body_inertia of `cube.*` has the principal moments \(1, 1, 5\) in world 0.*no body has"):
            sim.params.body_inertia[0, cube] = [1, 1, 5, 0, 0, 0]
        with told_once(r"shape_mu of `ground` is 0\.1 in world 0 and has no effect: .* larger coefficient counts"):
            sim.params.shape_mu = [0.1, *[0.9] * (len(sim.shape_names) - 1)]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            lambda scene, arm: setattr(arm, "joint_target_ke", 5.0),
            r"robot `arm`: `joint_target_ke`.*sim\.params\.joint_target_ke",
        ),
        (lambda scene, arm: arm.joint_q.__setitem__(0, 0.5), r"`joint_q`.*call sim\.write\(joint_q=\{\"arm\": …\}\)"),
        (lambda scene, arm: setattr(arm, "joint_target_q", 0.5), r"sim\.step\(joint_target_q=\{\"arm\": …\}\)"),
        (
            lambda scene, arm: setattr(arm, "joint_target_mode", "both"),
            r"`joint_target_mode`.*set it before the launch",
        ),
        (lambda scene, arm: setattr(scene, "gravity", (0, 0, -9)), r"Scene: `gravity`.*write sim\.params\.gravity"),
        (lambda scene, arm: setattr(scene.bodies["cube"], "mass", 2.0), r"body `cube`: `mass`.*sim\.params\.body_mass"),
        (lambda scene, arm: setattr(scene.bodies["cube"], "pos", (0, 0, 2)), r"`pos`.*sim\.write\(joint_q=\{\"cube\""),
        (
            lambda scene, arm: scene.add_box(half_extents=(1, 1, 1), pos=(9, 9, 9)),
            r"Scene: `add_box` changes the scene after the launch",
        ),
        (lambda scene, arm: scene.randomize(joint_q={"arm": tl.Uniform(0, 1)}), r"`randomize` changes the scene after"),
    ],
)
def test_changes_of_a_scene_that_runs(scene, change, said):
    arm = scene.robots["arm"]
    with tl.launch(scene, worlds=1, name="running") as sim:
        with told_once(rf"(?s){said}"):
            change(scene, arm)
        with nothing_told():
            change(scene, arm)
            sim.step()
    with nothing_told():
        arm.joint_target_ke = 7.0
        copied = copy.deepcopy(scene)
        with tl.launch(copied, worlds=1):
            arm.joint_target_ke = 8.0


def test_a_copy_of_a_scene_that_runs_changes_nothing(scene):
    with tl.launch(scene, worlds=1):
        with nothing_told():
            copy.copy(scene)
        with told_once(r"Scene: `gravity`.*write sim\.params\.gravity"):
            scene.gravity = (0, 0, -9)


def test_only_the_first_calls_and_worlds_are_looked_at(scene):
    late = np.zeros((20, 8))
    late[17, 0] = 90.0
    with tl.launch(scene, worlds=20) as sim, nothing_told():
        sim.step(joint_target_q=late)
        for _ in range(256):
            sim.step(joint_target_q={"arm": [0.1, 0.1]})
        sim.step(joint_target_q={"arm": [90.0, 0.1]})


def test_members_of_tasks_elsewhere():
    with told_once(r"task Hurried: nothing uses its `is_terminated`; a Task has `terminated`"):

        class Hurried(CartPoleBalance):
            def is_terminated(self, xp, worlds):
                return worlds.joint_q[:, 0] > 1.0

    with nothing_told():

        class Careful(CartPoleBalance):
            def terminated(self, xp, worlds):
                return worlds.joint_q[:, 0] > 1.0

    assert Hurried is not Careful


def test_a_gpu_that_is_a_software_driver(scene):
    devices = subprocess.run([sys.executable, "-m", "tightloop", "devices"], capture_output=True, text=True, check=True)
    # software drivers come last
    if "llvmpipe" not in devices.stdout.partition("\n")[0]:
        pytest.skip("a hardware GPU comes first on this machine, or there is no software driver")
    with told_once(r"device is 'gpu', and the only one is the software driver .*llvmpipe.*device='cpu'"):
        tl.launch(scene, worlds=1, device="gpu").close()
    with nothing_told():
        tl.launch(scene, worlds=1, device="gpu:0").close()
