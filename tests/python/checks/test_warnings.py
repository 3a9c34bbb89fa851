"""What is valid in a scene and most likely a mistake: reported at launch, once, with the cure."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tightloop as tl

HINGE = """<robot name="hinge">
  <link name="base"><inertial><mass value="1"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <link name="arm"><inertial><mass value="1"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>
    <collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
    <limit lower="-2.5" upper="2.5" effort="{effort}" velocity="1"/></joint>
</robot>
"""


@pytest.fixture
def hinge(tmp_path: Path) -> tl.Robot:
    return robot(tl.Scene(), tmp_path)


def robot(scene: tl.Scene, folder: Path, effort: str = "10", **options: Any) -> tl.Robot:
    path = folder / "hinge.urdf"
    path.write_text(HINGE.format(effort=effort))
    return scene.add_urdf(path, **options)


def told(scene: tl.Scene, **options: Any) -> list[str]:
    """Launch a scene, and return what it warns of."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        tl.launch(scene, worlds=1, **options).close()
    assert all(warning.filename == __file__ for warning in caught), "not at the caller's line"
    return [str(warning.message) for warning in caught]


def test_a_scene_without_traps_is_not_warned_of(tmp_path):
    scene = tl.Scene()
    scene.add_ground()
    hinge = robot(scene, tmp_path, floating=True)
    hinge.joint_target_ke, hinge.joint_target_kd, hinge.joint_target_q = 5.0, 0.5, 0.4
    hinge.joint_q = [0, 0, 0.5, 0, 0, 0, 1, 0.3]
    scene.add_cube(pos=(1, 0, 0.025))
    scene.randomize(params={"shape_mu": {"ground": tl.Uniform(0.5, 1.5)}})
    assert told(scene) == []


def test_a_long_time_step():
    scene = tl.Scene(dt=0.1)
    scene.add_cube()
    [warning] = told(scene)
    assert "dt is 0.1 s" in warning and "0.001 to 0.01" in warning


def test_a_start_in_degrees(tmp_path):
    scene = tl.Scene()
    robot(scene, tmp_path).joint_q = 132
    [warning] = told(scene)
    assert "`hinge`" in warning and "`turn` at 132" in warning and "np.radians" in warning


def test_a_start_outside_of_limits(tmp_path):
    scene = tl.Scene()
    robot(scene, tmp_path).joint_q = -3
    [warning] = told(scene)
    assert "`turn` at -3" in warning and "-2.5" in warning and "np.radians" not in warning


@pytest.mark.parametrize("what", ["shape", "body", "robot", "floating", "joint_q"])
def test_an_identity_with_w_first(tmp_path, what):
    scene, turned = tl.Scene(gravity=(0, 0, 0)), (1, 0, 0, 0)
    if what == "shape":
        scene.add_box(half_extents=(1, 1, 1), quat=turned, name="wall")
        scene.add_body(fixed=True)
    elif what == "body":
        scene.add_cube(quat=turned, name="wall")
    else:
        path = tmp_path / "hinge.urdf"
        path.write_text(HINGE.format(effort=1))
        arm = scene.add_urdf(
            path, name="wall", floating=what != "robot", quat=turned if what != "joint_q" else (0, 0, 0, 1)
        )
        if what == "joint_q":
            arm.joint_q = [0, 0, 0, *turned, 0]
    [warning] = told(scene)
    assert "`wall`" in warning and "(0, 0, 0, 1) for no turn" in warning


def test_the_half_turn_itself_has_a_spelling():
    scene = tl.Scene()
    scene.add_cube(quat=(-1, 0, 0, 0))
    assert told(scene) == []


def test_drives_that_may_not_push(tmp_path):
    scene = tl.Scene()
    robot(scene, tmp_path, effort="0").joint_target_ke = 10
    [warning] = told(scene)
    assert "`turn`" in warning and "joint_effort_limit" in warning
    assert told(scene, params=("joint_effort_limit",)) == [], "clients may set one"


def test_targets_without_gains(tmp_path):
    scene = tl.Scene()
    robot(scene, tmp_path).joint_target_q = 1
    [warning] = told(scene)
    assert "`turn`" in warning and "joint_target_ke" in warning
    assert told(scene, params=("joint_target_ke",)) == []


def test_targets_of_a_step_that_nothing_follows_are_reported_once(tmp_path):
    scene = tl.Scene()
    robot(scene, tmp_path)
    with tl.launch(scene, worlds=2) as sim:
        with pytest.warns(
            tl.TightloopWarning, match="joint_target_q has no effect.*`hinge`.*joint_target_ke"
        ) as caught:
            sim.step(joint_target_q=np.ones((2, 1)))
        assert caught[0].filename == __file__
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            sim.step(joint_target_q=np.ones((2, 1)))
            sim.step(joint_f=np.ones((2, 1)))


def test_velocity_targets_of_a_drive_that_holds_positions(tmp_path):
    scene = tl.Scene()
    robot(scene, tmp_path).joint_target_ke = 5.0
    scene.robots["hinge"].joint_target_kd = 0.5
    with tl.launch(scene, worlds=1) as sim:
        with pytest.warns(tl.TightloopWarning, match="joint_target_qd has no effect.*joint_target_mode"):
            sim.step(joint_target_qd=[1.0])
        assert sim.step(joint_target_q=[1.0]).step[0] == 2


def test_a_warning_that_is_an_error_leaves_the_simulation_usable(tmp_path):
    scene = tl.Scene()
    robot(scene, tmp_path)
    with tl.launch(scene, worlds=1) as sim, warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(tl.TightloopWarning):
            sim.step(joint_target_qd={"hinge": [1.0]})
        assert sim.step(joint_f=[1.0]).step[0] == 1


def test_a_warning_at_launch_that_is_an_error_leaves_no_daemon():
    scene = tl.Scene(dt=0.5)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(tl.TightloopWarning, match=r"dt is 0\.5 s"):
            tl.launch(scene, worlds=1, name="left-behind")
    with pytest.raises(tl.UnknownDaemon):
        tl.attach("left-behind")


def test_a_robot_that_starts_inside_of_the_ground(tmp_path):
    scene = tl.Scene()
    scene.add_ground()
    robot(scene, tmp_path, floating=True)
    [warning] = told(scene)
    assert "`hinge/arm/0` is 0.10 m deep in `ground`" in warning and "pos=" in warning
    scene.filter_contacts("ground", "hinge")
    assert told(scene) == []


def test_several_pairs_are_named_deepest_first():
    scene = tl.Scene()
    scene.add_ground()
    for k in range(6):
        scene.add_cube(pos=(k, 0, 0.024 - 0.01 * k), name=f"c{k}")
    [warning] = told(scene)
    names = ("c5", "c4", "c3", "2 more pairs")
    assert sorted(names, key=warning.index) == list(names), warning


@pytest.mark.parametrize("drawn", [tl.Uniform(0.01, 0.02), tl.Normal(0.2, 0.05)])
def test_friction_that_is_drawn_and_never_counts(drawn):
    scene = tl.Scene()
    scene.add_ground()
    scene.add_cube(pos=(0, 0, 0.025))
    scene.randomize(params={"shape_mu": {"ground": drawn}})
    [warning] = told(scene)
    assert "`ground`" in warning and "`cube/box` with 1" in warning and 'friction_combine="min"' in warning
    scene.friction_combine = "min"
    assert told(scene) == []


def test_friction_that_is_drawn_above_the_smaller_one():
    scene = tl.Scene(friction_combine="min")
    scene.add_ground(mu=0.5)
    scene.add_cube(pos=(0, 0, 0.025))
    scene.randomize(params={"shape_mu": {"cube": tl.Uniform(0.6, 1.0)}})
    [warning] = told(scene)
    assert "`cube/box`" in warning and "the smaller coefficient counts" in warning and "`ground` with 0.5" in warning


def test_friction_that_both_draw_counts():
    scene = tl.Scene()
    scene.add_ground()
    scene.add_cube(pos=(0, 0, 0.025))
    scene.randomize(params={"shape_mu": {"ground": tl.Uniform(0.1, 0.2), "cube": tl.Uniform(0.1, 0.2)}})
    assert told(scene) == []


@pytest.mark.parametrize(
    ("drawn", "said"),
    [
        ({"params": {"gravity": {"z": tl.Uniform(9.0, 10.0)}}}, "gravity of `z` is 9 or more, which points up"),
        (
            {"body_q": {"cube": {"yaw": tl.Uniform(-180, 180)}}},
            "body `cube`: a reset moves .* by up to 180.*np.radians",
        ),
        ({"joint_q": {"hinge/turn": tl.Uniform(-90, 90)}}, "robot `hinge`: a reset moves `turn` by up to 90"),
        (
            {"params": {"joint_q_noise": {"hinge": tl.Uniform(0, 5)}}},
            "joint_q_noise of `hinge` of up to 5 looks like deg",
        ),
        ({"params": {"body_mass_scale": {"cube": tl.Normal(1, 0.6)}}}, "body_mass_scale of `cube` is often 0.001"),
        ({"params": {"body_mass": {"cube": tl.Normal(0.1, 0.1)}}}, "body_mass of `cube` is often 0, since draws below"),
    ],
)
def test_what_a_reset_draws_is_checked_as_the_scene_is(tmp_path, drawn, said):
    scene = tl.Scene()
    scene.add_ground()
    robot(scene, tmp_path).pos = (1, 0, 1)
    scene.add_cube(pos=(0, 0, 0.025))
    usual = {"gravity": {"z": tl.Normal(-9.81, 0.1)}, "body_mass": {"cube": tl.Normal(0.06, 0.01)}}
    scene.randomize(
        joint_q={"hinge": tl.Uniform(-3, 3)},
        body_q={"cube": {"x": tl.Uniform(-20, 20), "yaw": tl.Uniform(-np.pi, np.pi)}},
        params={
            **usual,
            "joint_q_noise": {"hinge": tl.Uniform(0, 0.1)},
            "body_mass_scale": {"cube": tl.Uniform(0.5, 2)},
        },
    )
    assert told(scene) == []
    scene.randomize(**drawn)
    [warning] = told(scene)
    assert re.search(said, warning), warning


def test_a_scene_without_anything_that_moves():
    scene = tl.Scene()
    scene.add_ground()
    [warning] = told(scene)
    assert "no robot and no body" in warning and "add_urdf" in warning


def test_a_body_that_turns_faster_than_anything_faults_by_itself():
    scene = tl.Scene(gravity=(0, 0, 0))
    scene.add_cube()
    push = np.zeros((3, 6))
    push[1, 3:] = 300.0
    with tl.launch(scene, worlds=3) as sim:
        with pytest.warns(tl.TightloopWarning, match="1 world of 3 faulted"):
            frame = sim.step(joint_f=push)
        assert frame.status.tolist() == [0, 8, 0] and np.abs(frame.joint_qd).max() == 0
    with tl.launch(scene, worlds=3, bounds={"joint_qd": np.inf}) as sim:
        frame = sim.step(joint_f=push)
        assert frame.status[1] == 0 and np.abs(frame.joint_qd).max() > 1e5
