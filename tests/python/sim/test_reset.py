"""Resets through the daemon: distributions of the start state, masks and seeds."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

import tightloop as tl

START = np.array([0.3, -0.2])


@pytest.fixture
def scattered(pendulum) -> tl.Scene:
    """The pendulum and a cube, drawn around their start."""
    pendulum.add_cube(pos=(1, 2, 3))
    pendulum.randomize(
        joint_q={"arm": tl.Uniform(-0.1, 0.2), "arm/elbow": tl.Normal(0.0, 0.05)},
        joint_qd={"arm": tl.Normal(0.5, 0.1)},
        body_q={"cube": {"x": tl.Uniform(-0.5, 0.5), "yaw": tl.Uniform(-math.pi, math.pi)}},
        body_qd={"cube": {"vz": tl.Uniform(1, 2)}},
    )
    return pendulum


def state(frame: tl.Frame) -> NDArray[np.float64]:
    return np.concatenate([frame.joint_q, frame.joint_qd], axis=1).astype(float)


def test_starts_are_drawn_as_the_scene_says(scattered):
    worlds = 4096
    with tl.launch(scattered, worlds=worlds, precision="f64") as sim:
        frame = sim.reset()
        q, qd = np.array(frame.joint_q), np.array(frame.joint_qd)
    # a mean is known to 4.5 standard errors but in one of 100 000 samples
    error = 4.5 / math.sqrt(worlds)
    shoulder, elbow = (q[:, :2] - START).T
    assert (shoulder >= -0.1).all() and (shoulder <= 0.2).all()
    assert abs(shoulder.mean() - 0.05) < error * 0.3 / math.sqrt(12)
    assert abs(elbow.mean()) < error * 0.05 and abs(elbow.std() - 0.05) < error * 0.05
    assert (np.abs(qd[:, :2].mean(axis=0) - 0.5) < error * 0.1).all()
    assert abs(np.corrcoef(shoulder, elbow)[0, 1]) < error
    x, y, z = q[:, 2:5].T
    assert (np.abs(x - 1) <= 0.5).all() and np.ptp(x) > 0.99
    assert (y == 2).all() and (z == 3).all(), "what has no distribution stays"
    quat = q[:, 5:]
    assert (quat[:, :2] == 0).all(), "only yaw is drawn"
    np.testing.assert_allclose(np.linalg.norm(quat, axis=1), 1, atol=1e-15)
    yaw = 2 * np.arctan2(quat[:, 2], quat[:, 3])
    assert np.ptp(yaw) > 0.99 * 2 * math.pi
    assert (qd[:, [2, 3, 5, 6, 7]] == 0).all()
    assert (qd[:, 4] >= 1).all() and (qd[:, 4] <= 2).all()


@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_draws_by_seed_do_not_know_the_world(scattered, precision):
    scattered.randomize(params={"joint_q_noise": {"arm": tl.Uniform(0.01, 0.1)}})
    fields, torque = ("joint_q", "joint_qd", "joint_q_measured"), np.full(8, 0.2)

    def play(worlds: int, draws: str, seed: int | list[int]) -> NDArray[np.float64]:
        """(episodes and frames, worlds, numbers)"""
        with tl.launch(scattered, worlds=worlds, precision=precision, draws=draws, fields=fields) as sim:
            assert sim.info["draws"] == draws
            frames = []
            for episode in range(2):
                sim.reset(seed=seed if episode == 0 else None)
                frames += [sim.step(joint_f=torque).copy() for _ in range(3)]
        return np.array([np.concatenate([getattr(frame, name) for name in fields], axis=1) for frame in frames])

    seeds = [1, 2, 3, 4, 5, 77, 77, 8]
    many, alone = play(8, "seed", seeds), play(1, "seed", 77)
    assert np.array_equal(many[:, 5], alone[:, 0]) and np.array_equal(many[:, 6], alone[:, 0])
    for world in (0, 1, 2, 3, 4, 7):
        assert not (many[:, world] == alone[:, 0]).all(axis=1).any()
    by_number = play(8, "world", seeds)
    assert not (by_number[:, 5] == by_number[:, 6]).all(axis=1).any()
    # one seed for all gives all of them the same
    same = play(4, "seed", 77)
    assert (same == alone).all()
    with pytest.raises(tl.ArgumentError, match=r"draws.*use world or seed"):
        tl.launch(scattered, worlds=1, draws="both")


@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_a_seed_gives_the_same_starts_again(scattered, precision):
    with tl.launch(scattered, worlds=21, precision=precision) as sim:
        launch = state(sim.forward())
        episodes = [launch]
        for _ in range(3):
            sim.step(joint_f=np.full(8, 0.1))
            episodes.append(state(sim.reset()))
        for i, episode in enumerate(episodes):
            assert len(np.unique(episode[:, 0])) == 21, "each world has its own"
            for other in episodes[:i]:
                assert (episode[:, :2] != other[:, :2]).all()
        assert np.array_equal(state(sim.reset(seed=0)), launch)
        for episode in episodes[1:]:
            assert np.array_equal(state(sim.reset()), episode)
        other = state(sim.reset(seed=2**64 - 1))
        assert (other[:, :2] != launch[:, :2]).all()
    # neither worlds nor threads matter, and precision only rounds
    with tl.launch(scattered, worlds=300, threads=1, precision="f64") as sim:
        many = state(sim.forward())[:21]
        expected = many if precision == "f64" else many.astype(np.float32)
        assert np.array_equal(launch, expected)


def test_a_mask_spares_the_others_and_their_seeds(scattered):
    mask = np.arange(10) % 3 == 1
    with tl.launch(scattered, worlds=10) as sim:
        sim.reset(seed=5)
        first = state(sim.step())
        frame = sim.reset(mask=mask)
        assert frame.step.tolist() == np.where(mask, 0, 1).tolist()
        assert np.array_equal(state(frame)[~mask], first[~mask])
        assert (state(frame)[mask, :2] != first[mask, :2]).all()
        episode_1 = state(frame)[mask]
        # the same seed for some: only they begin with its first episode
        sim.reset(mask=mask, seed=5)
        after = state(sim.reset())
        assert np.array_equal(after[mask], episode_1)
        sim.reset(seed=5)
        assert np.array_equal(state(sim.reset()), after), "the others were in their first episode"


def test_each_world_takes_a_seed_of_its_own(scattered):
    with tl.launch(scattered, worlds=6) as sim:
        starts = [state(sim.reset(seed=seed)) for seed in range(3)]
        for seeds in ([0, 1, 2] * 2, np.arange(6, dtype=np.int32) % 3, (0, 1, 2, 0, 1, 2)):
            mixed = state(sim.reset(seed=seeds))
            for world in range(6):
                assert np.array_equal(mixed[world], starts[world % 3][world])


def test_commands_after_a_reset_are_the_scenes(scattered):
    scattered.robots["arm"].joint_target_ke = 50
    targets = ("joint_q", "joint_f", "joint_target_q")
    with tl.launch(scattered, worlds=4, fields=targets) as sim:
        sim.step(joint_f=np.full(8, 0.1), joint_target_q={"arm": [1.0, 1.0]})
        frame = sim.reset()
        assert not frame.joint_f.any()
        np.testing.assert_array_equal(frame.joint_target_q[:, :2], np.tile(START.astype(np.float32), (4, 1)))


def test_limits_clamp_and_mimic_joints_follow(lesson):
    scene = lesson(driven=False)
    scene.randomize(joint_q={"arm": tl.Uniform(-3, 3)})
    with tl.launch(scene, worlds=200, precision="f64") as sim:
        q = np.array(sim.forward().joint_q)
    lower, upper = np.array([joint for joint in scene.robots["arm"]._summary["joint_range"]]).T
    assert (q[:, :8] >= lower[:8]).all() and (q[:, :8] <= upper[:8]).all()
    assert (q[:, 7] == 0).any() and (q[:, 7] == 0.04).any()
    np.testing.assert_allclose(q[:, 8], q[:, 7], atol=1e-16)


def test_a_floating_robot_is_moved_by_body_q(pendulum_urdf):
    mass = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
    text = pendulum_urdf.read_text()
    pendulum_urdf.write_text(text.replace('<link name="base"/>', f'<link name="base">{mass}</link>'))
    scene = tl.Scene()
    scene.add_urdf(pendulum_urdf, name="dog", floating=True, pos=(0, 0, 5))
    scene.randomize(body_q={"dog": {"z": tl.Uniform(1, 1), "roll": tl.Uniform(0.2, 0.2)}})
    with tl.launch(scene, worlds=2, precision="f64") as sim:
        expected = [0, 0, 6, math.sin(0.1), 0, 0, math.cos(0.1), 0, 0]
        np.testing.assert_allclose(sim.forward().joint_q, [expected] * 2, atol=1e-15)


@pytest.mark.parametrize(
    ("seed", "named"),
    [
        (-1, r"seed is -1; give a whole number from 0"),
        (2**64, r"seed is 18446744073709551616; give"),
        (1.0, r"seed is 1\.0; give a whole number"),
        (True, r"seed is True; give"),
        (np.True_, r"seed is .*True.*; give"),
        ("7", r"seed is '7'; give"),
        ([1, 2], r"seed: 2 seeds for 3 worlds; give one, or one per world"),
        ([], r"seed: 0 seeds for 3 worlds"),
        ([1, -2, 3], r"seed of world 1 is -2; give"),
        ([1, 2, 3.0], r"seed of world 2 is 3\.0"),
        (np.zeros(3), r"seed of world 0 is .*0\.0"),
        (np.zeros((3, 1), dtype=int), r"seed of world 0 is array"),
        ({"arm": 1}, r"seed is \{'arm': 1\}"),
    ],
    ids=str,
)
def test_a_wrong_seed_is_refused_by_name_and_nothing_is_reset(scattered, seed, named):
    with tl.launch(scattered, worlds=3) as sim:
        before = state(sim.step())
        with pytest.raises(tl.CommandRefused, match=named):
            sim.reset(seed=seed)
        assert np.array_equal(state(sim.forward()), before)
        assert np.array_equal(sim.forward().step, [1, 1, 1])


def test_a_scene_without_distributions_starts_alike_under_any_seed(pendulum):
    with tl.launch(pendulum, worlds=3, precision="f64") as sim:
        for frame in (sim.forward, sim.reset, lambda: sim.reset(seed=3)):
            assert frame().joint_q.tolist() == [START.tolist()] * 3


def test_the_daemon_tells_the_scenes_it_draws_from(scattered, pendulum_urdf):
    plain = tl.Scene(dt=1 / 480, substeps=4)
    plain.add_urdf(pendulum_urdf, name="arm").joint_q = START
    plain.add_cube(pos=(1, 2, 3))
    with tl.launch(scattered, worlds=1) as drawn, tl.launch(plain, worlds=1) as same:
        assert "normal = [0.0, 0.05]" in drawn.info["scene"]
        assert drawn.info["model_hash"] != same.info["model_hash"]
        assert drawn.dynamics is not None, "the daemon's scene is read again"


@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_a_reset_to_states_is_a_reset_and_a_write(scattered, precision):
    rng = np.random.default_rng(0)
    mask = np.array([True, False, True, True, False])
    frames = []
    with tl.launch(scattered, worlds=5, precision=precision) as sim:
        joint_q = rng.normal(size=sim.reset(seed=3).joint_q.shape)
        joint_qd = {"arm": rng.normal(size=(5, 2))}
        for in_one in (True, False):
            sim.reset(seed=7)
            sim.step(joint_f=np.ones(8))
            if in_one:
                frame = sim.reset(mask=mask, seed=9, joint_q=joint_q, joint_qd=joint_qd)
            else:
                sim.reset(mask=mask, seed=9)
                frame = sim.write(joint_q=joint_q, joint_qd=joint_qd, mask=mask)
            frames.append([state(frame), frame.time.copy(), state(sim.step()), state(sim.reset(mask=mask))])
    for one, two in zip(*frames, strict=True):
        np.testing.assert_array_equal(one, two)
    assert (frames[0][1] == 0).tolist() == mask.tolist()


def test_a_reset_to_wrong_states_changes_nothing(pendulum):
    with tl.launch(pendulum, worlds=2) as sim:
        before = state(sim.step(joint_f=np.ones(2)))
        with pytest.raises(tl.CommandRefused, match="joint_q"):
            sim.reset(joint_q=np.full((2, 2), np.nan))
        with pytest.raises(tl.CommandRefused, match="joint_qd"):
            sim.reset(joint_qd=np.zeros((3, 2)))
        np.testing.assert_array_equal(state(sim.forward()), before)
        with pytest.raises(tl.ArgumentError, match="joint_q and joint_qd beside a keyframe"):
            sim.reset(keyframe=0, joint_q=np.zeros(2))
