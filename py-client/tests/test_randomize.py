"""Distributions of the start state as data: what a scene takes, what it refuses, and that files hold them."""

from __future__ import annotations

import copy
import math
from pathlib import Path

import pytest

import tightloop as tl

URDF = """<robot name="two">
  <link name="base"><inertial><mass value="1"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <link name="a"><inertial><mass value="1"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <link name="b"><inertial><mass value="1"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <link name="c"><inertial><mass value="1"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <joint name="lead" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="20" velocity="3"/></joint>
  <joint name="follow" type="revolute"><parent link="base"/><child link="b"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="20" velocity="3"/><mimic joint="lead"/></joint>
  <joint name="ball" type="spherical"><parent link="base"/><child link="c"/></joint>
</robot>
"""


@pytest.fixture
def scene(tmp_path: Path) -> tl.Scene:
    urdf = tmp_path / "two.urdf"
    urdf.write_text(URDF)
    scene = tl.Scene()
    scene.add_urdf(urdf, name="arm")
    scene.add_urdf(urdf, name="dog", floating=True)
    scene.add_cube()
    scene.add_body(name="post", fixed=True, mass=1)
    return scene


SOME = tl.Uniform(-0.1, 0.1)


def test_a_file_holds_all_distributions(scene, tmp_path):
    scene.randomize(
        joint_q={"arm": tl.Normal(0, 0.1), "arm/lead": SOME, "dog/ball": SOME, "arm/ball.wy": tl.Uniform(0, 1 / 3)},
        joint_qd={"dog": tl.Normal(-1, 2)},
        body_q={"cube": {"x": SOME, "yaw": tl.Uniform(-math.pi, math.pi)}, "dog": {"z": SOME}},
        body_qd={"dog": {"vx": tl.Normal(0.5, 0), "wz": SOME}},
        params={"gravity": {"z": tl.Normal(-9.81, 0.1)}, "joint_damping": {"arm": tl.Uniform(0, 1)}},
    )
    file = tmp_path / "scene.toml"
    scene.save(file)
    assert tl.Scene.load(file).to_toml() == scene.to_toml()
    assert "[randomize.joint_q.arm]\nnormal = [0.0, 0.1]\n" in file.read_text()
    assert '[randomize.joint_q."arm/ball.wy"]\nuniform = [0.0, 0.3333333333333333]\n' in file.read_text()


def test_ranges_of_a_parameter_are_added_and_replaced_by_name(scene):
    scene.randomize(params={"joint_damping": {"arm": tl.Uniform(0, 1), "dog": tl.Uniform(0, 2)}})
    scene.randomize(params={"joint_damping": {"dog": tl.Uniform(0, 3)}, "gravity": {"z": SOME}})
    text = scene.to_toml()
    for name, high in (("arm", 1.0), ("dog", 3.0)):
        assert f"[randomize.params.joint_damping.{name}]\nuniform = [0.0, {high}]\n" in text
    assert "uniform = [0.0, 2.0]" not in text and "[randomize.params.gravity.z]" in text


def test_a_later_call_adds_and_replaces(scene, tmp_path):
    scene.randomize(joint_q={"arm": SOME}, body_q={"cube": {"x": SOME, "y": SOME}})
    scene.randomize(joint_q={"arm": tl.Normal(0, 1), "dog": SOME}, body_q={"cube": {"x": tl.Normal(0, 2)}})
    other = tl.Scene()
    other.add_urdf(tmp_path / "two.urdf", name="arm")
    other.add_urdf(tmp_path / "two.urdf", name="dog", floating=True)
    other.add_cube()
    other.add_body(name="post", fixed=True, mass=1)
    other.randomize(joint_q={"dog": SOME, "arm": tl.Normal(0, 1)}, body_q={"cube": {"y": SOME, "x": tl.Normal(0, 2)}})
    assert scene.to_toml() == other.to_toml()


def test_a_scene_without_distributions_says_nothing_of_them(scene):
    scene.randomize()
    scene.randomize(joint_q={}, body_q={})
    assert "randomize" not in scene.to_toml()


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (
            {"joint_q": {"leg": SOME}},
            "joint_q of 'leg': there is no robot or body 'leg'; there are: arm, dog, cube, post",
        ),
        ({"joint_q": {"arm/knee": SOME}}, "'arm/knee': there is no joint 'knee'; there are: lead, follow, ball"),
        ({"joint_q": {"arm/lead.x": SOME}}, "there is no joint 'lead.x'"),
        ({"joint_q": {"arm/ball.w": SOME}}, "there is no joint 'ball.w'"),
        ({"joint_qd": {"arm/follow": SOME}}, "joint_qd of 'arm/follow': it follows `lead`; give `arm/lead`"),
        ({"joint_q": {"dog/floating_base": SOME}}, "there is no joint|it is a floating joint; give body_q"),
        ({"joint_q": {"cube": SOME}}, "'cube': it is a body; give body_q or body_qd"),
        ({"joint_q": {"arm/": SOME}}, "joint_q of 'arm/': the name is incomplete; give 'arm' for the whole"),
        ({"joint_qd": {"dog//": SOME}}, "joint_qd of 'dog//': the name is incomplete; give 'dog' for the whole"),
        ({"body_q": {"dog/": {"x": SOME}}}, "body_q of 'dog/': the name is incomplete; give 'dog' for the whole"),
        ({"params": {"shape_mu": 0.5}}, r"randomize: params, shape_mu is 0\.5; give a dict of distributions by name"),
        ({"params": {"shape_mu": {}}}, r"randomize: params, shape_mu is \{\}; give distributions by name"),
        ({"params": {"shape_mu": {"cube": 0.5}}}, r"shape_mu of 'cube' is 0\.5; give a tightloop.Uniform"),
        ({"params": {"shape_mu": {3: SOME}}}, "randomize: params, shape_mu has the key 3; give names"),
        ({"params": [SOME]}, "randomize: params is .*; give a dict"),
        ({"params": {3: {"cube": SOME}}}, "randomize: params has the key 3; give names"),
        ({"joint_q": {"arm": 0.1}}, r"joint_q of 'arm' is 0\.1; give a tightloop.Uniform or a tightloop.Normal"),
        ({"joint_q": {"arm": (0, 1)}}, r"is \(0, 1\); give a tightloop.Uniform"),
        ({"joint_q": [SOME]}, "joint_q is .*; give a dict of distributions by name"),
        ({"joint_q": {3: SOME}}, "joint_q has the key 3; give names"),
        ({"body_q": {"post": {"x": SOME}}}, "body_q of 'post': it is fixed; make it with fixed=False"),
        (
            {"body_q": {"arm": {"x": SOME}}},
            r"'arm': it does not move freely; add the robot with add_urdf\(floating=True\)",
        ),
        ({"body_q": {"dog/lead": {"x": SOME}}}, "name one of the floating joints: dog/floating_base"),
        ({"body_q": {"cube": {"vx": SOME}}}, "'cube': there is no part 'vx'; use x, y, z, roll, pitch, yaw"),
        ({"body_qd": {"cube": {"x": SOME}}}, "body_qd of 'cube': there is no part 'x'; use vx, vy, vz, wx, wy, wz"),
        ({"body_q": {"cube": SOME}}, "body_q of 'cube' is Uniform.*; give a dict"),
        ({"body_q": {"box": {"x": SOME}}}, "there is no robot or body 'box'"),
    ],
    ids=str,
)
def test_a_wrong_name_is_refused_and_nothing_changes(scene, arguments, named):
    scene.randomize(joint_q={"arm": SOME})
    before = scene.to_toml()
    with pytest.raises(tl.SceneError, match=named):
        scene.randomize(**{"joint_qd": {"dog": SOME}} | arguments)
    assert scene.to_toml() == before


def test_whatever_is_given_is_taken_or_refused_by_name(scene):
    """Every argument with everything that is no distribution, alone, under a name, and under a name in a name."""
    scene.randomize(joint_q={"arm": SOME}, params={"gravity": {"z": SOME}})
    kept = copy.deepcopy(scene._distributions)
    leaves = [None, True, 0, math.nan, "", "arm", b"arm", (), [], {}, [SOME], (SOME, SOME), tl.Uniform, object(), SOME]
    names = [
        "arm",
        "dog",
        "cube",
        "post",
        "gravity",
        "x",
        "",
        "/",
        "arm/",
        "/lead",
        "arm/lead",
        "uniform",
        "\0",
        "\ud800",
    ]
    names += [3, None, ("arm",), 2.5]
    under = [{name: leaf} for name in names for leaf in leaves]
    twice = [{name: table} for name in names for table in under]
    taken = 0
    for argument in ("joint_q", "joint_qd", "body_q", "body_qd", "params"):
        for given in [*leaves, *under, *twice]:
            try:
                scene.randomize(**{argument: given})
            except tl.SceneError as error:
                assert argument in str(error) or "randomize: " in str(error), given
                assert scene._distributions == kept, given
            else:
                taken += scene._distributions != kept
                assert tl.Scene.to_toml(scene)
                scene._distributions = copy.deepcopy(kept)
    # a distribution under each name that there is, and of parameters under any that can be written
    assert taken > 20


@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda: tl.Uniform(1, 0), "Uniform: low is 1 and high is 0; low must not be above high"),
        (lambda: tl.Uniform(math.nan, 0), "Uniform: low is nan; give a finite number"),
        (lambda: tl.Uniform(0, math.inf), "Uniform: high is inf; give a finite number"),
        (lambda: tl.Uniform(0, 1e7), r"Uniform: high is 1e\+07; give at most 1e6"),
        (lambda: tl.Uniform("a", 1), "Uniform: low is 'a'; give a number"),  # pyright: ignore[reportArgumentType]
        (lambda: tl.Normal(0, -1), "Normal: std is -1; it must be at least 0"),
        (lambda: tl.Normal(math.inf, 1), "Normal: mean is inf"),
        (lambda: tl.Normal(0, math.nan), "Normal: std is nan"),
    ],
)
def test_a_wrong_distribution_is_named(make, named):
    with pytest.raises(tl.SceneError, match=named):
        make()


def test_joints_know_their_type_and_leader(scene):
    dog = scene.robots["dog"]
    assert dog.joint_types["ball"] == "spherical" and "floating" in dog.joint_types.values()
    assert dog.joint_leaders == {"follow": "lead"}
