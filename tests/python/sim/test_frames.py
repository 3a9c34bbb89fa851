"""What a frame promises: read-only views that stay as they are, for as long as somebody holds them."""

from __future__ import annotations

import ast
import gc
import os
import signal
from pathlib import Path

import numpy as np
import pytest

import tightloop as tl
from processes import alive, wait_until


def test_empty_fields_are_not_taken_for_those_that_lie_where_they_do():
    scene = tl.Scene()
    scene.add_cube()
    shapes = {
        "contact_pair": (3, 0, 2),
        "contact_force": (3, 0, 3),
        "contact_distance": (3, 0),
        "body_contact_force": (3, 1, 3),
        "contact_count": (3,),
    }
    with tl.launch(scene, worlds=3, fields=tuple(shapes)) as sim:
        frame = sim.reset()
        copy = frame.copy()
        for name, shape in shapes.items():
            for array in (getattr(frame, name), getattr(copy, name)):
                assert array.shape == shape, name
                assert np.issubdtype(array.dtype, np.integer) == (name in ("contact_pair", "contact_count")), name


def test_arrays_are_contiguous_read_only_views_with_worlds_first(pendulum):
    fields = ("joint_q", "joint_qd", "body_q", "mass_matrix")
    with tl.launch(pendulum, worlds=5, fields=fields) as sim:
        frame = sim.reset()
        shapes = {"joint_q": (5, 2), "joint_qd": (5, 2), "body_q": (5, 3, 7), "mass_matrix": (5, 2, 2)}
        always = ("time", "step", "status", "contacts_left_out")
        for name, shape in (shapes | dict.fromkeys(always, (5,))).items():
            array = getattr(frame, name)
            assert array.shape == shape, name
            assert array.flags.c_contiguous and array.flags.aligned and not array.flags.writeable, name
            assert not array.flags.owndata and array.ctypes.data % 64 == 0, name
            with pytest.raises(ValueError, match="read-only"):
                array[...] = 0
        assert [getattr(frame, name).dtype for name in ("joint_q", *always)] == [
            np.float32,
            np.float64,
            np.uint64,
            np.uint32,
            np.uint32,
        ]
        assert frame.joint_q is frame.joint_q
        assert set(sim.fields) >= {*fields, *always} == set(dir(frame)) & {*fields, *sim.fields}


def test_f64_runs_have_f64_fields(pendulum):
    with tl.launch(pendulum, worlds=1, precision="f64") as sim:
        assert sim.reset().joint_q.dtype == np.float64
        assert sim.reset().joint_q.tolist() == [[0.3, -0.2]]


def test_time_and_step_count_control_frames(pendulum):
    with tl.launch(pendulum, worlds=2) as sim:
        sim.reset()
        sim.step()
        frame = sim.step()
        assert frame.step.tolist() == [2, 2]
        assert frame.time == pytest.approx(2 * 4 / 480, rel=1e-12)


def test_a_frame_stays_as_it_is_while_later_ones_come(pendulum):
    with tl.launch(pendulum, worlds=3) as sim:
        first = sim.step()
        before = first.joint_q.copy()
        for _ in range(50):
            sim.step()
        assert np.array_equal(first.joint_q, before)
        assert not np.array_equal(sim.forward().joint_q, before)


def test_an_array_outlives_frame_sim_and_daemon(pendulum):
    with tl.launch(pendulum, worlds=3) as sim:
        array = sim.step().joint_q
        before = array.copy()
    del sim
    gc.collect()
    assert np.array_equal(array, before)


def test_an_array_outlives_a_killed_daemon(pendulum):
    with tl.launch(pendulum, worlds=3) as sim:
        frame = sim.step()
        before = frame.joint_q.copy()
        os.kill(sim.pid, signal.SIGKILL)
        assert wait_until(lambda: not alive(sim.pid), 5)
        assert np.array_equal(frame.joint_q, before)
        assert np.isfinite(frame.body_q).all()
    assert np.array_equal(frame.joint_q, before)


def test_one_frame_too_many_is_refused_until_one_is_dropped(pendulum):
    with tl.launch(pendulum, worlds=2, frames_held=3) as sim:
        held = [sim.step() for _ in range(3)]
        with pytest.raises(tl.FramesHeld, match=r"frame\.copy\(\)"):
            sim.step()
        array = held[0].joint_q
        del held[0]
        with pytest.raises(tl.FramesHeld):
            sim.step()  # the array holds its frame
        del array
        assert sim.step().step[0] == 4, "refused steps were not carried out"


def test_a_copy_owns_its_arrays_and_holds_no_frame(pendulum):
    with tl.launch(pendulum, worlds=2, frames_held=1) as sim:
        copies = [sim.step().copy() for _ in range(5)]
        assert [int(copy.step[0]) for copy in copies] == [1, 2, 3, 4, 5]
        assert copies[0].joint_q.flags.writeable and copies[0].joint_q.flags.owndata
        with pytest.raises(tl.UnknownField, match="joint_qdd"):
            _ = copies[0].joint_qdd


def test_a_field_that_was_not_asked_for_is_named_with_those_that_were(pendulum):
    with tl.launch(pendulum, worlds=1, fields=("joint_q",)) as sim:
        frame = sim.reset()
        assert not hasattr(frame, "mass_matrix")
        with pytest.raises(tl.UnknownField, match=r"joint_qd.*joint_q.*fields"):
            _ = frame.joint_qd


def test_a_frame_carries_every_field_there_is(pendulum):
    with tl.launch(pendulum, worlds=1) as sim:
        known = [field["name"] for field in sim.info["known_fields"]]
    assert len(known) > 64
    # a name that comes twice counts once
    with tl.launch(pendulum, worlds=2, fields=known + known) as sim, tl.attach(sim.name) as observer:
        assert set(sim.step().fields) == set(known)
        frame = observer.latest(10.0)
        assert frame is not None and set(frame.fields) == {*known, "state"}


def test_stubs_and_field_table_name_the_same_fields(pendulum):
    stubs = ast.parse((Path(tl.__file__).parent / "_core.pyi").read_text())
    frame = next(node for node in stubs.body if isinstance(node, ast.ClassDef) and node.name == "Frame")
    targets = [node.target for node in frame.body if isinstance(node, ast.AnnAssign)]
    with tl.launch(pendulum, worlds=1) as sim:
        known = [field["name"] for field in sim.info["known_fields"]]
    # the state is what observers get besides, and no field
    assert [target.id for target in targets if isinstance(target, ast.Name)] == [*known, "state"]


def test_reset_of_some_worlds_leaves_the_others(pendulum):
    with tl.launch(pendulum, worlds=4) as sim:
        before = [sim.step(joint_f=[0.5, 0.1]).copy() for _ in range(3)][-1]
        after = sim.reset(mask=[True, False, False, True])
        assert after.step.tolist() == [0, 3, 3, 0]
        assert after.time.tolist() == [0, before.time[1], before.time[2], 0]
        assert np.array_equal(after.joint_q[1:3], before.joint_q[1:3])
        assert np.array_equal(after.joint_q[[0, 3]], np.array([[0.3, -0.2]] * 2, dtype=np.float32))


def test_reset_sets_joint_f_to_zero_and_targets_to_the_scenes(pendulum):
    arm = pendulum.robots["arm"]
    arm.joint_target_ke, arm.joint_target_kd = 30.0, 3.0
    arm.joint_target_q = [0.1, 0.2]
    with tl.launch(pendulum, worlds=2) as sim:
        sim.reset()
        expected = sim.step().copy()
        sim.step(joint_f=[3.0, 2.0], joint_target_q=[1.0, 1.0], joint_target_qd=[2.0, 2.0])
        sim.reset()
        assert np.array_equal(sim.step().joint_q, expected.joint_q)


def test_a_command_left_out_keeps_its_last_value(pendulum):
    with tl.launch(pendulum, worlds=2) as sim:
        sim.reset()
        every = [sim.step(joint_f=[0.5, -0.3]).copy() for _ in range(3)][-1]
        sim.reset()
        sim.step(joint_f=[0.5, -0.3])
        sim.step()
        once = sim.step()
        assert np.array_equal(every.joint_q, once.joint_q)


def test_write_sets_what_is_given_where_the_mask_is_true(pendulum):
    with tl.launch(pendulum, worlds=3, precision="f64") as sim:
        sim.reset()
        frame = sim.write(joint_q=[[1, 2], [3, 4], [5, 6]], mask=[True, False, True])
        assert frame.joint_q.tolist() == [[1, 2], [0.3, -0.2], [5, 6]]
        assert frame.joint_qd.tolist() == [[0, 0]] * 3
        frame = sim.write(joint_qd={"arm": [[7, 8]] * 3}, mask=np.array([False, True, False]))
        assert frame.joint_q.tolist() == [[1, 2], [0.3, -0.2], [5, 6]]
        assert frame.joint_qd.tolist() == [[0, 0], [7, 8], [0, 0]]
        assert frame.step.tolist() == [0, 0, 0]
        assert np.array_equal(sim.forward().joint_qd, frame.joint_qd)


def test_commands_of_one_robot_leave_the_other(pendulum, pendulum_urdf):
    pendulum.add_urdf(pendulum_urdf, name="other", pos=(2, 0, 0)).joint_q = [0.3, -0.2]
    with tl.launch(pendulum, worlds=2) as sim:
        assert sim.dof_names == ["arm/shoulder", "arm/elbow", "other/shoulder", "other/elbow"]
        assert (sim.dofs["arm"], sim.dofs["other"]) == (slice(0, 2), slice(2, 4))
        assert sim.body_names[sim.bodies["other"]] == ["other/base", "other/upper", "other/lower"]
        frame = sim.step(joint_f={"other": np.ones((2, 2), np.float32)})
        assert np.array_equal(frame.joint_q[:, sim.coords["arm"]], sim_alone(pendulum_urdf))
        assert not np.array_equal(frame.joint_q[:, 0:2], frame.joint_q[:, 2:4])


@pytest.mark.parametrize("order", [("post",), ("post", "arm"), ("arm", "post")], ids=str)
def test_a_robot_without_moving_joints_takes_commands_of_no_columns(tmp_path, pendulum_urdf, order):
    post = tmp_path / "post.urdf"
    post.write_text('<robot name="post"><link name="base"/></robot>')
    scene = tl.Scene()
    for name in order:
        scene.add_urdf(post if name == "post" else pendulum_urdf, name=name)
    with tl.launch(scene, worlds=5, fields=("joint_q", "mass_matrix")) as sim:
        commands = {name: np.zeros((5, sim.dofs[name].stop - sim.dofs[name].start)) for name in order}
        sim.step(joint_f=commands, joint_target_q=commands, joint_target_qd=commands)
        assert sim.step(joint_target_qd={"post": np.zeros((5, 0))}).step.tolist() == [2] * 5
        frame = sim.write(joint_q=commands, joint_qd=commands, mask=np.arange(5) > 2)
        assert frame.joint_q.shape == (5, len(sim.dof_names))
        assert not frame.joint_q[3:].any() and frame.status.tolist() == [0] * 5


def sim_alone(urdf):
    """Positions of an undriven pendulum after one frame, two worlds."""
    scene = tl.Scene(dt=1 / 480, substeps=4)
    scene.add_urdf(urdf, name="arm").joint_q = [0.3, -0.2]
    with tl.launch(scene, worlds=2) as sim:
        return sim.step().joint_q.copy()


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.int64, np.int8, np.uint16])
def test_real_numbers_of_any_type_and_layout_are_taken(pendulum, dtype):
    values = np.array([[1, -2], [3, -4], [5, 6]]).astype(dtype)
    with tl.launch(pendulum, worlds=3) as sim:
        expected = sim.write(joint_q=values.astype(float).tolist()).copy()
        for same in (
            values,
            np.asfortranarray(values),
            np.repeat(values, 2, axis=0)[::2],
            values.astype(dtype, order="F"),
        ):
            assert np.array_equal(sim.write(joint_q=same).joint_q, expected.joint_q)
