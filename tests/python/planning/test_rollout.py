"""Rollouts are what single steps give: fields, costs and faults, for every form of the commands."""

from __future__ import annotations

import numpy as np
import pytest

import tightloop as tl

WORLDS, FRAMES = 21, 6
FIELDS = ("joint_q", "joint_qd", "body_q")


@pytest.fixture(params=["f32", "f64"])
def plan(pendulum, request):
    with tl.launch(pendulum, worlds=WORLDS, precision=request.param, fields=FIELDS) as sim:
        yield sim


@pytest.fixture
def torques():
    return np.random.default_rng(3).normal(0.0, 0.5, (FRAMES, WORLDS, 2))


def stepped(sim: tl.Sim, commands: np.ndarray) -> dict[str, np.ndarray]:
    """What single steps give, by field."""
    frames = [sim.step(joint_f=command).copy() for command in commands]
    return {name: np.stack([getattr(frame, name) for frame in frames]) for name in (*FIELDS, "status", "time")}


def test_a_rollout_has_the_bits_of_single_steps(plan, torques):
    start = plan.snapshot()
    expected = stepped(plan, torques)
    plan.restore(start)
    rollout = plan.rollout({"joint_f": torques})
    assert rollout.fields == FIELDS and rollout.frames == FRAMES
    for name in (*FIELDS, "status"):
        assert np.array_equal(getattr(rollout, name), expected[name]), name
        assert getattr(rollout, name).dtype == expected[name].dtype, name
    assert rollout.cost is None and not rollout.faulted.any()
    # the worlds are where the rollout ends
    assert np.array_equal(plan.forward().joint_q, rollout.joint_q[-1])
    plan.restore(start)
    assert np.array_equal(plan.rollout({"joint_f": torques}, ("time",)).time, expected["time"])


def test_identical_commands_and_dicts_of_robots_are_sequences_too(plan, torques):
    start = plan.snapshot()
    alike = plan.rollout({"joint_f": torques[:, 0]}, start=start)
    spread = plan.rollout({"joint_f": np.repeat(torques[:, :1], WORLDS, axis=1)}, start=start)
    by_robot = plan.rollout({"joint_f": {"arm": torques[:, 0]}}, start=start)
    by_joint = plan.rollout(
        {"joint_f": {"arm": {"elbow": torques[:, 0, 0], "shoulder": torques[:, 0, 1]}}}, start=start
    )
    order = [plan.dof_names.index(f"arm/{joint}") for joint in ("elbow", "shoulder")]
    swapped = np.empty_like(torques[:, 0])
    swapped[:, order] = torques[:, 0]
    assert np.array_equal(alike.joint_q, spread.joint_q)
    assert np.array_equal(alike.joint_q, by_robot.joint_q)
    assert np.array_equal(by_joint.joint_q, plan.rollout({"joint_f": swapped}, start=start).joint_q)


def test_each_rollout_begins_from_the_same_state(plan, pendulum, torques):
    with tl.launch(pendulum, worlds=2, precision=plan.precision, fields=FIELDS) as plant:
        plant.step(joint_f=np.array([[0.3, 0.0], [0.0, -0.3]]))
        for start in ((plant, 1), (plant.snapshot(), 1)):
            first = plan.rollout({"joint_f": torques}, start=start)
            again = plan.rollout({"joint_f": torques}, start=start)
            assert np.array_equal(first.joint_q, again.joint_q)
            plan.copy_from(plant, 1)
            assert np.array_equal(first.joint_q, stepped(plan, torques)["joint_q"])
        other = plan.rollout({"joint_f": torques}, start=plant)
        assert not np.array_equal(other.joint_q[0], first.joint_q[0])
    plan.reset()
    own = plan.snapshot()
    assert np.array_equal(
        plan.rollout({"joint_f": torques}, start=own).joint_q, plan.rollout({"joint_f": torques}, start=own).joint_q
    )


def test_a_cost_is_summed_over_the_frames_without_storing_them(plan, torques):
    start = plan.snapshot()
    stored = plan.rollout({"joint_f": torques}, start=start)
    rollout = plan.rollout({"joint_f": torques}, start=start, cost=lambda frame: np.square(frame.joint_q).sum(axis=1))
    assert rollout.fields == () and rollout.cost is not None
    # float32 frames are summed in float64 in the same order
    expected = sum(np.square(joint_q).sum(axis=1).astype(np.float64) for joint_q in stored.joint_q)
    assert np.array_equal(rollout.cost, expected)
    both = plan.rollout({"joint_f": torques}, ["joint_qd"], start=start, cost=lambda frame: frame.joint_q[:, 0])
    assert np.array_equal(both.joint_qd, stored.joint_qd)


def test_a_rollout_is_written_again_into_its_arrays(plan, torques):
    start = plan.snapshot()

    def go(scale: float, out: tl.Rollout | None = None) -> tl.Rollout:
        cost = {"cost": lambda frame: frame.joint_q[:, 0]}
        return plan.rollout({"joint_f": scale * torques}, ("joint_q",), start=start, out=out, **cost)

    first = go(1.0)
    arrays, kept = (first.joint_q, first.status, first.cost), first.joint_q.copy()
    again = go(2.0, first)
    assert again is first and again.joint_q is arrays[0] and again.status is arrays[1] and again.cost is arrays[2]
    assert not np.array_equal(again.joint_q, kept)
    fresh = go(2.0)
    assert again.cost is not None and fresh.cost is not None
    assert np.array_equal(again.joint_q, fresh.joint_q) and np.array_equal(again.cost, fresh.cost)


def test_a_faulted_world_is_handed_back_and_never_the_cheapest(plan, torques):
    torques[2, 4] = np.finfo(plan.forward().joint_q.dtype).max / 10
    # a frozen world keeps its state, which may look cheap
    rollout = plan.rollout({"joint_f": torques}, ("joint_q",), cost=lambda frame: -np.ones(WORLDS))
    assert np.flatnonzero(rollout.faulted).tolist() == [4]
    assert (rollout.status[:, 4] != 0).tolist() == [False, False, True, True, True, True]
    assert rollout.cost is not None and np.flatnonzero(np.isinf(rollout.cost)).tolist() == [4]
    assert rollout.cost[3] == -FRAMES and rollout.cost.argmin() != 4
    assert np.array_equal(rollout.joint_q[2, 4], rollout.joint_q[1, 4])


def test_errors_leave_no_step_in_flight(plan, torques):
    torques[3, 5, 1] = np.nan
    with pytest.raises(tl.CommandRefused, match=r"rollout: frame 3: .*NaN in world 5"):
        plan.rollout({"joint_f": torques})
    assert (plan.step().step == 4).all()

    class Failure(Exception):
        pass

    def fails(frame: tl.Frame) -> np.ndarray:
        if frame.step[0] == 6:
            raise Failure
        return np.zeros(WORLDS)

    with pytest.raises(Failure):
        plan.rollout({"joint_f": np.zeros((FRAMES, 2))}, cost=fails)
    # the step that ran meanwhile is done
    assert (plan.step().step == 8).all()
    with pytest.raises(tl.CommandRefused, match="rollout: frame"):
        plan.rollout({"joint_f": np.zeros((FRAMES, 2))}, cost=lambda _: plan.forward().joint_q[:, 0])
    plan.forward()


@pytest.mark.parametrize(
    ("arguments", "error", "match"),
    [
        ({"commands": {}}, tl.ArgumentError, "commands is empty; give a dict"),
        ({"commands": np.zeros((3, 2))}, tl.ArgumentError, "commands is ndarray; give a dict"),
        ({"commands": {"torque": np.zeros((3, 2))}}, tl.ArgumentError, "did you mean `joint_f`"),
        ({"commands": {"joint_f": np.zeros(2)}}, tl.ArgumentError, r"joint_f has shape \(2,\); give \(frames"),
        ({"commands": {"joint_f": np.zeros((0, 2))}}, tl.ArgumentError, "0 frames"),
        ({"commands": {"joint_f": "abc"}}, tl.ArgumentError, "joint_f"),
        (
            {"commands": {"joint_f": np.zeros((3, 5, 2))}},
            tl.CommandRefused,
            r"frame 0: joint_f: expected shape \(21, 2",
        ),
        (
            {"commands": {"joint_f": np.zeros((3, 2)), "joint_target_q": np.zeros((4, 2))}},
            tl.ArgumentError,
            "joint_f 3, joint_target_q 4; give all the same",
        ),
        ({"fields": "joint_q"}, tl.ArgumentError, "fields is 'joint_q'; give a list"),
        ({"fields": ("joint_qqd",)}, tl.UnknownField, "did you mean `joint_qd`"),
        ({"fields": ("qpos",)}, tl.UnknownField, "add 'qpos' to `fields` at launch"),
        ({"fields": (3,)}, tl.ArgumentError, "fields has 3"),
        ({"cost": 3}, tl.ArgumentError, "cost is 3; give a function"),
        ({"cost": lambda frame: frame.joint_q}, tl.ArgumentError, r"cost returned .*; return .*\(21,\)"),
        ({"start": "here"}, tl.ArgumentError, "start is 'here'; give a Sim"),
        ({"start": (1, 2, 3)}, tl.ArgumentError, "start has 3 entries"),
        ({"out": 3}, tl.ArgumentError, "out is int; give a rollout"),
    ],
)
def test_wrong_arguments_are_named_with_a_cure(plan, arguments, error, match):
    before = plan.forward().copy()
    with pytest.raises(error, match=match):
        plan.rollout(**{"commands": {"joint_f": np.zeros((3, 2))}} | arguments)
    if "cost" not in arguments:
        assert np.array_equal(plan.forward().step, before.step)


def test_a_rollout_that_does_not_fit_is_not_written(plan):
    commands = {"joint_f": np.zeros((3, 2))}
    out = plan.rollout(commands, ("joint_q",))
    for arguments, match in (
        ({"commands": {"joint_f": np.zeros((4, 2))}}, r"\(3, 21\), the commands \(4, 21\)"),
        ({"fields": ("joint_qd",)}, "out has joint_q"),
        ({"cost": lambda frame: frame.joint_q[:, 0]}, "no cost"),
    ):
        with pytest.raises(tl.ArgumentError, match=match):
            plan.rollout(**{"commands": commands, "fields": ("joint_q",), "out": out} | arguments)
    with pytest.raises(tl.UnknownField, match="joint_qd"):
        _ = out.joint_qd
