"""``tightloop inspect`` of MuJoCo models: what it prints, as text and as JSON, and what it refuses."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

import tightloop as tl
from conftest import REPOSITORY

HEAD = '<?xml version="1.0"?>\n' + 60 * "<!-- a comment -->\n"
ROBOT = """
<mujoco model="two joints"><option timestep="0.005" integrator="implicitfast"><flag gravity="disable"/></option>
<worldbody><geom name="floor" type="plane" size="0 0 1"/>
<body name="cart" pos="0 0 1"><joint name="x" type="slide" axis="1 0 0" range="-1 1" limited="true"/>
  <joint name="tilt" axis="0 1 0" ref="30"/>
  <geom name="chassis" type="box" size=".1 .1 .1" mass="2"/>
  <geom name="paint" size=".2" mass="0" contype="0" conaffinity="0"/><site name="top"/></body>
<body name="target" mocap="true"><geom size=".1" mass="0" contype="0" conaffinity="0"/></body></worldbody>
<equality><joint name="tied" joint1="x" joint2="tilt"/></equality>
<tendon><fixed name="both"><joint joint="x" coef="1"/><joint joint="tilt" coef="2"/></fixed></tendon>
<actuator><motor name="push" joint="x" ctrlrange="-1 1" ctrllimited="true"/>
  <position name="hold" joint="tilt" kp="5" forcerange="-2 2" forcelimited="true"/>
  <velocity tendon="both" kv="3"/></actuator>
<sensor><accelerometer name="imu" site="top"/><jointpos name="where" joint="x"/></sensor>
<keyframe><key name="home" qpos="0.5 0.1"/></keyframe></mujoco>"""
ROBOT = HEAD + ROBOT.lstrip()
REFUSED = ROBOT.replace("<actuator>", '<actuator><general name="pad" body="cart" biastype="affine" biasprm="0 0 -1"/>')


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def inspected(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    line = [sys.executable, "-m", "tightloop", "inspect", *arguments]
    return subprocess.run(line, capture_output=True, text=True, cwd=folder, check=False)


def file_of(folder: Path, text: str, name: str = "robot.xml") -> str:
    (folder / name).write_text(text)
    return name


def test_the_report_names_what_a_model_has(tmp_path):
    done = inspected(tmp_path, file_of(tmp_path, ROBOT))
    assert (done.returncode, done.stderr) == (0, "")
    rows = [" ".join(line.split()) for line in done.stdout.splitlines()]
    for row in (
        "Model two_joints",
        "File robot.xml",
        "Options step of 0.005 s, implicitfast, newton, pyramidal, no gravity",
        "Bodies 3, the world included",
        "Joints 2: 1 slide, 1 hinge",
        "Dofs 2, 2 coordinates",
        "Mass 2 kg",
        "Geoms 4: 1 plane, 1 box, 2 spheres; 2 may touch",
        "Actuators 3: 1 motor, 1 position, 1 velocity",
        "Sensors 2",
        "Tendons 1: 1 fixed",
        "Equalities 1: 1 joint",
        "Mocap 1: target",
        "Keyframes 1: home",
        "├─● cart x: prismatic along x, -1 to 1 m; tilt: continuous about y",
        "0 two_joints/x -1 1 m",
        "0 two_joints/push motor joint x -1 to 1 -",
        "1 two_joints/hold position joint tilt - -2 to 2",
        "2 two_joints/actuator2 velocity tendon both - -",
        "0 two_joints/imu accelerometer site top 0 to 2",
        "1 two_joints/where jointpos joint x 3",
        "0 two_joints/tied joint joint x, joint tilt yes",
    ):
        assert row in rows, (row, rows)


def test_json_has_the_same_facts(tmp_path):
    done = inspected(tmp_path, file_of(tmp_path, ROBOT), "--json")
    assert (done.returncode, done.stderr) == (0, "")
    all_ = json.loads(done.stdout)
    assert (all_["name"], all_["file"], all_["mass"]) == ("two_joints", "robot.xml", 2)
    assert [link["name"] for link in all_["links"]] == ["world", "cart", "target"]
    assert [joint["name"] for joint in all_["links"][1]["joints"]] == ["x", "tilt"]
    own = all_["mujoco"]
    assert own["refused"] == [] and own["keyframes"] == ["home"] and own["timestep"] == 0.005
    assert [actuator["name"] for actuator in own["actuators"]] == ["push", "hold", "actuator2"]
    assert own["actuators"][1]["force_range"] == [-2, 2]
    assert [geom["active"] for geom in own["geoms"]] == [True, True, False, False]
    assert own["sensors"][0]["on"] == ["site top"]


def test_everything_that_is_refused_is_named(tmp_path):
    legs = "".join(f'<geom name="egg{k}" size=".1" condim="1" solimp=".9 .95 .001 .5 99"/>' for k in range(9))
    path = file_of(tmp_path, REFUSED.replace('<site name="top"/>', f'<site name="top"/>{legs}'))
    done = inspected(tmp_path, path)
    assert done.returncode == 1
    for name in (*(f"geom `egg{k}`" for k in range(9)), "actuator `pad`"):
        assert name in done.stdout, name
    assert "robot.xml: 10 of its elements" in done.stderr and "remove" in done.stderr
    done = inspected(tmp_path, path, "--json")
    assert done.returncode == 1 and len(json.loads(done.stdout)["mujoco"]["refused"]) == 10
    assert not list(tmp_path.glob("*.png"))


def test_a_saved_model_is_read_without_mujoco(tmp_path):
    scene = tl.Scene.from_mujoco(tmp_path / file_of(tmp_path, ROBOT))
    scene.save(tmp_path / "scene.toml")
    done = inspected(tmp_path, "scene_models/two_joints.safetensors")
    assert done.returncode == 0 and "Model      two_joints" in done.stdout
    # a file of an older version has no name
    done = inspected(REPOSITORY, "examples/assets/cart/cart.safetensors")
    assert done.returncode == 0 and "Model      cart" in done.stdout


def test_a_picture_shows_it_at_a_position(tmp_path):
    path = file_of(tmp_path, ROBOT)
    assert inspected(tmp_path, path, "--png", "two_joints.png").returncode == 0
    assert inspected(tmp_path, path, "--joint-q", "0.5,-1", "--png", "moved.png").returncode == 0
    start, moved = ((tmp_path / name).read_bytes() for name in ("two_joints.png", "moved.png"))
    assert start.startswith(b"\x89PNG") and start != moved


def test_wrong_files_and_options_are_named(tmp_path):
    for text, arguments, code, parts in (
        ("<mujoco><worldbody><geom type='bo'/></worldbody></mujoco>", (), 1, ("robot.xml", "invalid keyword: 'bo'")),
        ("<mujoco><world", (), 1, ("robot.xml", "XML")),
        ("<mujocoinclude/>", (), 1, ("robot.xml", "Scene.from_mujoco")),
        ("<other/>", (), 1, ("robot.xml:1", "URDF")),
        (ROBOT, ("--floating",), 2, ("--floating", "robot.xml", "<freejoint/>")),
        (ROBOT, ("--joint-q", "1,2,3", "--png", "a.png"), 2, ("--joint-q", "3 values")),
        (ROBOT, ("--mesh-max-hull-vertices", "3"), 2, ("between 8 and 1024",)),
    ):
        done = inspected(tmp_path, file_of(tmp_path, text), *arguments)
        assert (done.returncode, done.stdout) == (code, ""), (arguments, done)
        assert all(part in done.stderr for part in parts), done.stderr
    done = inspected(tmp_path, file_of(tmp_path, "nothing", "robot.safetensors"))
    assert done.returncode == 1 and "robot.safetensors" in done.stderr and "no exported MuJoCo model" in done.stderr
    done = inspected(tmp_path, "gone.xml")
    assert done.returncode == 1 and "gone.xml" in done.stderr


def test_a_urdf_file_may_end_in_xml(tmp_path):
    path = file_of(tmp_path, '<robot name="r"><link name="only"/></robot>')
    done = inspected(tmp_path, path)
    assert done.returncode == 0 and done.stdout.startswith("Robot      r\n")


ARM = '<body name="arm"><joint/><geom size=".1"/></body>'
FREE = '<body name="{0}" pos="0 0 1"><freejoint/><geom size=".1" mass="1"/></body>'


@pytest.mark.parametrize(
    ("bodies", "floating", "base"),
    [
        (FREE.format("dog"), True, "floating base"),
        (FREE.format("a") + FREE.format("b"), True, "2 floating bodies"),
        (ARM, False, "fixed base"),
        (ARM + FREE.format("cube"), False, "fixed base and 1 floating body"),
    ],
)
def test_a_model_on_a_free_joint_has_a_floating_base(tmp_path, bodies, floating, base):
    text = f'<mujoco><worldbody><geom type="plane" size="0 0 1"/>{bodies}</worldbody></mujoco>'
    done = inspected(tmp_path, file_of(tmp_path, text), "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert (found["floating"], found["base"]) == (floating, base)


@pytest.mark.parametrize("seen", ["touches", "looks"])
def test_a_robot_on_a_field_fills_its_picture(tmp_path, seen):
    image = pytest.importorskip("PIL.Image")
    quiet = ' contype="0" conaffinity="0"' if seen == "looks" else ""
    text = f"""<mujoco>
    <asset><hfield name="hills" nrow="3" ncol="3" size="40 40 .1 .1" elevation="0 1 0 1 0 1 0 1 0"/></asset>
    <worldbody><geom type="hfield" hfield="hills"/><geom name="wall" type="box" pos="30 0 1" size="1 9 9"/>
    <body pos="0 0 1"><freejoint/><geom size=".2" mass="1"{quiet}/></body></worldbody></mujoco>"""
    done = inspected(tmp_path, file_of(tmp_path, text), "--png", "r.png")
    assert done.returncode == 0, done.stderr
    # the view from the side: the ball fills it up to its margins
    side = image.open(tmp_path / "r.png").convert("RGB").crop((1061, 73, 1600, 447))
    red, _, blue = side.getpixel((269 + 70, 187 - 70))
    assert blue > red + 30
