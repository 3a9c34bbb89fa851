"""Scenes written as MJCF: what MuJoCo makes of the text is what tightloop simulates.

The states are ours; `qpos`, `qvel` and `qacc` are in MuJoCo's conventions, and velocities are converted by
`Coordinates`.
"""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from mujoco_model import ITERATIONS, Array
from random_robots import Coordinates
from test_every_joint import random_scene, random_state

import tightloop as tl
from conftest import START, URDF
from tightloop.errors import SceneError, TightloopWarning

FIELDS = tuple("joint_q joint_qd mass_matrix bias_force qpos qvel qacc".split())
# What the door promises, relative to the largest entry
SAME = 1e-9
# Of positions after steps with contacts: MuJoCo keeps the vertices of meshes in float32
MOVED = 1e-7
LINK = """<link name="{name}"><inertial><mass value="{mass}"/><inertia ixx="{ixx}" iyy="{iyy}" izz="{izz}"
  ixy="0" ixz="0" iyz="0"/></inertial>{more}</link>"""


def link(
    name: str, mass: float = 1.0, moments: tuple[float, float, float] = (0.01, 0.02, 0.015), more: str = ""
) -> str:
    """A link of a URDF file."""
    return LINK.format(name=name, mass=mass, ixx=moments[0], iyy=moments[1], izz=moments[2], more=more)


def joint(name: str, kind: str, parent: str, child: str, more: str = "") -> str:
    """A joint of a URDF file, 0.2 m from its parent."""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0 0.1 -0.2" rpy="0.1 0.2 0.3"/><axis xyz="0 1 0"/>{more}</joint>'
    )


def robot_of(folder: Path, *parts: str) -> Path:
    """A URDF file of these parts."""
    file = folder / "robot.urdf"
    file.write_text(f'<robot name="r">{"".join(parts)}</robot>')
    return file


def solved(scene: tl.Scene) -> tl.Scene:
    """The scene, whose solver does not stop before the end."""
    scene.solver(iterations=ITERATIONS, tolerance=0.0)
    return scene


def launch(scene: tl.Scene) -> tl.Sim:
    return tl.launch(scene, worlds=1, precision="f64", threads=1, fields=FIELDS)


def mass_matrix(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    out = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, out)
    return out


def relative(found: Array, expected: Array) -> float:
    """Largest difference over the largest value."""
    return float(np.abs(found - expected).max(initial=0.0) / np.abs(expected).max(initial=1e-3))


def assert_same_dynamics(model: mujoco.MjModel, sim: tl.Sim, q: Array, qd: Array) -> None:
    """Mass matrix, bias forces and accelerations of a state."""
    frame, data, to = sim.write(joint_q=q[None], joint_qd=qd[None]), mujoco.MjData(model), Coordinates(model, sim)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    data.qpos[:], data.qvel[:] = frame.qpos[0], frame.qvel[0]
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    mujoco.mj_forward(model, data)
    convert, theirs = to.to_qvel(q), mass_matrix(model, data)
    assert relative(frame.mass_matrix[0], convert.T @ theirs @ convert) < SAME
    # bias forces of ours are of q̈ = 0 in our coordinates
    bias = convert.T @ (data.qfrc_bias + theirs @ to.drift(q, qd))
    assert relative(frame.bias_force[0], bias) < SAME
    assert relative(frame.qacc[0], data.qacc) < SAME


def assert_same_motion(scene: tl.Scene, steps: int = 100, within: float = MOVED) -> int:
    """Positions after steps from the start; returns the most contacts that MuJoCo had."""
    model = mujoco.MjModel.from_xml_string(solved(scene).to_mujoco())
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    contacts = 0
    with launch(scene) as sim:
        frame = sim.reset()
        np.testing.assert_array_equal(data.qpos, frame.qpos[0])
        for _ in range(steps):
            frame = sim.step()
            for _ in range(scene.substeps):
                mujoco.mj_step(model, data)
                contacts = max(contacts, data.ncon)
        np.testing.assert_allclose(data.qpos, frame.qpos[0], rtol=0.0, atol=within)
    return contacts


@pytest.mark.parametrize("seed", range(24))
def test_a_random_robot_has_the_same_dynamics(seed: int, tmp_path: Path) -> None:
    scene, _, rng = random_scene(tmp_path, seed, 1 + 17 * seed % 40)
    model = mujoco.MjModel.from_xml_string(scene.to_mujoco())
    with launch(scene) as sim:
        assert {model.body(body).name for body in range(1, model.nbody)} == {*sim.body_names}
        for _ in range(3):
            assert_same_dynamics(model, sim, *random_state(rng, sim))


def test_an_arm_with_drives_moves_alike_and_touches_alike() -> None:
    scene = tl.Scene(dt=1 / 480, substeps=4)
    scene.add_ground(z=-0.02)
    arm = scene.add_urdf(URDF, name="arm")
    arm.joint_q = START
    arm.joint_target_ke, arm.joint_target_kd = 400, 20
    arm.joint_target_q = [0, 1.6, 0, -0.5, 0, 1.6, 0.8, 0.04, 0.04]
    arm.joint_armature = 0.1
    assert assert_same_motion(scene) > 0


def test_a_quadruped_falls_and_lies_alike() -> None:
    scene = tl.Scene(dt=1 / 200, substeps=1)
    scene.add_ground()
    dog = scene.add_urdf(tl.assets.QUADRUPED, name="dog", floating=True, pos=(0, 0, 0.4), self_collisions=True)
    dog.joint_q = [0, 0, 0.4, 0, 0, 0, 1, *[0, 0.8, -1.6] * 4]
    dog.joint_target_ke, dog.joint_target_kd = 40, 1
    assert assert_same_motion(scene) > 0


@pytest.mark.parametrize("kind", ["box", "sphere", "capsule", "cylinder", "mesh"])
def test_a_body_of_each_kind_lands_alike_on_a_plane(kind: str, tmp_path: Path) -> None:
    scene = tl.Scene(dt=1 / 400, substeps=1, gravity=(0.3, 0.0, -9.0))
    scene.add_ground(mu=0.7, ke=4000, kd=80, kf=500, margin=0.001, gap=0.002)
    turn = np.array([0.3, -0.2, 0.1, 0.9])
    scene.add_body(name="thing", pos=(0, 0, 0.2), quat=tuple(turn / np.linalg.norm(turn)))
    if kind == "mesh":
        (tmp_path / "tetrahedron.obj").write_text(
            "v 0 0 0\nv 0.1 0 0\nv 0 0.125 0\nv 0 0 0.2\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
        )
        scene.add_mesh(tmp_path / "tetrahedron.obj", name="skin", body="thing", mu=0.2)
    elif kind == "box":
        scene.add_box(half_extents=(0.05, 0.06, 0.07), name="skin", body="thing", mu=0.2)
    else:
        size = {"radius": 0.05} | ({} if kind == "sphere" else {"half_height": 0.06})
        getattr(scene, f"add_{kind}")(**size, name="skin", body="thing", mu=0.2)
    assert assert_same_motion(scene) > 0


def test_inertias_and_paths_that_mujoco_refuses_are_written(tmp_path: Path) -> None:
    mesh = tmp_path / "humanoid/meshes/m.obj"
    mesh.parent.mkdir(parents=True)
    mesh.write_text("v 0 0 0\nv 0.1 0 0\nv 0 0.125 0\nv 0 0 0.2\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n")
    geometry = '<collision><geometry><mesh filename="package://humanoid/meshes/m.obj"/></geometry></collision>'
    file = robot_of(
        tmp_path,
        '<link name="base"/>',
        link("a", moments=(0.001, 0.001, 0.1), more=geometry),
        link("b", moments=(0.3, 0.1, 0.1)),
        joint("j1", "revolute", "base", "a", '<limit lower="-1" upper="1" effort="5" velocity="1"/>'),
        joint("j2", "prismatic", "a", "b", '<limit lower="-1" upper="1" effort="0" velocity="1"/>'),
    )
    with pytest.raises(ValueError):
        mujoco.MjModel.from_xml_path(str(file))
    scene = tl.Scene(dt=1 / 400, substeps=2)
    scene.add_ground(z=-0.5)
    robot = scene.add_urdf(file, name="r", package_dirs=[tmp_path])
    robot.joint_target_ke, robot.joint_target_kd = 50, 2
    robot.joint_q, robot.joint_target_q = [0.5, 0.2], [0.1, -0.3]
    assert_same_motion(scene)


def test_followers_and_limits_act_alike(tmp_path: Path) -> None:
    file = robot_of(
        tmp_path,
        '<link name="base"/>',
        *(link(name) for name in "abc"),
        joint("lead", "revolute", "base", "a", '<limit lower="-0.2" upper="0.2" effort="50" velocity="1"/>'),
        joint("next", "continuous", "a", "b", '<mimic joint="lead" multiplier="-2" offset="0.1"/>'),
        joint("last", "prismatic", "b", "c", '<limit lower="0" upper="0.1" effort="50" velocity="1"/>'),
    )
    scene = tl.Scene(dt=1 / 400, substeps=2)
    robot = scene.add_urdf(file, name="r")
    robot.joint_target_ke, robot.joint_target_kd = 300, 3
    robot.joint_limit_ke, robot.joint_limit_kd = [1e4, 1e4, 0.0], [10.0, 10.0, 3.0]
    robot.joint_target_q = [1.0, 0.0, -0.5]
    assert_same_motion(scene)


def test_links_and_joints_may_share_their_names(tmp_path: Path) -> None:
    file = robot_of(tmp_path, '<link name="base"/>', link("a"), link("b"), joint("a", "continuous", "base", "a"))
    file.write_text(file.read_text().replace("</robot>", joint("b", "spherical", "a", "b") + "</robot>"))
    scene = tl.Scene()
    scene.add_urdf(file, name="r").joint_q = [0.5, 0.6, 0.0, 0.0, 0.8]
    assert_same_motion(scene)


def test_a_height_field_has_the_same_surface_and_bottom(tmp_path: Path) -> None:
    samples = np.random.default_rng(0).uniform(-0.2, 0.3, (4, 7))
    scene = tl.Scene()
    turn = np.array([0.1, 0.2, 0.3, 0.9])
    turn /= np.linalg.norm(turn)
    scene.add_hfield(samples, size=(3.0, 2.0), base=0.5, pos=(1, 2, 3), quat=tuple(turn), name="hills")
    scene.add_body(name="ball", pos=(0, 0, 5))
    scene.add_sphere(radius=0.1, body="ball", name="skin")
    model = mujoco.MjModel.from_xml_string(scene.to_mujoco())
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, model.geom("hills").quat)
    half_x, half_y, height, base = model.hfield_size[0]
    assert (half_x, half_y) == (1.5, 1.0) and base == pytest.approx(0.5)
    low = (model.geom("hills").pos - (1, 2, 3)) @ rotation.reshape(3, 3)
    # the samples are float32 there
    found = low[2] + height * model.hfield_data.reshape(4, 7)
    np.testing.assert_allclose(found, samples, atol=2.0**-23)
    np.testing.assert_allclose(low[:2], 0.0, atol=1e-12)


def test_sites_keep_their_names_and_places(tmp_path: Path) -> None:
    scene = tl.Scene()
    scene.add_urdf(URDF, name="arm")
    scene.add_site(name="tip", body="arm/fr3_hand_tcp", pos=(0, 0, 0.1))
    file = tmp_path / "arm.xml"
    assert scene.to_mujoco(file) == file.read_text()
    model = mujoco.MjModel.from_xml_path(str(file))
    assert model.body(model.site("tip").bodyid[0]).name == "arm/fr3_hand_tcp"
    np.testing.assert_array_equal(model.site("tip").pos, [0, 0, 0.1])


def test_what_mjcf_cannot_say_is_refused_or_reported_by_name(tmp_path: Path) -> None:
    file = robot_of(tmp_path, '<link name="base"/>', link("a"), joint("j", "spherical", "base", "a"))
    scene = tl.Scene()
    robot = scene.add_urdf(file, name="r")
    robot.joint_target_kd = 1.0
    with pytest.raises(SceneError, match=r"dof `r/j\.wx` of a ball joint has a drive, .* set its joint_target_ke"):
        scene.to_mujoco()
    robot.joint_target_kd = 0.0
    robot.joint_armature = [1.0, 2.0, 2.0]
    with pytest.raises(SceneError, match=r"joint_armature of joint `r/j` is 1\.0 2\.0; MJCF has one for all axes"):
        scene.to_mujoco()
    robot.joint_armature = 1.0
    scene.add_ground()
    scene.to_mujoco()
    ball = mujoco.MjModel.from_xml_string('<mujoco><worldbody><geom size="1"/></worldbody></mujoco>')
    with pytest.raises(SceneError, match="MuJoCo model `m` came from MuJoCo; use the MJCF file"):
        tl.Scene.from_mujoco(ball, name="m").to_mujoco()
    with pytest.raises(SceneError, match="no_folder"):
        tl.Scene().to_mujoco(tmp_path / "no_folder/scene.xml")


def test_a_sensor_without_an_equal_is_reported() -> None:
    scene = tl.Scene()
    scene.add_urdf(URDF, name="arm")
    scene.add_ground()
    scene.add_contact_sensor(name="touch", of="arm")
    with pytest.warns(TightloopWarning, match="MJCF has no equal of sensor 'touch'; it is left out"):
        scene.to_mujoco()
