"""Scenes as data: what they take, what they refuse, and that files hold all of it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import tightloop as tl

URDF = """<robot name="two arm">
  <link name="base"/>
  <link name="upper"><inertial><mass value="1"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <link name="lower"><inertial><mass value="1"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="20" velocity="3"/></joint>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/><axis xyz="0 1 0"/></joint>
</robot>
"""


@pytest.fixture
def urdf(tmp_path: Path) -> Path:
    path = tmp_path / "robots" / "two.urdf"
    path.parent.mkdir()
    path.write_text(URDF)
    return path


@pytest.fixture
def arm(urdf: Path) -> tl.Robot:
    return tl.Scene().add_urdf(urdf, name="arm")


def test_a_robot_starts_with_what_its_file_says(urdf):
    robot = tl.Scene().add_urdf(urdf)
    assert robot.name == "two_arm"
    assert robot.joint_names == ["shoulder", "elbow"]
    assert robot.link_names == ["base", "upper", "lower"]
    assert robot.joint_q.tolist() == [0, 0]
    assert robot.joint_effort_limit.tolist() == [20, math.inf]
    assert robot.joint_target_mode == ("position", "position")


def test_one_value_is_for_every_dof_and_lists_are_one_per_dof(arm: tl.Robot):
    arm.joint_target_ke = 30
    arm.joint_armature = [0.1, 0.2]
    arm.joint_target_mode = "velocity"
    assert arm.joint_target_ke.tolist() == [30, 30]
    assert arm.joint_armature.tolist() == [0.1, 0.2]
    assert arm.joint_target_mode == ("velocity", "velocity")
    arm.joint_target_mode = ["both", "position"]
    assert arm.joint_target_mode == ("both", "position")


def test_targets_are_the_start_positions_until_set(arm: tl.Robot):
    arm.joint_q = [0.1, 0.2]
    assert arm.joint_target_q.tolist() == [0.1, 0.2]
    arm.joint_target_q = 0
    assert arm.joint_target_q.tolist() == [0, 0]


def test_a_property_is_not_the_array_that_was_given(arm: tl.Robot):
    given = np.zeros(2)
    arm.joint_q = given
    given[0] = 1
    assert arm.joint_q.tolist() == [0, 0]


@pytest.mark.parametrize(
    ("name", "value", "named"),
    [
        ("joint_q", [1, 2, 3], r"robot `arm`: joint_q has 3 values; expected 2.*shoulder, elbow"),
        ("joint_q", [[1, 2]], r"joint_q has shape \(1, 2\)"),
        ("joint_q", [1, math.nan], r"joint_q of coordinate `arm/elbow` is nan"),
        ("joint_q", [math.inf, 0], r"joint_q of coordinate `arm/shoulder` is inf; give a finite number$"),
        ("joint_q", ["a", "b"], r"joint_q is \['a', 'b'\]; give real numbers"),
        ("joint_q", [1j, 0], r"joint_q is \[1j, 0\]; give real numbers"),
        ("joint_q", [[1], [1, 2]], r"joint_q is \[\[1\], \[1, 2\]\]; give an array"),
        ("joint_effort_limit", -1, r"joint_effort_limit of dof `arm/shoulder` is -1\.0; give a number of at least 0"),
        ("joint_target_kd", [1, -2], r"joint_target_kd of dof `arm/elbow` is -2\.0"),
        ("joint_target_mode", "force", r"joint_target_mode.*'force'.*'position', 'velocity', 'both'"),
        ("joint_target_mode", ["both"], r"joint_target_mode has 1 values; expected 2"),
        ("joint_target_mode", None, r"joint_target_mode is None; expected 2"),
        ("pos", (0, 0), r"robot `arm`: pos has 2 values; give 3"),
        ("pos", (0, math.nan, 0), r"robot `arm`: pos is nan; give a finite number"),
        ("quat", (0, 0, 0, 2), r"robot `arm`: quat .* has length 2"),
    ],
)
def test_a_wrong_property_names_robot_field_and_dof(arm: tl.Robot, name, value, named):
    before = getattr(arm, name)
    with pytest.raises(tl.SceneError, match=named):
        setattr(arm, name, value)
    assert np.array_equal(getattr(arm, name), before)


def test_a_property_that_does_not_exist_is_an_error(arm: tl.Robot):
    with pytest.raises(AttributeError, match="joint_stiffness"):
        arm.joint_stiffness = 3  # pyright: ignore[reportAttributeAccessIssue]


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"dt": 0}, "dt is 0; it must be above 0"),
        ({"dt": -1}, "dt is -1"),
        ({"dt": math.nan}, "dt is nan"),
        ({"dt": "fast"}, "dt is 'fast'"),
        ({"dt": 10**400}, "dt is larger than any float"),
        ({"substeps": 0}, "substeps is 0; it must be at least 1"),
        ({"substeps": 1.5}, r"substeps is 1\.5; give a whole number"),
        ({"substeps": 2**70}, "substeps does not fit into 64 bits"),
        ({"gravity": (0, 0)}, "gravity has 2 values; give 3"),
        ({"gravity": -9.81}, r"gravity is -9\.81; give 3 numbers"),
    ],
    ids=str,
)
def test_a_wrong_scene_argument_is_named(arguments, named):
    with pytest.raises(tl.SceneError, match=named):
        tl.Scene(**arguments)
    scene = tl.Scene()
    before = scene.to_toml()
    for name, value in arguments.items():
        with pytest.raises(tl.SceneError, match=named):
            setattr(scene, name, value)
    assert scene.to_toml() == before


@pytest.mark.parametrize("wrong", [None, 5, b"arm.urdf", "arm\0.urdf"], ids=repr)
def test_what_is_no_path_is_named(wrong):
    scene = tl.Scene()
    for call in (scene.add_urdf, scene.save, tl.Scene.load):
        with pytest.raises(tl.SceneError, match=r"path is .*(give a path|no zero byte)"):
            call(wrong)
    with pytest.raises(tl.SceneError, match="package_dirs"):
        scene.add_urdf("arm.urdf", package_dirs="folder")


def test_numpy_numbers_are_numbers(arm: tl.Robot):
    scene = tl.Scene()
    scene.dt, scene.substeps, scene.gravity = np.float32(0.5), np.int64(3), np.array([0, 0, -1])
    arm.pos, arm.quat = np.zeros(3), np.array([0, 0, 0, 1])
    assert "dt = 0.5" in scene.to_toml()
    assert (scene.substeps, scene.gravity, arm.pos, arm.quat) == (3, (0, 0, -1), (0, 0, 0), (0, 0, 0, 1))


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"cone": "round"}, "cone 'round'.*'elliptic', 'pyramidal'"),
        ({"iterations": 0}, "iterations is 0"),
        ({"tolerance": -1}, "tolerance is -1"),
        ({"impratio": 0}, "impratio is 0"),
    ],
    ids=str,
)
def test_a_wrong_solver_option_is_named(options, named):
    with pytest.raises(tl.SceneError, match=named):
        tl.Scene().solver(**options)


def test_names_are_unique_and_plain(urdf):
    scene = tl.Scene()
    scene.add_urdf(urdf, name="arm")
    with pytest.raises(tl.SceneError, match="`arm` is taken"):
        scene.add_urdf(urdf, name="arm")
    with pytest.raises(tl.SceneError, match="`arm` is taken"):
        scene.add_sphere(radius=1, name="arm")
    with pytest.raises(tl.SceneError, match="'a/b'"):
        scene.add_urdf(urdf, name="a/b")
    boxes = [scene.add_box(half_extents=(1, 1, 1)) for _ in range(2)]
    assert [box.name for box in boxes] == ["box", "box_2"]


def test_poses_and_sizes_are_checked(urdf):
    scene = tl.Scene()
    with pytest.raises(tl.SceneError, match=r"quat .* length 2; give a unit quaternion"):
        scene.add_urdf(urdf, quat=(0, 0, 0, 2))
    with pytest.raises(tl.SceneError, match="pos has 2 values"):
        scene.add_urdf(urdf, pos=(0, 0))
    with pytest.raises(tl.SceneError, match="half_extents is -1"):
        scene.add_box(half_extents=(1, 1, -1))
    with pytest.raises(tl.SceneError, match="radius is 0"):
        scene.add_capsule(radius=0, half_height=1)
    assert not scene.robots and not scene.shapes


def full(urdf: Path) -> tl.Scene:
    """A scene with everything that a file can hold."""
    scene = tl.Scene(dt=1 / 300, substeps=3, gravity=(0.1, 0, -9))
    scene.solver(iterations=7, ls_iterations=9, tolerance=1e-6, cone="pyramidal", impratio=2)
    scene.add_box(half_extents=(1, 2, 3), pos=(4, 5, 6), name="table")
    scene.add_sphere(radius=0.5)
    scene.add_cylinder(radius=0.5, half_height=0.25, quat=(0, 0, 0.6, 0.8))
    scene.add_capsule(radius=0.5, half_height=0.25)
    arm = scene.add_urdf(urdf, name="arm", pos=(1, 2, 3), quat=(0, 0, 1, 0), self_collisions=True)
    arm.joint_q = [0.1, 1 / 3]
    arm.joint_target_q = [0.3, 0.4]
    arm.joint_target_qd = -1
    arm.joint_target_mode = ["both", "velocity"]
    arm.joint_target_ke, arm.joint_target_kd = 100, [5, 6]
    arm.joint_effort_limit = [math.inf, 7]
    arm.joint_armature = 1e-3
    scene.add_urdf(urdf, name="plain")
    return scene


def test_a_file_holds_the_whole_scene(urdf, tmp_path):
    scene = full(urdf)
    file = tmp_path / "scene.toml"
    scene.save(file)
    loaded = tl.Scene.load(file)
    assert loaded.to_toml() == scene.to_toml()
    for name in ("dt", "substeps", "gravity", "shapes"):
        assert getattr(loaded, name) == getattr(scene, name)
    assert loaded.robots["arm"].joint_effort_limit.tolist() == [math.inf, 7]
    assert loaded.robots["arm"].joint_q.tolist() == [0.1, 1 / 3]


def test_paths_in_a_file_are_relative_to_it_and_move_with_it(urdf, tmp_path, monkeypatch):
    full(urdf).save(tmp_path / "scene.toml")
    text = (tmp_path / "scene.toml").read_text()
    assert 'urdf = "robots/two.urdf"' in text and str(tmp_path) not in text
    moved = tmp_path.rename(tmp_path.with_name(tmp_path.name + "_moved"))
    monkeypatch.chdir("/")
    assert tl.Scene.load(moved / "scene.toml").robots["arm"].urdf == moved / "robots/two.urdf"


def test_what_was_not_set_is_not_written(urdf, tmp_path):
    scene = tl.Scene()
    scene.add_urdf(urdf, name="arm")
    scene.save(tmp_path / "scene.toml")
    assert "joint_" not in (tmp_path / "scene.toml").read_text()


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("dt = 0.01\nsubsteps = 4\nspeed = 3\n", "speed"),
        ("dt = 0.01\n", "substeps"),
        ("dt = [\n", r"scene\.toml"),
        ("dt = 0.0\nsubsteps = 4\n", "dt is 0"),
        ('dt = 0.01\nsubsteps = 4\n[[robot]]\nurdf = "gone.urdf"\n', r"gone\.urdf"),
    ],
)
def test_a_wrong_file_is_refused_by_name(tmp_path, text, named):
    file = tmp_path / "scene.toml"
    file.write_text(text)
    with pytest.raises(tl.SceneError, match=named):
        tl.Scene.load(file)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(tl.SceneError, match=r"nowhere\.toml"):
        tl.Scene.load(tmp_path / "nowhere.toml")
    with pytest.raises(tl.SceneError, match="nowhere"):
        tl.Scene().save(tmp_path / "nowhere" / "scene.toml")


def test_a_free_name_is_the_first_that_nobody_has_in_scenes_of_any_size() -> None:
    scene = tl.Scene()
    scene.add_box(half_extents=(1, 1, 1), name="box_2")
    boxes = [scene.add_box(half_extents=(1, 1, 1)).name for _ in range(20_000)]
    assert boxes[:3] == ["box", "box_3", "box_4"] and boxes[-1] == "box_20001"
