"""Commands and states by the names of single joints and by patterns; what is not named keeps its last value."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import tightloop as tl
from conftest import REPOSITORY, URDF

FIELDS = ("joint_q", "joint_qd", "joint_target_q", "joint_target_qd", "joint_f")


@pytest.fixture
def sim() -> Iterator[tl.Sim]:
    scene = tl.Scene()
    arm = scene.add_urdf(URDF, name="arm")
    arm.joint_q = [0, 0, 0, -2.4, 0, 2.4, 0.8, 0.04, 0.04]
    arm.joint_target_ke, arm.joint_target_kd = 100.0, 10.0
    scene.add_cube(pos=(1, 0, 1))
    with tl.launch(scene, worlds=3, fields=FIELDS) as made:
        made.reset()
        yield made


def test_a_joint_by_name_and_the_others_keep_their_targets(sim):
    start = sim.forward().joint_target_q[:, :9].copy()
    frame = sim.step(joint_target_q={"arm/fr3_joint4": -2.0})
    expected = start.copy()
    expected[:, 3] = -2.0
    assert np.array_equal(frame.joint_target_q[:, :9], expected)
    frame = sim.step(joint_target_q={"arm": {"fr3_joint2": [0.1, 0.2, 0.3]}})
    expected[:, 1] = [0.1, 0.2, 0.3]
    assert np.array_equal(frame.joint_target_q[:, :9], expected)
    assert np.array_equal(sim.step().joint_target_q[:, :9], expected)


def test_patterns_count_less_than_names_and_more_than_whole_robots(sim):
    targets = {"arm": np.full((3, 9), 0.01), "arm/fr3_joint[2-4]": -0.5, "arm/fr3_joint3": [[0.1], [0.2], [0.3]]}
    frame = sim.step(joint_target_q=targets)
    expected = np.full((3, 9), 0.01, np.float32)
    expected[:, [1, 3]] = -0.5
    expected[:, 2] = [0.1, 0.2, 0.3]
    assert np.array_equal(frame.joint_target_q[:, :9], expected)


def test_names_and_arrays_give_the_same_bits(sim):
    torques = np.zeros((3, 15))
    torques[:, [0, 5, 9]] = 2.0, -1.0, 0.5
    kept = sim.snapshot()
    by_array = sim.step(joint_f=torques).copy()
    sim.restore(kept)
    by_name = sim.step(joint_f={"arm": {"fr3_joint1": 2.0, "fr3_joint6": -1.0}, "cube/free.vx": np.float32(0.5)})
    for field in FIELDS:
        assert np.array_equal(getattr(by_array, field), getattr(by_name, field)), field


def test_states_are_written_by_name(sim):
    before = sim.forward().joint_q.copy()
    frame = sim.write(
        joint_q={"arm/fr3_joint1": 0.5, "cube/free.x": [1.0, 2.0, 3.0]},
        joint_qd={"arm/fr3_finger_.*": 0.01},
        mask=[True, False, True],
    )
    expected = before.copy()
    expected[[0, 2], 0] = 0.5
    expected[[0, 2], 9] = [1.0, 3.0]
    assert np.array_equal(frame.joint_q, expected)
    fingers = [place for place, name in enumerate(sim.dof_names) if "finger" in name]
    assert np.array_equal(frame.joint_qd[:, fingers] != 0, np.array([[1, 1], [0, 0], [1, 1]], bool))


def test_a_whole_quaternion_is_written_by_its_parts(sim):
    frame = sim.write(joint_q={"cube": {"free.qx": 0, "free.qy": 0, "free.qz": 1, "free.qw": 0}})
    assert np.array_equal(frame.joint_q[:, 12:], np.tile([0, 0, 1, 0], (3, 1)))


def test_a_pattern_leaves_a_floating_base_out():
    scene = tl.Scene(gravity=(0, 0, 0))
    scene.add_urdf(URDF, name="arm", floating=True, pos=(0, 0, 1))
    with tl.launch(scene, worlds=1, fields=("joint_f",)) as sim:
        frame = sim.step(joint_f={"arm": {".*": 0.25}})
        assert frame.joint_f[0, :6].tolist() == [0.0] * 6 and frame.joint_f[0, 6:].tolist() == [0.25] * 9


def test_actuators_of_a_mujoco_model_by_name():
    pytest.importorskip("mujoco")
    scene = tl.Scene.from_mujoco(REPOSITORY / "examples/assets/cart/cart.xml", name="cart")
    with tl.launch(scene, worlds=2, fields=("ctrl",)) as sim:
        name = sim.actuator_names[0]
        assert sim.step(ctrl={name: [0.25, -0.5]}).ctrl[:, 0].tolist() == [0.25, -0.5]


def test_forces_by_body_robot_and_pattern_are_those_of_an_array(tmp_path):
    scene = tl.Scene(gravity=(0, 0, 0))
    scene.add_urdf(URDF, name="arm")
    scene.add_cube(pos=(1, 0, 1), name="cube")
    force = {"arm/fr3_hand": (0, 0, -5, 0, 0, 1), "cube": np.arange(18.0).reshape(3, 6), "arm/fr3_link[34]": [1.0] * 6}
    with tl.launch(scene, worlds=3, params=("body_f",), fields=FIELDS, precision="f64") as sim:
        array = np.zeros((3, len(sim.body_names), 6))
        array[:, sim.body_names.index("arm/fr3_hand")] = force["arm/fr3_hand"]
        array[:, sim.bodies["cube"]] = force["cube"][:, None]
        for link in (3, 4):
            array[:, sim.body_names.index(f"arm/fr3_link{link}")] = 1.0
        kept = sim.snapshot()
        expected = sim.step(body_f=array).copy()
        assert np.abs(expected.joint_qd).max() > 0.0
        sim.restore(kept)
        found = sim.step(body_f=force).copy()
        np.testing.assert_array_equal(found.joint_q, expected.joint_q)
        np.testing.assert_array_equal(sim.params.body_f, array)
        # bodies that are not named keep their force
        array[:, sim.bodies["arm"]] = 0.0
        array[:, sim.body_names.index("arm/fr3_hand"), 2] = 7.0
        sim.send(body_f={"arm": np.zeros((sim.bodies["arm"].stop, 6)), "arm/fr3_hand": (0, 0, 7, 0, 0, 0)})
        sim.recv()
        np.testing.assert_array_equal(sim.params.body_f, array)
        named: Any = {"cube": [1, 2, 3, 4, 5, 6], "arm": {"fr3_link1": np.ones((3, 6))}}
        sim.params.body_f = named
        array[:, sim.bodies["cube"]] = [1, 2, 3, 4, 5, 6]
        array[:, sim.body_names.index("arm/fr3_link1")] = 1.0
        np.testing.assert_array_equal(sim.params.body_f, array)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"arm/fr3_hnad": [0.0] * 6}, r"key 'arm/fr3_hnad', which nothing matches; did you mean `arm/fr3_hand`"),
        ({"hand": [0.0] * 6}, r"no robot `hand`; .*Bodies are named with it, such as 'cube/body'"),
        (
            {"arm/fr3_hand": [0.0] * 3},
            r"`arm/fr3_hand`: expected shape \(6,\) for all worlds, or \(3, 6\).*\(3,\)",
        ),
        ({"arm": [0.0] * 6}, r"body_f of `arm`: expected shape \(\d+, 6\)"),
        ({3: [0.0] * 6}, r"key 3; give names of robots or of bodies"),
        ({"arm/fr3_hand": {"x": 1}}, r"give 6 numbers"),
        ({"arm/fr3_hand": [np.nan] * 6}, r"body_f"),
    ],
    ids=str,
)
def test_forces_that_fit_no_body_are_refused_by_name(given, words):
    scene = tl.Scene()
    scene.add_urdf(URDF, name="arm")
    scene.add_cube(pos=(1, 0, 1), name="cube")
    with tl.launch(scene, worlds=3, params=("body_f",)) as sim:
        with pytest.raises(tl.CommandRefused, match=words):
            sim.step(body_f=given)
        assert not sim.params.body_f.any()


def test_forces_by_name_need_the_parameter(sim):
    with pytest.raises(tl.ConstantParameter, match=r"params=\(\"body_f\",\)"):
        sim.step(body_f={"arm/fr3_hand": [0.0] * 6})
