"""Properties by entries, by name and by pattern, floating bases left out, and attributes that do not exist."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

import tightloop as tl
from tightloop import env
from tightloop.env import VectorEnv
from tightloop.tasks.reach import FrankaReach

# A body with two legs of two joints each
DOG = """<robot name="dog">
  <link name="trunk"><inertial><mass value="5"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  {legs}
</robot>"""
LEG = """<link name="{side}_thigh"><inertial><mass value="1"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
  <link name="{side}_calf"><inertial><mass value="0.5"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
  <joint name="{side}_hip" type="revolute"><parent link="trunk"/><child link="{side}_thigh"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="20" velocity="10"/></joint>
  <joint name="{side}_knee" type="revolute"><parent link="{side}_thigh"/><child link="{side}_calf"/>
    <origin xyz="0 0 -0.2"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="20" velocity="10"/></joint>"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "dog.urdf"
    path.write_text(DOG.format(legs="".join(LEG.format(side=side) for side in ("left", "right"))))
    return path


@pytest.fixture
def scene(file) -> tl.Scene:
    scene = tl.Scene(gravity=(0, 0, 0))
    scene.add_urdf(file, name="dog", pos=(0, 0, 0.5), floating=True)
    return scene


@pytest.fixture
def dog(scene) -> tl.Robot:
    return scene.robots["dog"]


JOINTS = ["left_hip", "left_knee", "right_hip", "right_knee"]


def test_entries_of_a_property_are_assigned(dog):
    dog.joint_q[7:] = [0.1, 0.2, 0.3, 0.4]
    dog.joint_q[7] = 0.5
    dog.joint_q[8:10] += 1.0
    dog.joint_q[[10]] -= 0.1
    part = dog.joint_q[7:9]
    part[0] = 0.6
    np.testing.assert_allclose(dog.joint_q[7:], [0.6, 1.2, 1.3, 0.3])
    dog.joint_target_ke[6:] = 100
    dog.joint_target_ke *= 2
    assert dog.joint_target_ke.tolist() == [0] * 6 + [200] * 4
    assert dog.table()["joint_target_ke"] == [0] * 6 + [200] * 4


def test_arrays_that_are_held_at_once_keep_each_others_entries(dog):
    held, other = dog.joint_q, dog.joint_q
    held[7] = 0.1
    other[8] = 0.2
    part = held[9:]
    dog.joint_q[10] = 0.3
    part[0] = 0.4
    dog.joint_q[7] = 0.5
    other += 1.0
    np.testing.assert_allclose(dog.joint_q[7:], [1.5, 1.2, 1.4, 1.3])
    other[7:] = other[:6:-1]
    np.testing.assert_allclose(dog.joint_q[7:], [1.3, 1.4, 1.2, 1.5])


def test_what_a_property_is_computed_to_is_a_plain_array(dog):
    doubled = 2 * dog.joint_target_ke
    assert type(doubled) is np.ndarray and doubled.flags.writeable
    assert isinstance(dog.joint_q.sum(), float)
    copied = dog.joint_q.copy()
    copied[7] = 0.25
    assert dog.joint_q[7] == 0.0
    assert type(pickle.loads(pickle.dumps(dog.joint_q))) is np.ndarray
    with pytest.raises(ValueError, match="read-only"):
        np.copyto(dog.joint_q, 0.0)


@pytest.mark.parametrize(
    ("key", "value", "named"),
    [
        (99, 1.0, r"joint_q cannot be assigned at \[99\]: .*out of bounds"),
        (slice(7, None), [1.0, 2.0], r"joint_q cannot be assigned at \[7:\]: "),
        (7, "text", r"joint_q cannot be assigned at \[7\]: "),
        (7, np.nan, r"joint_q of coordinate `dog/left_hip` is nan"),
    ],
)
def test_a_wrong_entry_is_refused_and_changes_nothing(dog, key, value, named):
    before = np.array(dog.joint_q)
    with pytest.raises(tl.SceneError, match=named):
        dog.joint_q[key] = value
    assert np.array_equal(dog.joint_q, before)


def test_a_floating_base_may_be_left_out(scene, dog: tl.Robot):
    dog.joint_q = [0.1, 0.2, 0.3, 0.4]
    dog.pos = (1, 2, 3)
    assert dog.joint_q.tolist() == [1, 2, 3, 0, 0, 0, 1, 0.1, 0.2, 0.3, 0.4]
    dog.joint_target_ke = [10, 20, 30, 40]
    assert dog.joint_target_ke.tolist() == [0] * 6 + [10, 20, 30, 40]
    dog.joint_effort_limit = 5
    dog.joint_q = 0.1
    assert dog.joint_q.tolist() == [1, 2, 3, 0, 0, 0, 1, 0.1, 0.1, 0.1, 0.1]
    assert dog.joint_target_q.tolist() == [0] * 6 + [0.1] * 4
    dog.joint_target_mode = ["position", "velocity", "position", "both"]
    assert dog.joint_target_mode[6:] == ("position", "velocity", "position", "both")
    with pytest.raises(tl.SceneError, match=r"has 3 values; expected 11.*or 4 without those of the floating base"):
        dog.joint_q = [1, 2, 3]
    with tl.launch(scene, worlds=1) as sim:
        np.testing.assert_allclose(sim.forward().joint_q[0], [1, 2, 3, 0, 0, 0, 1, 0.1, 0.1, 0.1, 0.1], atol=1e-6)


def test_a_base_that_was_set_stays_where_it_was_set(dog: tl.Robot):
    dog.joint_q = [9, 9, 9, 0, 0, 0, 1, 0, 0, 0, 0]
    dog.pos = (1, 2, 3)
    assert dog.joint_q[:3].tolist() == [9, 9, 9]


def test_names_and_patterns(dog: tl.Robot):
    dog.joint_q = {".*_hip": 0.1, "left_knee": 0.4}
    assert dog.joint_q[7:].tolist() == [0.1, 0.4, 0.1, 0.0]
    dog.joint_q = {".*_knee": -0.2, "right_knee": 0.3}  # a name counts, whatever the order
    assert dog.joint_q[7:].tolist() == [0.1, -0.2, 0.1, 0.3]
    dog.joint_target_mode = {"left_.*": "both"}
    assert dog.joint_target_mode[6:] == ("both", "both", "position", "position")
    dog.joint_effort_limit = {".*": np.inf, "left_hip": 3.0}
    assert dog.joint_effort_limit[6] == 3.0
    dog.joint_target_ke = {".*": 50.0}  # patterns pass over the floating base
    assert dog.joint_target_ke.tolist() == [0] * 6 + [50] * 4
    np.add(dog.joint_target_ke, 1.0, out=dog.joint_target_ke, where=np.arange(10) > 8)
    assert dog.joint_target_ke.tolist() == [0] * 6 + [50, 50, 50, 51]
    with pytest.raises(
        tl.SceneError, match=r"has the key 'left_hpi', which no coordinate matches; did you mean `left_hip`"
    ):
        dog.joint_q = {"left_hpi": 0.1}
    with pytest.raises(tl.SceneError, match=r"of coordinate `left_hip` has two values, by '.*_hip' and 'left_.*'"):
        dog.joint_q = {".*_hip": 0.1, "left_.*": 0.2}


def test_a_scene_file_keeps_what_was_set_without_the_base(scene, dog: tl.Robot, tmp_path):
    dog.joint_q = {".*_hip": 0.1}
    scene.save(tmp_path / "scene.toml")
    loaded = tl.Scene.load(tmp_path / "scene.toml").robots["dog"]
    assert np.array_equal(loaded.joint_q, dog.joint_q)
    assert np.array_equal(tl.Scene.from_toml(scene.to_toml()).robots["dog"].joint_q, dog.joint_q)


def test_commands_may_leave_the_base_out(scene, dog):
    dog.joint_target_ke, dog.joint_target_kd = 50, 5
    targets = np.array([[0.1, 0.2, 0.3, 0.4], [0.4, 0.3, 0.2, 0.1]])
    with tl.launch(scene, worlds=2, fields=("joint_q", "joint_target_q", "joint_f")) as sim:
        frame = sim.step(joint_target_q={"dog": targets}, joint_f={"dog": targets.tolist()})
        np.testing.assert_allclose(frame.joint_target_q[:, 6:], targets, rtol=1e-6)
        np.testing.assert_allclose(frame.joint_f[:, 6:], targets, rtol=1e-6)
        assert not frame.joint_f[:, :6].any()
        frame = sim.write(joint_q={"dog": targets[0]})
        np.testing.assert_allclose(frame.joint_q[:, 7:], [targets[0]] * 2, rtol=1e-6)
        with pytest.raises(
            tl.CommandRefused, match=r"of robot `dog`: .*4 without the 6 of its floating base; got \(5,\)"
        ):
            sim.step(joint_target_q={"dog": np.zeros(5)})
        with pytest.raises(tl.CommandRefused, match=r"got \(4,\)\. Robot `dog` has as many: give \{\"dog\": …\}"):
            sim.step(joint_target_q=targets[0])
        frame = sim.step(joint_target_q={"dog": {"left_hip": 0.9}})
        np.testing.assert_allclose(frame.joint_target_q[:, 6:], [[0.9, *row[1:]] for row in targets], rtol=1e-6)


def test_the_robot_with_as_many_dofs_is_named(scene):
    scene.add_cube()
    with (
        tl.launch(scene, worlds=2) as sim,
        pytest.raises(tl.CommandRefused, match=r"got \(2, 10\)\. Robot `dog`.*\{\"dog\": …\}"),
    ):
        sim.step(joint_f=np.zeros((2, 10)))


def test_entries_of_parameters_and_frames(scene):
    with tl.launch(scene, worlds=3, params=("gravity", "joint_damping")) as sim:
        sim.params.gravity[1, 2] = -5.0
        sim.params.joint_damping[0] += 2.0
        assert sim.params.gravity[:, 2].tolist() == [0, -5, 0]
        assert sim.params.joint_damping[0].tolist()[6:] == [2] * 4
        held, other = sim.params.gravity, sim.params.gravity
        held[0, 0], other[0, 1] = 1.0, 2.0
        assert sim.params.gravity[0].tolist() == [1, 2, 0]
        with pytest.raises(tl.CommandRefused, match=r"params.gravity cannot be assigned at \[5, 0\]"):
            sim.params.gravity[5, 0] = 1.0
        frame = sim.forward()
        with pytest.raises(tl.CommandRefused, match=r"read-only.*sim\.write\(joint_q=.*copy"):
            frame.joint_q[0, 0] = 1.0
        with pytest.raises(tl.CommandRefused, match="read-only"):
            frame.joint_q += 1.0
        with pytest.raises(tl.CommandRefused, match=r"read-only.*copy"):
            frame.status |= 1
        with pytest.raises(tl.CommandRefused, match=r"`joint_q` of a frame is read-only.*sim\.write"):
            frame.joint_q = 1.0  # type: ignore[misc]
        with pytest.raises(tl.CommandRefused, match=r"no entries, such as 'joint_q'.*frame\.joint_q\[world\]"):
            frame["joint_q"]  # type: ignore[index]
        own = frame.joint_q.copy()
        own[0, 0] = 1.0
        own += 1.0
        assert type(frame.joint_q + 1) is np.ndarray and isinstance(frame.time.sum(), np.floating)


@pytest.mark.parametrize(
    ("get", "name", "meant"),
    [
        (lambda sim, scene: scene.robots["dog"], "stiffness", "joint_target_ke"),
        (lambda sim, scene: scene.robots["dog"], "joint_taget_q", "joint_target_q"),
        (lambda sim, scene: scene.robots["dog"], "position", "pos"),
        (lambda sim, scene: scene.bodies["cube"], "rotation", "quat"),
        (lambda sim, scene: scene.bodies["cube"], "massa", "mass"),
        (lambda sim, scene: scene, "timestep", "dt"),
        (lambda sim, scene: scene, "gravty", "gravity"),
        (lambda sim, scene: sim, "num_envs", "worlds"),
        (lambda sim, scene: sim.params, "mu", "shape_mu"),
    ],
)
def test_an_attribute_that_does_not_exist_suggests_another(scene, get, name, meant):
    scene.add_cube()
    with tl.launch(scene, worlds=1) as sim:
        thing = get(sim, scene)
        for use in (lambda: getattr(thing, name), lambda: setattr(thing, name, 1.0)):
            with pytest.raises(AttributeError, match=f"{name}.*`{meant}`") as found:
                use()
            assert isinstance(found.value, tl.TightloopError)


def test_an_argument_that_does_not_exist_suggests_another(scene, file):
    with pytest.raises(TypeError, match="there is no argument `fixed_base`; did you mean `floating`"):
        scene.add_urdf(file, fixed_base=False)
    with pytest.raises(TypeError, match="there is no argument `rpy`; did you mean `quat`"):
        scene.add_urdf(file, rpy=(0, 0, 1))


def test_what_can_only_be_read_reports_it(scene, dog):
    with pytest.raises(
        tl.UnknownAttribute, match=r"robot `dog`: `floating` can only be read; it is an argument of add_urdf"
    ):
        dog.floating = False
    with tl.launch(scene, worlds=1) as sim:
        with pytest.raises(tl.UnknownAttribute, match=r"`dt` can only be read; .*launch"):
            sim.dt = 0.1
        with pytest.raises(tl.UnknownAttribute, match=r"sim.forward\(\).joint_q"):
            _ = sim.joint_q
        with pytest.raises(tl.ArgumentError, match=r"cannot be copied or pickled.*tightloop.attach"):
            pickle.dumps(sim)
        assert not hasattr(sim, "nothing_like_it")
    with pytest.raises(tl.UnknownAttribute, match="did you mean `launch`"):
        _ = tl.lauch  # pyright: ignore[reportAttributeAccessIssue]


def test_a_viewer_after_the_end_or_without_its_library_says_why(scene, monkeypatch, tmp_path):
    sim = tl.launch(scene, worlds=1)
    missing = tmp_path / "viser"
    missing.mkdir()
    (missing / "__init__.py").write_text("raise ModuleNotFoundError('there is no viser', name='viser')")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    with pytest.raises(tl.MissingLibrary, match=r"view: the viewer needs `viser`: run `pip install"):
        sim.view()
    with pytest.raises(tl.ArgumentError, match="view: port is 0"):
        sim.view(port=0)
    sim.close()
    with pytest.raises(tl.SimClosed, match="view: the simulation was closed"):
        sim.view()


def test_environments_take_the_name_of_gymnasiums_registry():
    envs = VectorEnv("tightloop/CartPoleBalance-v0", 1)
    envs.close()


def test_dofs_in_another_order(scene, dog):
    order = dog.order(["right_knee", "left_knee", "right_hip", "left_hip"])
    dog.joint_q = {"left_hip": 0.1, "left_knee": 0.2, "right_hip": 0.3, "right_knee": 0.4}
    with tl.launch(scene, worlds=2, fields=("joint_q", "joint_qd", "joint_target_q")) as sim:
        frame = sim.forward()
        read = order.read(frame.joint_q[:, sim.coords["dog"]])
        np.testing.assert_allclose(read, [[0.4, 0.2, 0.3, 0.1]] * 2, rtol=1e-6)
        assert order.read(frame.joint_qd[:, sim.dofs["dog"]]).shape == (2, 4)
        frame = sim.step(joint_target_q={"dog": order.write(read)})
        np.testing.assert_allclose(frame.joint_target_q[0, 6:], [0.1, 0.2, 0.3, 0.4], rtol=1e-6)
    with pytest.raises(tl.SceneError, match=r"order: names lacks 'left_knee', 'right_hip', 'right_knee'"):
        dog.order(["left_hip"])


@pytest.mark.parametrize("control", ["JointTarget", "JointDelta", "JointTorque"])
def test_controls_take_dofs_in_any_order(control):
    """The same motion, whatever the order of the action."""

    def episode(order: list[int]) -> np.ndarray:
        class Ordered(FrankaReach):
            def controls(self):
                dofs = [f"arm/fr3_joint{joint + 1}" for joint in order]
                return [getattr(env, control)(dofs, 0.1)]

        envs = VectorEnv(Ordered, 3, device="cpu")
        try:
            envs.reset(seed=4)
            actions = np.random.default_rng(1).uniform(-1, 1, (8, 3, 7))
            for action in actions:
                envs.step(action[:, order])
            return envs.frame.joint_q.copy()
        finally:
            envs.close()

    np.testing.assert_array_equal(episode([*range(7)]), episode([3, 1, 4, 0, 6, 5, 2]))


def test_files_that_come_with_the_package():
    assert tl.assets.FR3.is_file() and tl.assets.CARTPOLE.is_file()
    assert set(tl.assets.POLICIES) >= {"CartPoleSwingUp", "FrankaReach", "FrankaPickCube"}
    with pytest.raises(tl.ArgumentError, match="did you mean `FrankaReach`"):
        tl.assets.policy("FrankaReech")
    envs = VectorEnv("CartPoleSwingUp", 16)
    try:
        policy = tl.assets.policy("CartPoleSwingUp")
        obs, infos = envs.reset(seed=1)
        for _ in range(400):
            obs, _, _, _, infos = envs.step(policy(obs))
        assert infos["success"].mean() > 0.8
    finally:
        envs.close()
