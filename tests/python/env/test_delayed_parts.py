"""Parts of observations that come late: by a fixed number of steps, or one for each world and episode."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tightloop.env import Observed, VectorEnv
from tightloop.errors import ArgumentError
from tightloop.planning.policy_terms import Values
from tightloop.tasks.cartpole import CartPoleBalance

LEAST, MOST, HISTORY, STEPS = 1, 3, 2, 12


class Late(CartPoleBalance):
    """Observes its positions now, two steps late, and late by a number that differs."""

    max_episode_steps = STEPS

    def observed(self) -> Sequence[Observed]:
        return [
            Observed("now", -9, 9, 2),
            Observed("image", -9, 9, shape=(1, 2), delay=(0, MOST)),
            Observed("late", -9, 9, 2, delay=2),
            Observed("drawn", -9, 9, 2, delay=(LEAST, MOST), history=HISTORY),
        ]

    def observe(self, xp: Any, worlds: Any) -> Sequence[Any]:
        return (worlds.joint_q, worlds.joint_q[:, None], worlds.joint_q, worlds.joint_q)

    def privileged_observed(self) -> Sequence[Observed]:
        return [Observed("late", -9, 9, 2, delay=[0, 2])]

    def privileged_observe(self, xp: Any, worlds: Any) -> Sequence[Any]:
        return (worlds.joint_q,)


@pytest.fixture(params=["SAME_STEP", "NEXT_STEP"])
def mode(request: pytest.FixtureRequest) -> Iterator[str]:
    yield request.param


def played(worlds: int, mode: str, **options: Any) -> list[tuple[Any, NDArray[Any], NDArray[Any]]]:
    """Observations, what the critic sees, and the steps of each world's episode, over two episodes."""
    envs = VectorEnv(Late, worlds, autoreset_mode=mode, **options)
    shown = []
    try:
        obs, infos = envs.reset(seed=3)
        for step in range(2 * STEPS):
            shown.append((obs, infos["privileged"], envs.elapsed.copy()))
            obs, *_, infos = envs.step(np.full((worlds, 1), np.cos(step)))
    finally:
        envs.close()
    return shown


def delays(shown: Sequence[tuple[Any, NDArray[Any], NDArray[Any]]], columns: slice, most: int) -> NDArray[np.intp]:
    """By how much the values of an episode are late in each world; it asserts that there is one such number."""
    now = np.array([obs[:, :2] for obs, _, _ in shown])
    late = np.array([obs[:, columns] for obs, _, _ in shown])
    steps = np.arange(len(now))
    fits = [(late == now[np.maximum(steps - delay, 0)]).all(axis=(0, 2)) for delay in range(most + 1)]
    assert (np.sum(fits, axis=0) == 1).all()
    return np.argmax(fits, axis=0)


def test_values_are_late_by_the_number_of_their_world_and_episode(mode: str) -> None:
    shown, worlds = played(64, mode), 64
    begins = [step for step, (_, _, elapsed) in enumerate(shown) if (elapsed == 0).all()]
    assert len(begins) == 2
    drawn = []
    for begin in begins:
        episode = shown[begin : begin + STEPS]
        assert (delays(episode, slice(4, 6), 2) == 2).all()
        of_now, of_image = delays(episode, slice(8, 10), MOST), delays(episode, slice(2, 4), MOST)
        drawn.append(of_now)
        assert set(of_now) == {1, 2, 3} and set(of_image) == {0, 1, 2, 3}
        assert min(np.bincount(of_now)[1:]) > worlds / 8
        # its history is of what came late
        oldest = np.array([obs[:, 6:8] for obs, _, _ in episode])
        newest = np.array([obs[:, 8:10] for obs, _, _ in episode])
        assert np.array_equal(oldest[1:], newest[:-1])
        critic = [(np.concatenate([obs[:, :2], seen], 1), seen, elapsed) for obs, seen, elapsed in episode]
        assert set(delays(critic, slice(2, 4), 2)) == {0, 1, 2}
    assert (drawn[0] != drawn[1]).any()


def test_delays_depend_on_seed_and_episode_alone() -> None:
    many, few = played(64, "SAME_STEP"), played(3, "SAME_STEP")
    for (obs, seen, _), (other, others, _) in zip(many, few, strict=True):
        assert np.array_equal(obs[:3], other) and np.array_equal(seen[:3], others)


def test_a_dict_has_the_same_delays() -> None:
    flat, whole = played(16, "SAME_STEP"), played(16, "SAME_STEP", dict_observations=True)
    for (obs, _, _), (other, _, _) in zip(flat, whole, strict=True):
        assert np.array_equal(np.delete(obs, slice(2, 4), 1), other["state"])
        assert np.array_equal(obs[:, 2:4], other["image"][:, 0])


def test_a_reset_of_some_worlds_begins_their_delays_alone() -> None:
    envs = VectorEnv(Late, 3, autoreset_mode="DISABLED")
    try:
        envs.reset(seed=3)
        before = [envs.step(np.ones((3, 1)))[0] for _ in range(5)]
        obs, _ = envs.reset(options={"reset_mask": np.array([False, True, False])})
        now = obs[1, :2]
        assert all(np.array_equal(obs[1, place : place + 2], now) for place in range(2, 10, 2))
        assert np.array_equal(obs[[0, 2]], before[-1][[0, 2]])
        # two steps late: the first of the new episode, and what the others had
        obs, *_ = envs.step(np.ones((3, 1)))
        assert np.array_equal(obs[1, 4:6], now) and np.array_equal(obs[[0, 2], 4:6], before[-2][[0, 2], :2])
    finally:
        envs.close()


def test_values_of_double_precision_come_late_as_they_are() -> None:
    class Double(Late):
        dtype = np.float64

    envs = VectorEnv(Double, 2, precision="f64", copy=False, slots=2)
    try:
        seen = [envs.reset(seed=1)[0].copy(), *(envs.step(np.ones((2, 1)))[0].copy() for _ in range(6))]
        assert all(np.array_equal(late[:, 4:6], now[:, :2]) for now, late in zip(seen, seen[2:], strict=False))
        assert (seen[-1][:, :2] != seen[-1][:, :2].astype(np.float32)).all()
    finally:
        envs.close()


def test_a_state_that_is_set_has_no_past() -> None:
    class Set(Late):
        def states_of(self, qpos: Any, qvel: Any) -> Any:
            return {"joint_q": qpos, "joint_qd": qvel}

    envs = VectorEnv(Set, 2, autoreset_mode="DISABLED")
    try:
        envs.reset(seed=1)
        for _ in range(4):
            envs.step(np.ones((2, 1)))
        envs.set_state(np.zeros((2, 2)), np.zeros((2, 2)), mask=np.array([True, False]))
        obs, *_ = envs.step(np.zeros((2, 1)))
        assert all(np.array_equal(obs[0, place : place + 2], obs[0, :2]) for place in range(2, 10, 2))
        assert not np.array_equal(obs[1, 4:6], obs[1, :2])
    finally:
        envs.close()


@pytest.mark.parametrize(
    ("delay", "message"),
    [
        (-1, "delay is -1"),
        (1.5, "delay is 1.5"),
        ("2", "delay is '2'"),
        ((1, 2, 3), r"delay is \(1, 2, 3\); give control steps, or the least and the most"),
        ((3, 1), r"delay is \(3, 1\); give the least first"),
        (2**20, "delay is 1048576; give at most 1048575"),
    ],
)
def test_a_wrong_delay_is_named(delay: Any, message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        Observed("a", -1, 1, delay=delay)


def test_a_part_that_is_late_has_no_term_for_rollouts() -> None:
    source = Values("joint_q", of="cart")
    assert Observed("a", -1, 1, 2, source=source).term is not None
    assert Observed("a", -1, 1, 2, source=source, delay=1).term is None
