"""Robots that fall for ever, hang in the air or touch nothing, and units of files: reported with their cure."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import Any

import pytest

import tightloop as tl

LINK = """<link name="{name}"><inertial><mass value="1"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>{collision}</link>"""
BALL = '<collision><geometry><sphere radius="0.05"/></geometry></collision>'
JOINT = """<joint name="{name}_joint" type="revolute"><parent link="trunk"/><child link="{name}"/>
    <origin xyz="0 {y} -0.3"/><axis xyz="0 1 0"/>
    <limit lower="{lower}" upper="{upper}" effort="9" velocity="1"/></joint>"""


def robot(folder: Path, parts: list[str], collision: str = BALL, limits: tuple[float, float] = (-2, 2)) -> Path:
    """Write a robot with links that hang from a trunk."""
    links = [LINK.format(name=name, collision=collision) for name in ("trunk", *parts)]
    joints = [
        JOINT.format(name=name, y=0.3 * place, lower=limits[0], upper=limits[1]) for place, name in enumerate(parts)
    ]
    path = folder / "robot.urdf"
    path.write_text(f'<robot name="dog">{"".join(links + joints)}</robot>')
    return path


def told(scene: tl.Scene, **options: Any) -> list[str]:
    """Launch a scene, and return what it warns of."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        tl.launch(scene, worlds=1, **options).close()
    assert all(warning.category is tl.TightloopWarning and warning.filename == __file__ for warning in caught)
    return [str(warning.message) for warning in caught]


def test_a_floating_robot_without_a_ground(tmp_path):
    path = robot(tmp_path, ["arm"])
    scene = tl.Scene()
    scene.add_urdf(path, floating=True)
    [warning] = told(scene)
    assert "`dog` floats" in warning and "falls for ever" in warning and "scene.add_ground()" in warning
    assert told(scene, params=("body_f",)) == [], "thrust may hold it"
    scene.gravity = (0, 0, 0)
    assert told(scene) == []
    scene = tl.Scene()
    scene.add_ground()
    scene.add_urdf(path, floating=True, pos=(0, 0, 1))
    assert told(scene) == []


def test_a_floating_robot_without_collision_shapes(tmp_path):
    path = robot(tmp_path, ["arm"], collision="")
    scene = tl.Scene()
    scene.add_ground()
    dog = scene.add_urdf(path, floating=True, pos=(0, 0, 1))
    [warning] = told(scene)
    assert "`dog`" in warning and "falls through everything" in warning and "<collision>" in warning
    scene.add_box(half_extents=(0.1, 0.1, 0.1), body=dog.link("trunk"))
    assert told(scene) == []
    scene = tl.Scene()
    scene.add_ground()
    scene.add_urdf(path)
    assert told(scene) == [], "a pendulum above the ground"


@pytest.mark.parametrize("parts", [["left_foot", "right_foot"], ["FL_calf", "FR_calf", "RL_calf", "RR_calf"]])
def test_a_robot_with_legs_on_a_fixed_base(tmp_path, parts):
    path = robot(tmp_path, parts)
    scene = tl.Scene()
    scene.add_urdf(path)
    assert told(scene) == [], "to compute with it, without a ground"
    scene.add_ground()
    scene.robots["dog"].pos = (0, 0, 1)
    [warning] = told(scene)
    assert "`dog` has legs" in warning and f"`{parts[0]}`" in warning and "floating=True" in warning
    scene = tl.Scene()
    scene.add_ground()
    scene.add_urdf(path, floating=True, pos=(0, 0, 1))
    assert told(scene) == []


def test_fingers_are_no_legs(tmp_path):
    scene = tl.Scene()
    scene.add_ground()
    scene.add_urdf(robot(tmp_path, ["left_finger", "right_finger"]), pos=(0, 0, 1))
    assert told(scene) == []


def test_gravity_as_one_number():
    with pytest.raises(tl.SceneError, match=r"gravity is -9\.81; give 3 numbers, with z up, such as \(0, 0, -9\.81\)"):
        tl.Scene(gravity=-9.81)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("gravity", "said"),
    [
        ((0, 0, 9.81), r"gravity is \(0, 0, 9\.81\), which points up, .*ceiling, turn it"),
        ((0.5, 0, 1.0), r"which points up"),
        ((0, -9.81, 0), r"gravity is \(0, -9\.81, 0\), which acts along the ground"),
        ((9.81, 0, 0), r"which acts along the ground"),
        ((0, 0, -981), r"gravity is \(0, 0, -981\), which looks like another unit: it is in m/s²"),
        ((0, 0, -9810), r"which looks like another unit"),
        ((0, 0, -1), r"which looks like multiples of 9\.81"),
    ],
)
def test_gravity_with_the_wrong_sign_axis_or_unit(tmp_path, gravity, said):
    scene = tl.Scene(gravity=gravity)
    scene.add_body(name="ceiling", fixed=True)
    assert told(scene) == [], "nothing moves"
    scene.add_urdf(robot(tmp_path, ["arm"]))
    [warning] = told(scene)
    assert re.search(said, warning) and "(0, 0, -9.81)" in warning, warning


@pytest.mark.parametrize("gravity", [(0, 0, -9.81), (0, 0, 0), (0, 0, -1.62), (0, 0, -24.8), (1.0, 0, -9.7)])
def test_gravity_of_planets_slopes_and_none(tmp_path, gravity):
    scene = tl.Scene(gravity=gravity)
    scene.add_urdf(robot(tmp_path, ["arm"]))
    assert told(scene) == []


@pytest.mark.parametrize(
    ("size", "scale", "cure"),
    [
        (100, 1, 'scale="0.001 0.001 0.001"'),
        (0.1, 0.001, "leave out a scale of 0.001"),
        (100, 0.001, None),
        (0.1, 1, None),
    ],
)
def test_meshes_in_another_unit(tmp_path, size, scale, cure):
    corners = [(x * size, y * size, z * size) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    faces = [(1, 3, 4, 2), (5, 6, 8, 7), (1, 2, 6, 5), (3, 7, 8, 4), (1, 5, 7, 3), (2, 4, 8, 6)]
    lines = ["v {} {} {}".format(*corner) for corner in corners] + ["f {} {} {} {}".format(*face) for face in faces]
    (tmp_path / "part.obj").write_text("\n".join(lines))
    mesh = f'<collision><geometry><mesh filename="part.obj" scale="{scale} {scale} {scale}"/></geometry></collision>'
    scene = tl.Scene()
    scene.add_urdf(robot(tmp_path, ["arm"], collision=mesh))
    warned = told(scene)
    if cure is None:
        assert warned == []
    else:
        [warning] = warned
        assert "`part.obj` of link `trunk` is" in warning and cure in warning


def test_limits_of_a_file_in_degrees(tmp_path):
    scene = tl.Scene()
    scene.add_urdf(robot(tmp_path, ["arm"], limits=(-90, 90)))
    [warning] = told(scene)
    assert "`arm_joint` (-90 to 90)" in warning and "degrees" in warning and "57.29578" in warning
    for limits in ((-12.5, 12.5), (-1e9, 1e9)):
        scene = tl.Scene()
        scene.add_urdf(robot(tmp_path, ["arm"], limits=limits))
        assert told(scene) == [], limits


def test_draws_of_a_start_in_degrees(tmp_path):
    path = robot(tmp_path, ["arm"])
    for half, warned in ((1.0, 0), (20.0, 1)):
        scene = tl.Scene()
        scene.add_urdf(path)
        scene.randomize(joint_q={"dog/arm_joint": tl.Uniform(-half, half)})
        warning = told(scene)
        assert len(warning) == warned
    assert "`arm_joint` by up to 20" in warning[0] and "np.radians" in warning[0]


@pytest.mark.parametrize("what", ["shape of a link", "shape of a body", "site"])
def test_an_identity_with_w_first(tmp_path, what):
    def made(quat: tuple[float, ...]) -> tl.Scene:
        scene = tl.Scene(gravity=(0, 0, 0))
        dog = scene.add_urdf(robot(tmp_path, ["arm"]))
        if what == "shape of a link":
            scene.add_box(half_extents=(0.1, 0.1, 0.1), body=dog.link("arm"), name="own", quat=quat)
        elif what == "shape of a body":
            cube = scene.add_body(pos=(2, 0, 0))
            scene.add_box(half_extents=(0.1, 0.1, 0.1), body=cube, name="own", quat=quat)
        else:
            scene.add_site(name="own", body=dog.link("arm"), quat=quat)
        return scene

    [warning] = told(made((1, 0, 0, 0)))
    assert "own` is turned by 180° about x" in warning and "(0, 0, 0, 1) for no turn" in warning
    assert told(made((-1, 0, 0, 0))) == [] and told(made((0, 0, 0, 1))) == []
