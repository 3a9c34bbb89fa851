"""Bad input: an exception that names the culprit and the cure, and a daemon that goes on serving."""

from __future__ import annotations

import numpy as np
import pytest

import tightloop as tl

URDF = """<robot name="r"><link name="a"/><link name="b">{inertial}</link><link name="c">{good}</link>
<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="{axis}"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/>{mimic_j}</joint>
<joint name="k" type="revolute"><parent link="a"/><child link="c"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/>{mimic_k}</joint></robot>"""
GOOD = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
BAD = GOOD.replace('ixx="1"', 'ixx="-1"')


def urdf(path, *, inertial=GOOD, axis="0 0 1", mimic_j="", mimic_k=""):
    path.write_text(URDF.format(inertial=inertial, good=GOOD, axis=axis, mimic_j=mimic_j, mimic_k=mimic_k))
    return path


def test_a_missing_urdf_names_its_path(tmp_path):
    with pytest.raises(tl.UrdfError, match=r"nowhere\.urdf"):
        tl.Scene().add_urdf(tmp_path / "nowhere.urdf")


def test_broken_xml_names_file_and_place(tmp_path):
    path = tmp_path / "broken.urdf"
    path.write_text("<robot name='r'><link name='a'></robot>")
    with pytest.raises(tl.UrdfError, match=r"broken\.urdf"):
        tl.Scene().add_urdf(path)


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"axis": "0 0 0"}, r"`j`.*axis"),
        ({"inertial": BAD}, r"`b`.*inertia"),
        ({"mimic_j": '<mimic joint="nobody"/>'}, r"`j`.*`nobody`"),
        ({"mimic_j": '<mimic joint="k"/>', "mimic_k": '<mimic joint="j"/>'}, r"`j`.*circle|circle.*`j`"),
        ({"inertial": GOOD.replace('mass value="1"', 'mass value="nan"')}, r"mass.*`b`.*nan"),
    ],
    ids=["zero axis", "bad inertia", "unknown mimic", "cyclic mimic", "mass not a number"],
)
def test_a_wrong_urdf_names_the_part(tmp_path, wrong, named):
    with pytest.raises(tl.UrdfError, match=named):
        tl.Scene().add_urdf(urdf(tmp_path / "wrong.urdf", **wrong))


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"device": "tpu"}, r'device "tpu".*auto, cpu or gpu'),
        ({"precision": "f16"}, r'precision "f16".*f32 or f64'),
        (
            {"fields": ("joint_q", "joint_p")},
            r"fields has 'joint_p', and there is no such field; did you mean `joint_q`",
        ),
        ({"fields": "joint_q"}, r"\('joint_q',\)"),
        ({"worlds": 0}, r"worlds is 0.*at least 1"),
        ({"worlds": -3}, r"worlds is -3.*at least 1"),
        ({"worlds": 2.5}, r"worlds is 2\.5.*whole number"),
        ({"worlds": 10**12}, r'worlds "1000000000000".*1 to 4294967295'),
        ({"worlds": 2**63 - 1}, r'worlds "9223372036854775807".*1 to 4294967295'),
        ({"worlds": 2**64}, r"worlds does not fit into 64 bits"),
        ({"device": None}, r"device is None; give a string"),
        ({"precision": 64}, r"precision is 64; give a string"),
        ({"fields": None}, r"fields is None; give a list"),
        ({"fields": [1]}, r"fields is 1; give a string"),
        ({"log": 5}, r"log is 5; give a path"),
        ({"name": 5}, r"name is 5; give a string"),
        ({"name": "a\0"}, r"name is 'a\\x00'"),
        ({"name": "\udc80"}, r"name is '\\udc80'"),
        ({"threads": 0}, r"threads is 0"),
        ({"threads": 10**6}, r'threads "1000000".*1 to 1024'),
        ({"frames_held": 0}, r"frames_held is 0"),
        ({"frames_held": 10**6}, r'frames-held "1000000".*1 to 1024'),
        ({"name": "a/b"}, r'"a/b"'),
        ({"name": ""}, r'"".*empty'),
    ],
    ids=str,
)
def test_a_wrong_argument_of_launch_is_named_with_what_is_valid(pendulum, arguments, named):
    with pytest.raises(tl.ArgumentError, match=named):
        tl.launch(pendulum, **({"worlds": 1} | arguments))


@pytest.mark.parametrize("name", [None, 5, "", "a/b", "\udc80"], ids=repr)
def test_a_name_that_no_daemon_can_have_is_refused(name):
    with pytest.raises(tl.ArgumentError, match="name"):
        tl.attach(name)


def test_a_launch_that_fails_reports_it_once(pendulum, capfd):
    with pytest.raises(tl.ArgumentError):
        tl.launch(pendulum, worlds=1, device="tpu")
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("fields", [("joint_q",), ("joint_q", "mass_matrix", "body_q")])
def test_more_worlds_than_memory_holds_are_refused_before_it_is_touched(pendulum, fields):
    with pytest.raises(tl.ResourceError, match=r"worlds"):
        tl.launch(pendulum, worlds=2_000_000_000, fields=fields)


def test_a_name_that_is_taken_names_the_process(pendulum, unique):
    name = unique()
    with tl.launch(pendulum, worlds=1, name=name) as sim:
        with pytest.raises(tl.LaunchError, match=str(sim.pid)):
            tl.launch(pendulum, worlds=1, name=name)
        sim.step()


def test_an_unknown_daemon_is_named_with_those_that_run(pendulum, unique):
    with tl.launch(pendulum, worlds=1) as sim, pytest.raises(tl.UnknownDaemon, match=sim.name):
        tl.attach(unique())


F32 = np.zeros((4, 2), np.float32)
NAN = F32.copy()
NAN[2, 1] = np.nan


@pytest.mark.parametrize(
    ("command", "named"),
    [
        ({"joint_f": np.zeros((4, 3), np.float32)}, r"joint_f.*\(4, 2\).*\(4, 3\)"),
        ({"joint_f": np.zeros((3, 2), np.float32)}, r"joint_f.*\(4, 2\).*\(3, 2\)"),
        ({"joint_f": np.zeros((2, 4), np.float32)}, r"joint_f.*\(4, 2\).*\(2, 4\)"),
        ({"joint_f": np.zeros((4, 1), np.float32)}, r"joint_f.*\(4, 2\).*\(4, 1\)"),
        ({"joint_f": np.zeros((4, 2, 1), np.float32)}, r"joint_f.*\(4, 2\).*\(4, 2, 1\)"),
        ({"joint_target_q": np.zeros(3)}, r"joint_target_q.*\(4, 2\).*\(3,\)"),
        ({"joint_f": 1.0}, r"joint_f.*\(4, 2\).*\(\)"),
        ({"joint_f": F32.astype(complex)}, r"joint_f.*complex128"),
        ({"joint_f": F32.astype(str)}, r"joint_f.*<U"),
        ({"joint_f": F32.astype(bool)}, r"joint_f.*bool"),
        ({"joint_f": [[1.0], [1.0, 2.0]]}, r"joint_f"),
        ({"joint_f": np.full((4, 2), None)}, r"joint_f.*None"),
        ({"joint_f": NAN}, r"joint_f.*world 2.*arm/elbow"),
        ({"joint_f": NAN.astype(float)}, r"joint_f.*world 2.*arm/elbow"),
        ({"joint_f": np.full((4, 2), 1e300)}, r"joint_f.*world 0.*arm/shoulder"),
        ({"joint_target_qd": -np.inf * np.ones(2)}, r"joint_target_qd.*world 0.*arm/shoulder"),
        ({"joint_f": {"leg": F32}}, r"joint_f.*`leg`.*`arm`"),
        ({"joint_f": {"arm": np.zeros((4, 9), np.float32)}}, r"joint_f.*`arm`.*\(4, 2\).*\(4, 9\)"),
        ({"joint_f": {"arm": NAN}}, r"joint_f.*world 2.*arm/elbow"),
        ({"joint_f": {1: F32}}, r"joint_f.*1"),
    ],
    ids=lambda value: None if isinstance(value, dict) else value,
)
def test_a_wrong_command_is_refused_by_name_and_the_daemon_goes_on(pendulum, command, named):
    with tl.launch(pendulum, worlds=4) as sim, tl.launch(pendulum, worlds=4) as untouched:
        sim.step(joint_f=F32)
        untouched.step(joint_f=F32)
        with pytest.raises(tl.CommandRefused, match=named):
            sim.step(**command)
        assert np.array_equal(sim.step().joint_q, untouched.step().joint_q), "a refused command touches no world"


@pytest.mark.parametrize(
    ("mask", "named"),
    [
        ([True, False], r"mask.*\(4,\).*\(2,\)"),
        ([1, 0, 1, 0], r"mask.*bool"),
        ([[True] * 4], r"mask.*\(4,\).*\(1, 4\)"),
    ],
)
def test_a_wrong_mask_is_refused(pendulum, mask, named):
    with tl.launch(pendulum, worlds=4) as sim:
        with pytest.raises(tl.CommandRefused, match=named):
            sim.reset(mask=mask)
        with pytest.raises(tl.CommandRefused, match=named):
            sim.write(joint_q=[0, 0], mask=mask)
        sim.step()


def test_a_state_that_is_not_finite_is_refused(pendulum):
    with tl.launch(pendulum, worlds=4, precision="f64") as sim:
        with pytest.raises(tl.CommandRefused, match=r"joint_q.*world 2.*arm/elbow"):
            sim.write(joint_q=NAN)
        assert np.isfinite(sim.step().joint_q).all()


@pytest.mark.parametrize("gain", ["joint_target_ke", "joint_target_kd"])
def test_a_drive_on_a_free_body_is_refused_and_a_single_gain_spares_it(tmp_path, gain):
    path = tmp_path / "free.urdf"
    path.write_text(f'<robot name="free"><link name="body">{GOOD}</link></robot>')
    scene = tl.Scene()
    body = scene.add_urdf(path, floating=True)
    setattr(body, gain, 100.0)
    with tl.launch(scene, worlds=1) as sim:
        sim.step()
    setattr(body, gain, [100.0] * 6)
    with pytest.raises(tl.SceneError, match=r"`floating_base` is free and cannot be driven.*joint_f"):
        tl.launch(scene, worlds=1)


def test_a_wrong_keyword_is_a_type_error(pendulum):
    with tl.launch(pendulum, worlds=1) as sim, pytest.raises(TypeError, match="joint_g"):
        sim.step(joint_g=[0, 0])  # pyright: ignore[reportCallIssue]


def test_a_closed_sim_reports_it(pendulum):
    sim = tl.launch(pendulum, worlds=1)
    sim.close()
    sim.close()
    for call in (sim.step, sim.reset, sim.forward, sim.write):
        with pytest.raises(tl.SimClosed, match=sim.name):
            call()


def test_a_second_controller_is_refused_until_the_first_is_done(pendulum):
    with tl.launch(pendulum, worlds=1) as sim:
        sim.step()
        other = tl.attach(sim.name)
        with pytest.raises(tl.LeaseHeld, match=r"\d+"):
            other.step()
        other.close()
        assert sim.step().step[0] == 2
