"""Observations that are dicts: images have their shapes and types, and the numbers are those of one array."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Dict
from gymnasium.utils.env_checker import check_env
from test_observations import HEIGHT, WIDTH, Watch

from tightloop.env import Env, Observed, VectorEnv, policy_metadata
from tightloop.errors import ArgumentError

PIXELS = HEIGHT * WIDTH


class Seeing(Watch):
    """A cart pole whose images have a shape."""

    def observed(self) -> Sequence[Observed]:
        return [
            Observed("depth", 0, 5, unit="m", shape=(HEIGHT, WIDTH), history=2),
            Observed("positions", -3, 3, 2, history=3),
            Observed("rgb", 0, 255, shape=[HEIGHT, WIDTH, 3], history=2),
        ]

    def observe(self, xp: Any, worlds: Any) -> Sequence[Any]:
        return worlds.side_depth, worlds.joint_q, worlds.side_rgb


@pytest.fixture
def make() -> Iterator[Callable[..., VectorEnv]]:
    made: list[VectorEnv] = []

    def make(task: Any = Seeing, worlds: int = 3, **options: Any) -> VectorEnv:
        made.append(VectorEnv(task, worlds, **options))
        return made[-1]

    yield make
    for envs in made:
        envs.close()


def as_dict(flat: Any) -> dict[str, Any]:
    """What a dict has of observations that are one array."""
    depth, state, rgb = np.split(flat, np.cumsum([2 * PIXELS, 6]), axis=1)
    shape = (len(flat), 2, HEIGHT, WIDTH)
    return {"state": state, "depth": depth.reshape(shape), "rgb": rgb.reshape(*shape, 3).astype(np.uint8)}


@pytest.mark.parametrize("mode", ["NEXT_STEP", "SAME_STEP"])
@pytest.mark.parametrize("copy", [True, False])
def test_a_dict_has_the_numbers_of_one_array(make: Callable[..., VectorEnv], mode: str, *, copy: bool) -> None:
    flat, whole = (make(autoreset_mode=mode, copy=copy, dict_observations=as_dict) for as_dict in (False, True))
    space = whole.single_observation_space
    assert isinstance(space, Dict) and [*space] == ["depth", "rgb", "state"]
    seen = [envs.reset(seed=4)[0] for envs in (flat, whole)]
    draws = np.random.default_rng(0)
    for _ in range(13):  # over the ends of episodes
        for name, array in as_dict(seen[0]).items():
            assert seen[1][name].dtype == array.dtype == (np.uint8 if name == "rgb" else np.float32)
            assert np.array_equal(seen[1][name], array), name
        assert whole.observation_space.contains(seen[1])
        action = draws.uniform(-1, 1, (3, 1))
        (one, *_, infos), (other, *_, others) = flat.step(action), whole.step(action)
        seen = [one, other]
        if "final_obs" in infos:
            for name, array in as_dict(infos["final_obs"]).items():
                assert np.array_equal(others["final_obs"][name], array), name
    assert seen[1]["rgb"].max() > 50 and not np.array_equal(seen[1]["depth"][:, 0], seen[1]["depth"][:, 1])
    assert policy_metadata(flat) == policy_metadata(whole)


def test_a_single_environment_passes_the_check_of_gymnasium() -> None:
    env = Env(Seeing, dict_observations=True)
    try:
        check_env(env, skip_render_check=True)
        obs, _ = env.reset(seed=1)
        assert obs["depth"].shape == (2, HEIGHT, WIDTH) and obs["rgb"].dtype == np.uint8
    finally:
        env.close()


def test_gymnasium_makes_environments_whose_observations_are_dicts() -> None:
    envs = gymnasium.make_vec("tightloop/FrankaPickCubeDepth-v0", num_envs=2, dict_observations=True)
    try:
        obs, _ = envs.reset(seed=1)
        assert obs["depth"].shape == (2, 64, 64) and obs["state"].shape == (2, 29)
    finally:
        envs.close()


def test_a_task_without_images_has_its_state_alone(make: Callable[..., VectorEnv]) -> None:
    flat, whole = (make("CartPoleBalance", 2, dict_observations=as_dict) for as_dict in (False, True))
    (one, _), (other, _) = flat.reset(seed=2), whole.reset(seed=2)
    assert [*other] == ["state"] and np.array_equal(one, other["state"])


def wrong_task(parts: Sequence[Observed], arrays: Callable[[Any], Any]) -> type[Watch]:
    class Wrong(Watch):
        def observed(self) -> Sequence[Observed]:
            return parts

        def observe(self, xp: Any, worlds: Any) -> Sequence[Any]:
            return arrays(worlds)

    return Wrong


IMAGE = (HEIGHT, WIDTH)
WRONG: list[tuple[list[Observed], Callable[[Any], Any], bool, str]] = [
    ([Observed("state", 0, 5, shape=IMAGE)], lambda w: (w.side_depth,), True, "names of their own, other than 'state'"),
    ([Observed("a", 0, 5, shape=IMAGE)] * 2, lambda w: (w.side_depth,) * 2, True, "names of their own"),
    (
        [Observed("a", 0, 255, shape=IMAGE)],
        lambda w: (w.side_depth,),
        True,
        "`a` is float32; .* give an array of uint8",
    ),
    (
        [Observed("a", 0, 255, shape=IMAGE)],
        lambda w: (w.side_rgb,),
        True,
        r"`a` has shape \(3, 12, 20, 3\).*\(3, 12, 20\)",
    ),
    ([Observed("a", 0, 5, shape=IMAGE)], lambda w: (w.side_depth[:, :5],), True, r"`a` has shape \(3, 5, 20\)"),
    ([Observed("a", 0, 5, shape=IMAGE)], lambda w: (w.side_depth[:, :5],), False, r"`observed` says \(3, 12, 20\)"),
    ([Observed("a", 0, 5, shape=IMAGE)], lambda w: w.side_depth, True, "got one array; return a tuple of the 1 parts"),
    (
        [Observed("a", 0, 5, shape=IMAGE)],
        lambda w: {"a": w.side_depth},
        True,
        "got dict; return a tuple of the 1 parts",
    ),
    (
        [Observed("q", -3, 3, 2), Observed("a", 0, 5, shape=IMAGE)],
        lambda w: (w.joint_q, np.where(w.elapsed[:, None, None] == 2, np.nan, w.side_depth)),
        True,
        "Wrong.observe: `a` is NaN",
    ),
]


@pytest.mark.parametrize(("parts", "arrays", "as_dict", "message"), WRONG)
def test_what_is_wrong_with_an_image_is_named(
    make: Callable[..., VectorEnv],
    parts: list[Observed],
    arrays: Callable[[Any], Any],
    message: str,
    *,
    as_dict: bool,
) -> None:
    with pytest.raises(ArgumentError, match=message):
        envs = make(wrong_task(parts, arrays), dict_observations=as_dict)
        envs.reset(seed=1)
        for _ in range(3):
            envs.step(np.zeros((3, 1)))


def test_nan_in_an_image_faults_its_world(make: Callable[..., VectorEnv]) -> None:
    def arrays(worlds: Any) -> Sequence[Any]:
        wrong = (worlds.elapsed == 2) & (np.arange(3) == 1)
        return worlds.joint_q, np.where(wrong[:, None, None], np.nan, worlds.side_depth)

    task = wrong_task([Observed("q", -3, 3, 2), Observed("a", 0, 5, shape=IMAGE)], arrays)
    envs = make(task, dict_observations=True, on_nan="fault")
    envs.reset(seed=1)
    _, _, terminated, *_ = envs.step(np.zeros((3, 1)))
    assert not terminated.any()
    obs, _, terminated, _, infos = envs.step(np.zeros((3, 1)))
    assert terminated.tolist() == [False, True, False]
    assert infos["fault"].tolist() == [0, 16, 0]
    assert not obs["a"][1].any() and not obs["state"][1].any() and obs["a"][[0, 2]].any()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"shape": "64"}, "`a`: shape is '64'; give lengths"),
        ({"shape": ()}, "`a`: shape is"),
        ({"shape": (64, 0)}, "`a`: shape is 0"),
        ({"shape": (64, 1.5)}, "`a`: shape is 1.5"),
        ({"shape": (64, 64), "size": 7}, r"size is 7, and shape \(64, 64\) has 4096; leave size out"),
        ({"shape": (4096, 4096)}, "size is 16777216; give at most"),
    ],
)
def test_a_wrong_shape_is_named(given: dict[str, Any], message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        Observed("a", 0, 1, **given)
