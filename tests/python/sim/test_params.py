"""Parameters of each world through the daemon: read, written, in scene files, and refused by name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tightloop as tl

WORLDS = 18
ALL = (
    "gravity",
    "body_mass_scale",
    "joint_armature",
    "joint_damping",
    "joint_target_ke",
    "joint_target_kd",
    "joint_effort_limit",
    "shape_mu",
    "body_f",
)


@pytest.fixture(params=["f32", "f64"])
def sim(request, pendulum):
    pendulum.add_ground()
    with tl.launch(
        pendulum, worlds=WORLDS, precision=request.param, params=ALL, fields=("joint_q", "joint_qdd")
    ) as sim:
        yield sim


def test_each_is_read_as_it_was_written(sim):
    assert sim.params.names == ALL
    dtype = np.dtype("f4" if sim.precision == "f32" else "f8")
    for number, name in enumerate(ALL):
        before = getattr(sim.params, name)
        assert before.shape[0] == WORLDS and before.dtype == dtype
        given = np.random.default_rng(number).uniform(0.5, 2.0, before.shape)
        setattr(sim.params, name, given)
        np.testing.assert_array_equal(getattr(sim.params, name), given.astype(dtype))
    shapes = {name: getattr(sim.params, name).shape[1:] for name in ALL}
    bodies = len(sim.body_names)
    assert shapes == {
        "gravity": (3,),
        "body_mass_scale": (bodies,),
        "shape_mu": (len(sim.shape_names),),
        "body_f": (bodies, 6),
    } | {name: (2,) for name in ALL if name.startswith("joint_")}


def test_a_row_or_a_number_is_for_all_worlds(sim):
    sim.params.gravity = (0.0, 0.0, -1.62)
    np.testing.assert_allclose(sim.params.gravity, np.tile([0, 0, -1.62], (WORLDS, 1)), rtol=1e-6)
    sim.params.joint_damping = 0.25
    np.testing.assert_array_equal(sim.params.joint_damping, np.full((WORLDS, 2), 0.25))


def test_a_mask_leaves_the_others_as_they_were(sim):
    mask = np.arange(WORLDS) % 3 == 0
    before = sim.forward().joint_qdd.copy()
    frame = sim.params.write(gravity=(0, 0, 0), joint_armature=3.0, mask=mask)
    moved = (frame.joint_qdd != before).any(axis=1)
    np.testing.assert_array_equal(moved, mask)
    np.testing.assert_array_equal(sim.params.joint_armature[:, 0] == 3.0, mask)


def test_what_is_written_holds_over_resets_but_loads_do_not(sim):
    sim.params.write(joint_target_ke=7.0, body_f=1.0)
    sim.reset(mask=np.arange(WORLDS) < 5)
    np.testing.assert_array_equal(sim.params.joint_target_ke, np.full((WORLDS, 2), 7.0))
    assert not sim.params.body_f[:5].any() and (sim.params.body_f[5:] == 1.0).all()


def test_a_step_may_push_links(sim):
    push = np.zeros((WORLDS, len(sim.body_names), 6))
    push[4, -1] = (5.0, 4.0, 3.0, 0.2, 0.3, 0.4)
    still = sim.step().joint_q.copy()
    sim.reset()
    moved = sim.step(body_f=push).joint_q
    np.testing.assert_array_equal((moved != still).any(axis=1), np.arange(WORLDS) == 4)
    np.testing.assert_array_equal(sim.params.body_f, push.astype(sim.params.body_f.dtype))


def test_a_gain_that_explodes_freezes_its_world_alone(pendulum):
    names = ("joint_target_ke", "joint_target_kd")
    with tl.launch(pendulum, worlds=WORLDS, params=names) as sim:
        gains = np.zeros((WORLDS, 2))
        gains[7] = 1e30
        target = np.full((WORLDS, 2), 1.0)
        expected = [sim.step(joint_target_q=target).joint_q.copy() for _ in range(20)][-1]
        sim.reset()
        sim.params.joint_target_ke = gains
        for _ in range(19):
            sim.step(joint_target_q=target)
        frame = sim.step()
        others = np.arange(WORLDS) != 7
        np.testing.assert_array_equal(frame.joint_q[others], expected[others])
        assert frame.status[7] & 1 and not (frame.status[others] & 1).any()
        sim.params.joint_target_ke = 0.0
        assert not sim.reset(mask=~others).status.any()


def test_a_scene_file_may_name_them(pendulum, tmp_path: Path):
    pendulum.params = ["gravity", "shape_mu"]
    file = tmp_path / "scene.toml"
    pendulum.save(file)
    again = tl.Scene.load(file)
    assert again.params == ("gravity", "shape_mu")
    with tl.launch(again, worlds=2, params=("joint_armature",)) as sim:
        assert sim.params.names == ("gravity", "joint_armature", "shape_mu")
        assert sim.inverse_dynamics([0.0, 0.0]).shape == (2,)
        with tl.attach(sim.name) as other:
            assert other.params.names == sim.params.names


def test_constants_and_wrong_values_are_refused_by_name(pendulum):
    with tl.launch(pendulum, worlds=3, params=["joint_target_ke", "body_mass_scale"]) as sim:
        kept = sim.params.joint_target_ke
        with pytest.raises(tl.CommandRefused, match=r'same constant .* params=\("joint_armature",\)'):
            sim.params.joint_armature = 1.0
        with pytest.raises(tl.CommandRefused, match=r'same constant .* params=\("gravity",\)'):
            _ = sim.params.gravity
        with pytest.raises(tl.CommandRefused, match=r'params=\("body_f",\)'):
            sim.step(body_f=np.zeros((3, 3, 6)))
        with pytest.raises(
            tl.UnknownField, match=r"there is no parameter 'mass'; did you mean `body_mass`\? there are: gravity, "
        ):
            sim.params.mass = 1.0
        with pytest.raises(tl.CommandRefused, match=r"expected shape \(3, 2\), \(2,\) .* got \(2, 2\)"):
            sim.params.joint_target_ke = np.zeros((2, 2))
        with pytest.raises(tl.CommandRefused, match=r"is no array|not a real number"):
            sim.params.joint_target_ke = "stiff"
        with pytest.raises(
            tl.CommandRefused, match=r"params\.joint_target_ke is .*one value for each of sim\.dof_names"
        ):
            sim.params.joint_target_ke = {"arm/hinge": 1.0}  # pyright: ignore[reportArgumentType]
        with pytest.raises(tl.CommandRefused, match=r"params\.body_mass_scale is .*for each of sim\.body_names"):
            sim.params.body_mass_scale = {"arm/rod": 1.0}  # pyright: ignore[reportArgumentType]
        for bad, reason in ((-1.0, "give at least 0"), (np.nan, "NaN"), (np.inf, "inf")):
            with pytest.raises(tl.CommandRefused, match=reason):
                sim.params.write(joint_target_ke=[1.0, bad], body_mass_scale=2.0)
        for scale in (0.0, -2.0):
            with pytest.raises(tl.CommandRefused, match=r"body_mass_scale.*give at least 0.001"):
                sim.params.body_mass_scale = scale
        with pytest.raises(tl.CommandRefused, match=r"mask: expected shape \(3,\)"):
            sim.params.write(joint_target_ke=1.0, mask=[True])
        np.testing.assert_array_equal(sim.params.joint_target_ke, kept)
        assert (sim.params.body_mass_scale == 1.0).all()


def test_a_constant_is_no_attribute(pendulum):
    with tl.launch(pendulum, worlds=1, params=("gravity",)) as sim:
        assert hasattr(sim.params, "gravity") and not hasattr(sim.params, "shape_mu")
        assert getattr(sim.params, "joint_armature", None) is None
        with pytest.raises(tl.ConstantParameter, match=r'name it at launch: params=\("shape_mu",\)') as refused:
            _ = sim.params.shape_mu
        assert isinstance(refused.value, tl.CommandRefused) and isinstance(refused.value, AttributeError)


def test_two_names_in_one_entry_are_refused(pendulum):
    with pytest.raises(tl.ArgumentError, match="an entry of params is 'gravity,shape_mu'; give each name as an entry"):
        tl.launch(pendulum, worlds=1, params=("gravity,shape_mu",))
    with pytest.raises(tl.ArgumentError, match="an entry of fields is 'joint_q,joint_qd'; give each name as an entry"):
        tl.launch(pendulum, worlds=1, fields=("joint_q,joint_qd",))


def test_unknown_names_are_refused_at_launch(pendulum):
    with pytest.raises(tl.ArgumentError, match=r"'mass', and there is no such parameter; did you mean `body_mass`"):
        tl.launch(pendulum, worlds=1, params=["mass"])
    with pytest.raises(tl.ArgumentError, match=r"params is 'gravity'; give a list of names"):
        tl.launch(pendulum, worlds=1, params="gravity")
    with pytest.raises(tl.SceneError, match=r"params is 'gravity'; give a list of names"):
        tl.Scene(params="gravity")


def test_a_snapshot_carries_them(pendulum):
    """Parameters travel in a snapshot, so a run is resumed with them."""
    with tl.launch(pendulum, worlds=4, params=["gravity", "body_f"]) as sim:
        sim.params.gravity = np.arange(12.0).reshape(4, 3)
        sim.params.body_f = 0.5
        snapshot = sim.snapshot()
        expected = sim.step().joint_q.copy()
        sim.params.gravity = 0.0
        sim.params.body_f = 0.0
        sim.restore(snapshot)
        np.testing.assert_array_equal(sim.step().joint_q, expected)
        np.testing.assert_array_equal(sim.params.gravity, np.arange(12.0).reshape(4, 3))
