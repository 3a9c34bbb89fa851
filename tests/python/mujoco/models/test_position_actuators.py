"""Position actuators that users add to robots without any, from MJCF and from URDF, beside MuJoCo's own."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

import tightloop as tl
from conftest import PENDULUM, URDF

BODY = """<mujoco model="crane"><option timestep="0.002" integrator="{integrator}"/><worldbody>
  <body name="mast"><joint name="swing" axis="0 0 1" range="-60 60" limited="true"/><geom size="0.1" mass="2"/>
    <body pos="0.5 0 0"><joint name="lift" type="slide" axis="0 0 1"/><geom size="0.1" pos="0.1 0 0" mass="1"/>
      <body pos="0 0 -0.5"><joint name="hook" type="ball"/><geom size="0.05" pos="0 0 -0.2" mass="0.3"/>
        <body pos="0 0 -0.3"><joint name="motor" axis="0 1 0"/><geom size="0.03" mass="0.2"/></body>
      </body></body></body>
  <body name="box" pos="2 0 0"><freejoint name="free"/><geom size="0.1"/></body>
</worldbody>
<keyframe><key name="up" qpos="0.3 0.2 1 0 0 0 -0.4 2 0 0 1 0 0 0" ctrl="{ctrl}"/></keyframe>
<actuator><motor joint="motor" gear="2" ctrlrange="-1 1"/>{actuators}</actuator></mujoco>"""
POSITIONS = """
  <position name="swing" joint="swing" kp="40" kv="5" ctrlrange="-1.0471975511965976 1.0471975511965976"/>
  <position name="lift" joint="lift" kp="300" kv="20" forcerange="-15 15"/>"""


def crane(integrator: str = "implicitfast") -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(BODY.format(integrator=integrator, actuators="", ctrl="0.5"))


def added(scene: tl.Scene) -> tl.MujocoModel:
    """Give a crane the actuators that MuJoCo compiles for it below."""
    model = scene.models["crane"]
    assert model.add_position_actuators("swing", stiffness=40, damping=5) == ["swing"]
    assert model.add_position_actuators(["li.*"], stiffness=300, damping=20, effort_limit=15) == ["lift"]
    return model


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast"])
def test_added_actuators_are_those_that_mujoco_compiles(integrator):
    scene = tl.Scene.from_mujoco(crane(integrator))
    model = added(scene)
    assert model.actuator_names == ["actuator0", "swing", "lift"]
    reference = mujoco.MjModel.from_xml_string(
        BODY.format(integrator=integrator, actuators=POSITIONS, ctrl="0.5 0.3 0.2")
    )
    data = mujoco.MjData(reference)
    rng = np.random.default_rng(3)
    fields = ("qpos", "qvel", "qacc", "actuator_force", "ctrl")
    with tl.launch(scene, worlds=1, precision="f64", fields=fields) as sim:
        frame = sim.reset(keyframe="up")
        mujoco.mj_resetDataKeyframe(reference, data, 0)
        np.testing.assert_allclose(frame.ctrl[0], data.ctrl, atol=1e-15)
        for _ in range(100):
            data.ctrl[:] = rng.uniform(-1.5, 1.5, 3)
            frame = sim.step(
                ctrl={"crane/swing": data.ctrl[1], "crane/lift": data.ctrl[2], "crane/actuator0": data.ctrl[0]}
            )
            mujoco.mj_step(reference, data)
            np.testing.assert_allclose(frame.qpos[0], data.qpos, atol=1e-9)
            np.testing.assert_allclose(frame.qvel[0], data.qvel, atol=1e-8)
        mujoco.mj_forward(reference, data)
        np.testing.assert_allclose(sim.forward().actuator_force[0], data.actuator_force, rtol=1e-7, atol=1e-7)


def test_a_saved_scene_keeps_added_actuators(tmp_path):
    scene = tl.Scene.from_mujoco(crane())
    added(scene)
    scene.save(tmp_path / "crane.toml")
    again = tl.Scene.load(tmp_path / "crane.toml")
    assert again.models["crane"].actuator_names == ["actuator0", "swing", "lift"]


def test_a_pattern_takes_hinges_and_slides_that_nothing_drives_yet():
    scene = tl.Scene.from_mujoco(crane())
    model = scene.models["crane"]
    with pytest.raises(tl.SceneError, match=r"`crane`.*joint `motor` has an actuator already"):
        model.add_position_actuators(stiffness=1, damping=0)
    assert model.actuator_names == ["actuator0"]
    model.add_position_actuators("swing|lift", stiffness=1, damping=0)
    assert model.actuator_names == ["actuator0", "swing", "lift"]


@pytest.mark.parametrize(
    ("joints", "options", "words"),
    [
        ("hook", {}, r"'hook' matches no joint that may have an actuator; there are: lift, motor, swing"),
        ("swng", {}, r"did you mean `swing`"),
        ("(", {}, r"'\(' is no pattern"),
        ([], {}, r"joints is \[\]; give names"),
        (".*", {"stiffness": -1}, r"stiffness is -1; it must be above 0"),
        (".*", {"damping": -1}, r"damping is -1; it must be at least 0"),
        (".*", {"effort_limit": 0}, r"effort_limit is 0; it must be above 0"),
    ],
    ids=str,
)
def test_what_cannot_be_driven_is_refused_by_name(joints, options, words, tmp_path):
    model = tl.Scene.from_mujoco(crane()).models["crane"]
    before = model.file
    with pytest.raises(tl.SceneError, match=words):
        model.add_position_actuators(joints, **{"stiffness": 1, "damping": 1} | options)
    assert model.file == before


def test_a_urdf_robot_gets_drives_by_pattern_and_its_mimic_joints_by_name_alone():
    scene = tl.Scene()
    arm = scene.add_urdf(URDF, name="arm")
    fingers = ["fr3_finger_joint1", "fr3_finger_joint2"]
    arms = [f"fr3_joint{place}" for place in range(1, 8)]
    assert arm.add_position_actuators("fr3_joint.", stiffness=400, damping=40, effort_limit=50) == arms
    assert arm.add_position_actuators("fr3_finger.*", stiffness=100, damping=10) == fingers[:1]
    assert arm.joint_target_ke.tolist() == [400.0] * 7 + [100.0, 0.0]
    assert arm.joint_target_kd.tolist() == [40.0] * 7 + [10.0, 0.0]
    assert arm.joint_effort_limit.tolist()[:7] == [50.0] * 7
    assert arm.add_position_actuators(fingers, stiffness=200, damping=20) == fingers
    assert arm.joint_target_ke.tolist()[7:] == [200.0] * 2


def test_a_floating_robot_gets_drives_of_its_joints_alone(tmp_path: Path):
    path = tmp_path / "robot.urdf"
    mass = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
    path.write_text(PENDULUM.replace('<link name="base"/>', f'<link name="base">{mass}</link>'))
    robot = tl.Scene(gravity=(0, 0, 0)).add_urdf(path, floating=True)
    assert robot.add_position_actuators(stiffness=5, damping=1) == ["shoulder", "elbow"]
    assert robot.joint_target_ke.tolist() == [0.0] * 6 + [5.0] * 2


def test_gains_that_a_model_does_not_have_name_the_way_to_actuators():
    model = tl.Scene.from_mujoco(crane()).models["crane"]
    with pytest.raises(tl.UnknownAttribute, match=r"'joint_target_ke'.*`add_position_actuators` adds some"):
        model.joint_target_ke = 100.0


def test_targets_of_a_model_without_actuators_are_reported_with_a_cure_that_works():
    spec = mujoco.MjSpec.from_string(BODY.format(integrator="Euler", actuators="", ctrl="0"))
    for element in [*spec.actuators, *spec.keys]:
        spec.delete(element)
    scene = tl.Scene.from_mujoco(spec)
    with tl.launch(scene, worlds=1) as sim:
        cure = r"`crane`.*add_position_actuators\(stiffness=…, damping=…\).*before launch.*send ctrl"
        with pytest.warns(tl.TightloopWarning, match=cure):
            sim.step(joint_target_q={"crane/swing": 0.3})
    scene.models["crane"].add_position_actuators("swing", stiffness=40, damping=5)
    with tl.launch(scene, worlds=1) as sim:
        for _ in range(1000):
            frame = sim.step(ctrl={"crane/swing": 0.3})
        assert frame.joint_q[0, 0] == pytest.approx(0.3, abs=0.01)
