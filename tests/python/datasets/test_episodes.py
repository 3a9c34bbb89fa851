"""Episodes of recordings: where they begin and end, and which step an observation, an action and a time belong to."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
import recorded_run
from recorded_run import LENGTHS, WORLDS

import tightloop as tl
from conftest import PENDULUM
from tightloop.datasets import Episode, episodes
from tightloop.datasets.choices import layout

run = recorded_run.run


def test_a_reset_ends_an_episode_of_each_world(run):
    made = list(episodes(run.path))
    assert [(each.world, each.steps) for each in made] == [
        (world, steps) for steps in LENGTHS for world in range(WORLDS)
    ]
    assert [each.index for each in made] == list(range(len(made)))
    # the last ones end with the recording
    assert [each.ends for each in made] == [True] * 2 * WORLDS + [False] * WORLDS


def test_observations_and_actions_are_those_that_the_client_saw_and_sent_bit_for_bit(run):
    fields = ["joint_qd", "body_q", "kinetic_energy"]
    for each in episodes(run.path, fields=fields):
        seen, sent = run.seen[each.index // WORLDS], run.sent[each.index // WORLDS]
        for field in fields:
            np.testing.assert_array_equal(each.observations[field], seen[field][:-1, each.world])
            np.testing.assert_array_equal(each.next_observations[field], seen[field][1:, each.world])
        np.testing.assert_array_equal(each.actions, sent[:, each.world])
        states = np.concatenate([seen["joint_q"], seen["joint_qd"]], axis=2)[:-1, each.world]
        np.testing.assert_array_equal(each.states, states)


def test_times_count_from_the_first_observation_and_begins_from_the_recordings(run):
    made = list(episodes(run.path, worlds=1))
    np.testing.assert_allclose([each.begin for each in made], np.cumsum([0, *LENGTHS[:-1]]) * run.period, atol=1e-9)
    for each in made:
        np.testing.assert_allclose(each.times, np.arange(each.steps) * run.period, atol=1e-9)
        assert list(each.dones) == [False] * (each.steps - 1) + [True] and not each.rewards.any()


def test_a_lower_rate_takes_the_first_command_of_a_frame_and_the_state_behind_it(run):
    made = list(episodes(run.path, fps=20, worlds=[1]))
    for each, seen, sent in zip(made, run.seen, run.sent, strict=True):
        steps = len(sent)
        np.testing.assert_array_equal(each.actions, sent[::3, 1])
        np.testing.assert_array_equal(each.observations["joint_q"], seen["joint_q"][:-1:3, 1])
        # the last frame may be shorter
        following = [min(step + 3, steps) for step in range(0, steps, 3)]
        np.testing.assert_array_equal(each.next_observations["joint_q"], seen["joint_q"][following, 1])
        np.testing.assert_allclose(np.diff(each.times), 1 / 20)


def test_worlds_and_joints_are_chosen(run):
    made = list(episodes(run.path, worlds=[2, 0], joints=["*/elbow"], min_steps=5))
    assert [(each.world, each.steps) for each in made] == [(2, 5), (0, 5), (2, 7), (0, 7)]
    np.testing.assert_array_equal(made[0].actions, run.sent[0][:, 2, 1:])
    assert [each.index for each in made] == [0, 1, 2, 3]


def test_the_action_has_no_dofs_of_free_bodies_unless_they_are_named(arm, tmp_path):
    arm.add_cube(pos=(3, 0, 1), name="cube")
    path = tmp_path / "run.tlrec"
    with tl.launch(arm, worlds=1) as sim, sim.record(path):
        sim.step(joint_f=np.arange(8))
    first, every = (next(iter(episodes(path, joints=joints))) for joints in (None, ["*"]))
    np.testing.assert_array_equal(first.actions[0], every.actions[0][first.actions[0].astype(int)])
    assert (first.actions.shape, every.actions.shape) == ((1, 2), (1, 8))


MUJOCO = """<mujoco model="m"><option timestep="0.005"/><worldbody>
  <body name="hand" mocap="true"><geom size="0.1" contype="0" conaffinity="0"/></body>
  <body name="ball" pos="1 0 1"><freejoint name="free"/><geom size="0.1"/></body>
  <body name="cart"><joint name="slide" type="slide" axis="1 0 0"/><geom size="0.1"/></body>
</worldbody><actuator><motor name="push" joint="slide"/></actuator></mujoco>"""


def test_actions_of_mujoco_models_are_controls_and_columns_have_the_names_of_their_order(tmp_path):
    scene = tl.Scene.from_mujoco(mujoco.MjModel.from_xml_string(MUJOCO))
    path = tmp_path / "run.tlrec"
    with tl.launch(scene, worlds=1) as sim, sim.record(path):
        for control in range(3):
            sim.step(ctrl=np.full((1, 1), control))
    (made,) = episodes(path, fields=["qpos", "joint_q"])
    np.testing.assert_array_equal(made.actions, [[0], [1], [2]])
    chosen = layout(path, fields=["qpos"], action=["ctrl", "mocap_pos"], joints=None, worlds=None, fps=None)
    assert chosen.fps == 200 and chosen.action_names[0] == "m/push.ctrl"
    assert chosen.action_names[1:] == tuple(f"m/hand.mocap_pos.{part}" for part in range(3))
    for field, quaternion in (("qpos", ("qw", "qx", "qy", "qz")), ("joint_q", ("qx", "qy", "qz", "qw"))):
        names = [name.removeprefix("m/free.") for name in chosen.columns[field]]
        assert tuple(names) == ("x", "y", "z", *quaternion, "m/slide")
        # it is at rest, not turned
        assert made.observations[field][0, names.index("qw")] == 1


@pytest.fixture
def arm(tmp_path):
    urdf = tmp_path / "pendulum.urdf"
    urdf.write_text(PENDULUM)
    scene = tl.Scene(dt=1 / 600, substeps=10)
    scene.add_urdf(urdf, name="arm")
    return scene


def lengths(made: list[Episode]) -> list[tuple[int, int, bool]]:
    return [(each.world, each.steps, each.ends) for each in made]


def test_worlds_that_are_reset_alone_have_episodes_of_theirs(arm, tmp_path):
    path = tmp_path / "run.tlrec"
    with tl.launch(arm, worlds=2) as sim, sim.record(path):
        for _ in range(2):
            sim.step(joint_f=np.ones(2))
        sim.reset(mask=np.array([True, False]))
        for _ in range(3):
            sim.step()
        # a second reset of a world that has not moved begins nothing new
        sim.reset(mask=np.array([False, True]))
        sim.reset(mask=np.array([False, True]))
    assert lengths(list(episodes(path))) == [(0, 2, True), (1, 5, True), (0, 3, False)]


def test_a_write_changes_the_observation_and_ends_no_episode(arm, tmp_path):
    path = tmp_path / "run.tlrec"
    with tl.launch(arm, worlds=1) as sim, sim.record(path):
        sim.step(joint_f=np.ones(2))
        sim.write(joint_q=np.array([[0.5, 0.25]]))
        sim.forward()
        sim.step()
    (made,) = episodes(path)
    assert made.steps == 2
    np.testing.assert_array_equal(made.observations["joint_q"][1], np.array([0.5, 0.25], np.float32))
    assert not np.array_equal(made.next_observations["joint_q"][0], made.observations["joint_q"][1])


def test_a_restored_snapshot_begins_an_episode_where_time_jumps(arm, tmp_path):
    path = tmp_path / "run.tlrec"
    with tl.launch(arm, worlds=1) as sim, sim.record(path):
        sim.step(joint_f=np.ones(2))
        kept = sim.snapshot()
        for _ in range(3):
            sim.step()
        sim.restore(kept)
        for _ in range(2):
            sim.step()
    assert lengths(list(episodes(path))) == [(0, 4, True), (0, 2, False)]


@pytest.mark.parametrize(
    ("on_fault", "expected"), [("freeze", [(0, 2, True)]), ("reset", [(0, 2, True), (0, 1, False)])]
)
def test_a_faulted_world_ends_its_episode(arm, tmp_path, on_fault, expected):
    # the run puts a world back and steps it in one frame, so that the state between is in none
    path = tmp_path / "run.tlrec"
    with tl.launch(arm, worlds=1, bounds={"joint_qd": 50.0}, on_fault=on_fault) as sim, sim.record(path):
        for force in (0, 0, 1e6, 0, 0):
            sim.step(joint_f=np.full(2, force))
    assert lengths(list(episodes(path))) == expected


def test_a_world_that_faults_in_its_first_step_has_no_episode_from_there(arm, tmp_path):
    path = tmp_path / "run.tlrec"
    with tl.launch(arm, worlds=1, bounds={"joint_qd": 50.0}, on_fault="reset") as sim, sim.record(path):
        for force in (1e6, 0, 0, 0):
            sim.step(joint_f=np.full(2, force))
    assert lengths(list(episodes(path))) == [(0, 2, False)]


def test_a_recording_that_begins_in_the_middle_of_a_run_has_its_first_state(arm, tmp_path):
    path = tmp_path / "run.tlrec"
    with tl.launch(arm, worlds=1) as sim:
        for _ in range(2):
            sim.step(joint_f=np.ones(2))
        before = sim.step(joint_f=np.ones(2)).joint_q.copy()
        with sim.record(path):
            sim.step()
            sim.step(joint_f=np.full(2, 2.0))
    (made,) = episodes(path)
    assert made.steps == 2
    np.testing.assert_array_equal(made.observations["joint_q"][0], before[0])
    # the first step sent nothing: its action is what it held
    np.testing.assert_array_equal(made.actions, np.array([[1, 1], [2, 2]], np.float32))
