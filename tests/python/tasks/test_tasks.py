"""The tasks: functions as documented, true bounds, worlds by seeds, no allocation; and that they can be done."""

from __future__ import annotations

import math
import tracemalloc
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from reference_tasks import PLAIN, any_worlds, one
from scripted_policies import Lift, PickCube, PushCube

from tightloop.env import VectorEnv, Worlds
from tightloop.env.evaluation.array_pool import ArrayPool
from tightloop.env.evaluation.observations import ObservationPacker
from tightloop.env.registry import TASKS
from tightloop.tasks.franka import CONTROLS

WORLDS = 64
# Some ten roundings of float32 on the way, of numbers up to this
REWARDS = {"FrankaLift": 40.0}
TOLERANCE = 10 * 2.0**-24


@pytest.fixture(params=TASKS)
def envs(request: pytest.FixtureRequest) -> Iterator[Any]:
    made = VectorEnv(request.param, WORLDS, autoreset_mode="SAME_STEP")
    yield made
    made.close()


def name(envs: Any) -> str:
    return type(envs.task).__name__


def test_functions_are_those_of_the_documents(envs: Any) -> None:
    worlds, plain = any_worlds(envs, 4096, seed=1), PLAIN[name(envs)]
    low, high = envs.single_observation_space.low, envs.single_observation_space.high
    obs = np.empty((4096, len(low)), np.float32)
    ObservationPacker(envs.task.observed()).pack(envs.task.observe(np, worlds), obs)
    reward, success = envs.task.reward(np, worlds), envs.task.success(np, worlds)
    terminated = envs.task.terminated(np, worlds)
    told = [plain(one(worlds, world)) for world in range(4096)]

    expected = np.clip(np.array([each.obs for each in told]), low, high)
    scale = max(1.0, float(np.abs(expected).max()))
    np.testing.assert_allclose(obs, expected, rtol=0, atol=TOLERANCE * scale)
    # what is on the edge of a special case may fall on either side
    certain = np.ones(4096, bool)
    for said, what in ((success, "success"), (terminated, "terminated")):
        answers = np.array([getattr(each, what) for each in told])
        if said is None:
            assert not answers.any()
            continue
        certain &= said == answers
        assert 0 < answers.sum() < 4096, f"{what}: the states have both"
    assert (~certain).sum() <= 2
    atol = TOLERANCE * REWARDS.get(name(envs), 2.0)
    np.testing.assert_allclose(reward[certain], np.array([e.reward for e in told])[certain], rtol=0, atol=atol)


def test_observations_are_within_their_bounds_and_are_seldom_cut_off_there(envs: Any) -> None:
    rng = np.random.default_rng(2)
    obs, _ = envs.reset(seed=3)
    low, high = envs.single_observation_space.low, envs.single_observation_space.high
    cut = np.zeros(len(low))
    for _ in range(200):
        assert envs.observation_space.contains(obs)
        whole = np.concatenate([np.reshape(part, (WORLDS, -1)) for part in envs.evaluation.call("observe")], 1)
        # the length of a quaternion is 1 to rounding
        cut += ((whole < low - 1e-6) | (whole > high + 1e-6)).mean(0) / 200
        obs, reward, _, _, infos = envs.step(rng.uniform(-1, 1, envs.action_space.shape).astype(np.float32))
        assert np.isfinite(reward).all()
        assert "fault" not in infos
    assert cut.max() < 0.01, f"number {cut.argmax()} in {cut.max():.0%}"


def test_a_world_is_a_function_of_its_seed(envs: Any) -> None:
    rng = np.random.default_rng(4)
    actions = rng.uniform(-1, 1, (60, *envs.action_space.shape)).astype(np.float32)
    obs, _ = envs.reset(seed=100)
    seen = [(obs, np.zeros(WORLDS, np.float32))]
    for action in actions:
        obs, reward, *_ = envs.step(action)
        seen.append((obs, reward))
    for world in (0, 17, WORLDS - 1):
        alone: Any = VectorEnv(name(envs), 1, autoreset_mode="SAME_STEP")
        obs, _ = alone.reset(seed=100 + world)
        for step, action in enumerate(actions):
            assert obs[0].tobytes() == seen[step][0][world].tobytes(), f"step {step}"
            obs, reward, *_ = alone.step(action[world : world + 1])
            assert reward[0].tobytes() == seen[step + 1][1][world].tobytes(), f"step {step}"
        alone.close()


def test_functions_on_an_arena_take_no_memory_of_the_size_of_the_worlds(envs: Any) -> None:
    # a copy of images is seen with fewer worlds
    sees = max(math.prod(part.shape or ()) for part in envs.task.observed())
    many, pool = 65536 if sees == 1 else 2048, ArrayPool()
    first, second = any_worlds(envs, many, seed=5), any_worlds(envs, many, seed=6)
    pooled = Worlds(**{field: wrapped(pool, array) for field, array in vars(first).items()})
    # an array of one number per world, or of an image, is 256 kB or more. NumPy's own buffers, for what has another
    # type or no even stride, are of 8192 numbers for each of up to three operands, and go when the operation ends
    least, buffers = 4 * many * sees, 3 * 4 * 8192
    for function in ("observe", "reward", "success", "terminated"):
        call, tape = getattr(envs.task, function), []
        for _ in range(2):
            pool.play(tape)
            call(np, pooled)
        tracemalloc.start()
        pool.play(tape)
        call(np, pooled)
        kept, most = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert most < buffers < least / 2, f"{function} takes {most} bytes"
        assert kept < least / 8, f"{function} keeps {kept} bytes"
        for field, array in vars(second).items():
            overwrite(getattr(first, field), array)
        pool.play(tape)
        same(call(np, pooled), call(np, second))


def wrapped(pool: ArrayPool, array: Any) -> Any:
    """An array in the pool, or all arrays of a memory."""
    if isinstance(array, dict):
        return {name: pool.wrap(part) for name, part in array.items()}
    return pool.wrap(array)


def overwrite(array: Any, new: Any) -> None:
    for name in new if isinstance(new, dict) else ():
        np.copyto(array[name], new[name])
    if not isinstance(new, dict):
        np.copyto(array, new)


def same(pooled: Any, plain: Any) -> None:
    """The bits are the same; of an array, or of several."""
    if isinstance(plain, tuple):
        for one_of, other in zip(pooled, plain, strict=True):
            same(one_of, other)
    elif plain is not None:
        assert np.asarray(pooled).tobytes() == plain.tobytes()


@pytest.mark.parametrize("task", [name for name in TASKS if name.startswith("Franka")])
@pytest.mark.parametrize("control", CONTROLS)
def test_every_control_moves_the_arm(task: str, control: str) -> None:
    envs: Any = VectorEnv(task, 2, control=control, autoreset_mode="DISABLED")
    obs, _ = envs.reset(seed=[6, 6])
    action = np.zeros(envs.action_space.shape, np.float32)
    action[1, 0] = 1.0
    for _ in range(5):
        obs, *_ = envs.step(action)
    envs.close()
    assert np.abs(obs[1, :7] - obs[0, :7]).max() > 0.01


@pytest.mark.parametrize(
    "task, policy", [("FrankaPickCube", PickCube), ("FrankaPushCube", PushCube), ("FrankaLift", Lift)]
)
def test_a_policy_by_hand_succeeds(task: str, policy: Any) -> None:
    envs: Any = VectorEnv(task, WORLDS, autoreset_mode="DISABLED")
    reward, truncated, success = np.zeros(WORLDS), np.zeros(WORLDS, bool), np.zeros(WORLDS, bool)
    obs, _ = envs.reset(seed=7)
    act = policy(envs, obs.astype(np.float64))
    for step in range(envs.max_episode_steps):
        obs, reward, terminated, truncated, infos = envs.step(act(obs.astype(np.float64), step))
        success = infos["success"]
        assert not terminated.any()
    envs.close()
    assert truncated.all()
    assert success.mean() > 0.95
    assert np.min(reward[success]) >= {"FrankaLift": 36.0}.get(task, 1.0)


def test_a_cube_that_is_held_stays_where_it_is_in_the_hand() -> None:
    envs: Any = VectorEnv("FrankaPickCube", WORLDS, autoreset_mode="DISABLED", max_episode_steps=np.inf)
    obs, _ = envs.reset(seed=7)
    act, places = PickCube(envs, obs.astype(np.float64)), []
    for step in range(200):
        obs, *_ = envs.step(act(obs.astype(np.float64), step))
        tcp, cube = obs[:, 19:26].astype(np.float64), obs[:, 29:32]
        places.append(turned_back(tcp[:, 3:], cube - tcp[:, :3]))
    envs.close()
    assert obs[:, 18].all()
    # 30 N press a pad 0.74 mm into the cube
    assert np.max(0.02 - obs[:, 7:9].mean(1)) < 1e-3
    # friction with an impratio of 10 creeps by 0.2 mm in these 5 s
    assert np.linalg.norm(places[-1] - places[-101], axis=1).max() < 5e-4


def turned_back(quats: Any, vectors: Any) -> Any:
    """The vectors in the axes of frames with these orientations."""
    axis = -quats[:, :3]
    twice = 2.0 * np.cross(axis, vectors)
    return vectors + quats[:, 3:] * twice + np.cross(axis, twice)
