"""gymnasium's MuJoCo tasks v5 beside gymnasium's own environments, from the same states.

Steps come in windows. Both sides are set to the state at the beginning of a window and then run on by themselves, so
that what lags from step to step is compared too. A window is as long as rounding keeps MuJoCo beside itself: 1000
steps where nothing touches.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import gymnasium
import mujoco
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from numpy.typing import NDArray

from tiers import sweep
from tightloop.env import VectorEnv
from tightloop.env.registry import GYMNASIUM_TASKS, make_task
from tightloop.errors import ArgumentError, CommandRefused, MissingLibrary, SignatureError

STEPS = 1000
#: Length of the windows.
WINDOWS = {
    "Ant-v5": 4,
    "HalfCheetah-v5": 4,
    "Hopper-v5": 10,
    "Walker2d-v5": 10,
    "Swimmer-v5": 1000,
    "InvertedPendulum-v5": 5,
    "InvertedDoublePendulum-v5": 5,
    "Reacher-v5": 100,
    "Pusher-v5": 5,
    "Humanoid-v5": 2,
    "HumanoidStandup-v5": 2,
}
NAMES = sorted(GYMNASIUM_TASKS)
#: What rounding to float32 amounts to in the evaluations of a step.
NOISE = 1e-6
#: Options that show or leave out parts of the observation, and more.
OTHERS = [
    ("Ant-v5", {"include_cfrc_ext_in_observation": False, "exclude_current_positions_from_observation": False}),
    ("Ant-v5", {"contact_force_range": (-3.0, 2.0), "main_body": 2, "frame_skip": 2, "healthy_z_range": (0.6, 0.8)}),
    ("HalfCheetah-v5", {"exclude_current_positions_from_observation": False, "forward_reward_weight": 2.0}),
    ("Hopper-v5", {"terminate_when_unhealthy": False, "healthy_state_range": (-1.0, 1.0), "healthy_reward": 3.0}),
    ("Walker2d-v5", {"healthy_z_range": (1.2, 1.26), "healthy_angle_range": (-0.1, 0.1), "ctrl_cost_weight": 0.5}),
    ("Swimmer-v5", {"exclude_current_positions_from_observation": False, "frame_skip": 1}),
    ("Reacher-v5", {"reward_dist_weight": 2.0, "reward_control_weight": 0.5}),
    ("Pusher-v5", {"reward_near_weight": 2.0, "reward_dist_weight": 3.0, "reward_control_weight": 0.5}),
    ("InvertedDoublePendulum-v5", {"healthy_reward": 3.0, "frame_skip": 1}),
    ("Humanoid-v5", {"include_cinert_in_observation": False, "include_qfrc_actuator_in_observation": False}),
    ("HumanoidStandup-v5", {"include_cvel_in_observation": False, "include_cfrc_ext_in_observation": False}),
]

Array = NDArray[Any]


class Windows:
    """Random steps in gymnasium's environment, of which episodes that end begin anew."""

    def __init__(self, env: Any, length: int) -> None:
        own = env.unwrapped
        count = STEPS // length
        self.length = length
        self.qpos, self.qvel = np.zeros((count, own.model.nq)), np.zeros((count, own.model.nv))
        self.actions = np.zeros((length, count, *env.action_space.shape), np.float32)
        env.reset(seed=0)
        env.action_space.seed(0)
        for window in range(count):
            self.qpos[window], self.qvel[window] = own.data.qpos, own.data.qvel
            for step in range(length):
                self.actions[step, window] = env.action_space.sample()
                if env.step(self.actions[step, window])[2]:
                    env.reset()
                    break

    def play(self, env: Any, noise: float = 0.0, seed: int = 0) -> Steps:
        """Play them in gymnasium's environment, from states with noise: velocities have ten times as much."""
        own, steps = env.unwrapped, Steps(self, env.observation_space.shape)
        env.reset(seed=0)
        rng = np.random.default_rng(seed)
        for window, (qpos, qvel) in enumerate(zip(self.qpos, self.qvel, strict=True)):
            shifts = [noise * rng.normal(size=state.shape) for state in (qpos, qvel)]
            own.set_state(qpos + shifts[0], qvel + 10.0 * shifts[1])
            for step in range(self.length):
                result = env.step(self.actions[step, window])
                steps.valid[step, window] = True
                steps.take(step, window, *result)
                if result[2]:
                    break
        return steps

    def play_beside(self, envs: VectorEnv) -> Steps:
        """Play them in a vector environment with a world per window."""
        steps = Steps(self, envs.single_observation_space.shape)
        envs.reset(seed=0)
        envs.set_state(self.qpos, self.qvel)
        running = np.ones(envs.num_envs, bool)
        for step in range(self.length):
            result = envs.step(self.actions[step])
            steps.valid[step] = running
            steps.take(step, slice(None), *result)
            running &= ~result[2]
        return steps


class Steps:
    """Results of the steps of all windows, (steps of a window, windows, …); valid before an episode ends."""

    def __init__(self, windows: Windows, shape: Any) -> None:
        size = windows.actions.shape[:2]
        self.obs, self.reward = np.zeros((*size, *shape)), np.zeros(size)
        self.terminated, self.valid = np.zeros(size, bool), np.zeros(size, bool)
        self.infos: dict[str, Array] = {}

    def take(self, step: int, window: Any, *result: Any) -> None:
        self.obs[step, window], self.reward[step, window], self.terminated[step, window] = result[:3]
        for name, value in result[4].items():
            if not name.startswith("_"):
                shape = np.shape(value) if isinstance(window, int) else np.shape(value)[1:]
                whole = self.infos.setdefault(name, np.zeros((*self.reward.shape, *shape)))
                whole[step, window] = value

    def apart(self, other: Steps, names: tuple[str, ...] = ()) -> Array:
        """Largest error of each step, relative to values above 1."""
        pairs = [(self.obs, other.obs), (self.reward, other.reward)]
        pairs += [(self.infos[name], other.infos[name]) for name in names]
        errors = np.zeros(self.reward.shape)
        for found, expected in pairs:
            error = np.abs(found - expected) / np.maximum(1.0, np.abs(expected))
            np.maximum(errors, error.reshape(*errors.shape, -1).max(axis=2, initial=0.0), out=errors)
        return errors


@pytest.fixture(scope="module")
def exact(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], str]:
    """Return the file of a task's model that is solved by Newton's method to the end."""
    folder = tmp_path_factory.mktemp("models")

    def write(name: str) -> str:
        file = inspect.signature(type(make_task(name, {}))).parameters["xml_file"].default
        spec = mujoco.MjSpec.from_file(str(Path(gymnasium.__file__).parent / "envs/mujoco/assets" / file))
        spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
        spec.option.tolerance = spec.option.ls_tolerance = 0.0
        spec.option.iterations = spec.option.ls_iterations = 20
        spec.compile()
        path = folder / file
        path.write_text(spec.to_xml())
        return str(path)

    return write


def compare(
    name: str, file: str, length: int, precision: str, disturbed: int = 0, **options: Any
) -> tuple[Steps, list[Steps], Steps]:
    """Return steps of gymnasium, some from states with noise, and ours."""
    with gymnasium.make(name, xml_file=file, max_episode_steps=-1, disable_env_checker=True, **options) as env:
        windows = Windows(env, length)
        expected, others = windows.play(env), [windows.play(env, NOISE, seed) for seed in range(disturbed)]
    count = len(windows.qpos)
    envs = VectorEnv(name, count, xml_file=file, precision=precision, max_episode_steps=np.inf, device="cpu", **options)
    with closing(envs):
        return expected, others, windows.play_beside(envs)


def assert_same(expected: Steps, found: Steps) -> None:
    np.testing.assert_array_equal(found.valid, expected.valid)
    np.testing.assert_array_equal(found.terminated[found.valid], expected.terminated[found.valid])
    assert found.infos.keys() == expected.infos.keys()
    errors = found.apart(expected, tuple(expected.infos))[found.valid]
    assert errors.max() < 1e-6, f"step {errors.argmax()} of {errors.size}"


@pytest.mark.parametrize("name", NAMES)
def test_a_thousand_steps_are_gymnasiums(name: str, exact: Callable[[str], str]) -> None:
    expected, _, found = compare(name, exact(name), WINDOWS[name], "f64")
    assert expected.valid.sum() > STEPS // 2
    assert_same(expected, found)


@pytest.mark.parametrize(("name", "options"), OTHERS)
def test_options_are_gymnasiums(name: str, options: dict[str, Any], exact: Callable[[str], str]) -> None:
    expected, _, found = compare(name, exact(name), 2, "f64", **options)
    assert_same(expected, found)


@pytest.mark.parametrize("name", NAMES)
def test_single_precision_is_near_while_mujoco_agrees_with_itself(name: str, exact: Callable[[str], str]) -> None:
    expected, disturbed, found = compare(name, exact(name), 1, "f32", disturbed=2)
    steady = expected.valid.copy()
    for other in disturbed:  # in other directions it may be more
        steady &= other.apart(expected) < 3e-4
    errors = found.apart(expected)[steady]
    assert errors.size > STEPS // 4, "MuJoCo does not agree with itself"
    assert errors.max() < 1e-3, f"step {errors.argmax()} of {errors.size}"


@pytest.mark.parametrize("name", NAMES)
def test_arguments_and_their_defaults_are_gymnasiums(name: str) -> None:
    own = dict(inspect.signature(type(make_task(name, {}))).parameters)
    theirs = dict(inspect.signature(gymnasium.spec(name).make().unwrapped.__class__).parameters)
    assert list(own) == list(theirs)
    for argument, parameter in theirs.items():
        # cameras belong to gymnasium's renderer
        if argument != "default_camera_config":
            assert own[argument].default == parameter.default, argument


@pytest.mark.parametrize("name", NAMES)
def test_single_environments_are_like_gymnasiums(name: str) -> None:
    with gymnasium.make(name) as theirs, gymnasium.make(f"tightloop/{name}") as own:
        assert own.observation_space == theirs.observation_space
        assert own.action_space == theirs.action_space
        assert own.spec is not None and theirs.spec is not None
        assert own.spec.max_episode_steps == theirs.spec.max_episode_steps
        for call in (lambda env: env.reset(seed=0), lambda env: env.step(np.zeros(env.action_space.shape, np.float32))):
            found, expected = call(own), call(theirs)
            assert list(found[-1]) == list(expected[-1])
            assert found[0].dtype == expected[0].dtype
            for value, known in zip(found[-1].values(), expected[-1].values(), strict=True):
                assert np.shape(value) == np.shape(known)
        own.reset(seed=0)
        check_env(own.unwrapped, skip_render_check=True)


@pytest.mark.parametrize("name", ["Ant-v5", "Hopper-v5", "InvertedPendulum-v5", "Humanoid-v5"])
def test_vector_environments_have_the_infos_of_gymnasiums(name: str) -> None:
    """Until episodes have ended and begun anew, in gymnasium's default mode."""
    theirs = gymnasium.make_vec(name, num_envs=3, vectorization_mode="sync")
    own = gymnasium.make_vec(f"tightloop/{name}", num_envs=3)
    assert own.single_observation_space == theirs.single_observation_space
    assert own.single_action_space == theirs.single_action_space
    assert own.metadata["autoreset_mode"] == theirs.metadata["autoreset_mode"]
    _, expected = theirs.reset(seed=0)
    _, found = own.reset(seed=0)
    assert found.keys() == expected.keys()
    theirs.action_space.seed(0)
    ends = np.zeros(2, int)
    for _ in range(STEPS):
        actions = theirs.action_space.sample()
        results = [envs.step(actions) for envs in (theirs, own)]
        expected, found = (result[4] for result in results)
        assert found.keys() == expected.keys()
        for infos in (found, expected):
            for mask in (mask for mask in infos if mask[0] == "_"):
                assert infos[mask].dtype == np.bool_ and len(infos[mask[1:]]) == 3
        ends += [result[2].any() for result in results]
        if (ends > 3).all():
            break
    assert ends.all(), "no episode ended"
    theirs.close()
    own.close()


def test_infos_of_a_new_episode_are_those_of_a_reset() -> None:
    for mode in ("NextStep", "SameStep"):
        envs = VectorEnv("InvertedDoublePendulum-v5", 4, autoreset_mode=mode)
        ants = VectorEnv("Ant-v5", 4, autoreset_mode=mode, max_episode_steps=3)
        _, infos = ants.reset(seed=0)
        assert infos.keys() == {name for known in type(ants.task).start_infos for name in (known, f"_{known}")}
        zero = np.zeros((4, 8), np.float32)
        for _ in range(3):
            obs, _, _, truncated, infos = ants.step(zero)
        assert truncated.all()
        if mode == "NextStep":
            assert infos["_x_velocity"].all() and infos["_x_position"].all()
            obs, _, _, _, infos = ants.step(zero)
        assert infos["_x_position"].all() and not infos["_x_velocity"].any()
        np.testing.assert_array_equal(infos["x_position"], ants.sim.forward().qpos[:, 0])
        np.testing.assert_array_equal(obs[:, 27:], 0.0)
        envs.close()
        ants.close()


@pytest.mark.parametrize("name", NAMES)
def test_episodes_start_as_gymnasiums(name: str) -> None:
    """Positions and velocities of each joint have the same distribution: two samples by Kolmogorov and Smirnov."""
    with gymnasium.make(name) as env:
        own: Any = env.unwrapped
        theirs = []
        for seed in range(400):
            env.reset(seed=seed)
            theirs.append(np.concatenate([own.data.qpos, own.data.qvel]))
        expected, free = np.array(theirs), own.model.jnt_type[0] == mujoco.mjtJoint.mjJNT_FREE
    if free:  # MuJoCo makes it unit in the first step
        expected[:, 3:7] /= np.linalg.norm(expected[:, 3:7], axis=1, keepdims=True)
    with closing(VectorEnv(name, 1000)) as envs:
        envs.reset(seed=1)
        frame = envs.sim.forward()
        found = np.concatenate([frame.qpos, frame.qvel], axis=1)
    # once in 10⁵ for two equal distributions
    most = np.sqrt(-0.5 * np.log(0.5e-5)) * np.sqrt(1 / len(expected) + 1 / len(found))
    for column in range(found.shape[1]):
        values = np.sort(np.concatenate([found[:, column], expected[:, column]]))
        if np.ptp(values) < 1e-6:
            continue
        shares = [np.searchsorted(np.sort(side[:, column]), values + 1e-7) / len(side) for side in (found, expected)]
        assert np.abs(shares[0] - shares[1]).max() < most, f"column {column}"


@pytest.mark.parametrize("name", sweep(["Humanoid-v5", "HumanoidStandup-v5"], daily=1))
def test_models_with_another_solver_have_the_same_distributions(name: str) -> None:
    """MuJoCo's PGS stops early, and Newton's method finds the minimum: random episodes are alike, not the same."""
    steps, episodes = 60, 100
    rewards, lengths = [], []
    with gymnasium.make(name, max_episode_steps=steps) as env:
        env.action_space.seed(0)
        for seed in range(episodes):
            env.reset(seed=seed)
            total, done = [], False
            while not done:
                _, reward, terminated, truncated, _ = env.step(env.action_space.sample())
                total.append(reward)
                done = terminated or truncated
            rewards.append(np.mean(total))
            lengths.append(len(total))
    with closing(VectorEnv(name, episodes, max_episode_steps=steps, autoreset_mode="Disabled")) as envs:
        envs.reset(seed=7)
        envs.action_space.seed(7)
        sums, count, runs = np.zeros(episodes), np.zeros(episodes, int), np.ones(episodes, bool)
        while runs.any():
            _, reward, terminated, truncated, _ = envs.step(envs.action_space.sample())
            sums += reward * runs
            count += runs
            done = terminated | truncated
            runs &= ~done
            if done.any() and runs.any():
                envs.reset(options={"reset_mask": done})
    for found, expected in ((sums / count, np.array(rewards)), (count, np.array(lengths))):
        spread = np.sqrt((np.var(found) + np.var(expected)) / episodes)
        assert abs(np.mean(found) - np.mean(expected)) <= 4.5 * spread, f"{np.mean(found)}, not {np.mean(expected)}"


def test_states_are_set_in_some_worlds() -> None:
    with closing(VectorEnv("Hopper-v5", 3, precision="f64")) as envs:
        envs.reset(seed=0)
        before = envs.sim.forward().qpos.copy()
        qpos, qvel = np.array([0.0, 1.3, 0.1, 0.0, 0.0, 0.0]), np.zeros(6)
        envs.set_state(qpos, qvel, mask=np.array([False, True, False]))
        after = envs.sim.forward().qpos
        np.testing.assert_array_equal(after[[0, 2]], before[[0, 2]])
        np.testing.assert_allclose(after[1], qpos)
        with pytest.raises(ArgumentError, match=r"set_state: qpos has \(5,\) values per world .* give 6 and 6"):
            envs.set_state(qpos[:5], qvel)
        with pytest.raises(ArgumentError, match="give a row for each of 3 worlds"):
            envs.set_state(np.zeros((2, 6)), qvel)
        with pytest.raises(ArgumentError, match=r"set_state: mask is .* give bools"):
            envs.set_state(qpos, qvel, mask=np.zeros(3, bool))
    with gymnasium.make("tightloop/Swimmer-v5") as env:
        own: Any = env.unwrapped
        with pytest.raises(CommandRefused, match="set_state: no episode has begun; call reset first"):
            own.set_state(np.zeros(5), np.zeros(5))
        env.reset(seed=0)
        own.set_state(np.full(5, 0.5), np.zeros(5))
        assert env.step(np.zeros(2, np.float32))[4]["x_position"] == pytest.approx(0.5, abs=0.05)
    with closing(VectorEnv("CartPoleBalance", 1)) as envs:
        envs.reset()
        with pytest.raises(ArgumentError, match="task CartPoleBalance has no `states_of`"):
            envs.set_state(np.zeros(2), np.zeros(2))


def test_what_is_missing_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match=r"xml_file is 'no.xml', and there is no file .*no\.xml"):
        make_task("Ant-v5", {"xml_file": "no.xml"})
    with pytest.raises(ArgumentError, match="the model has no body 'tail'"):
        make_task("Ant-v5", {"main_body": "tail"})
    with pytest.raises(ArgumentError, match="width is for gymnasium's renderer"):
        make_task("Ant-v5", {"width": 100})
    with pytest.raises(SignatureError, match="healthy_z_rang"):
        make_task("Ant-v5", {"healthy_z_rang": (0.0, 1.0)})
    monkeypatch.setattr(gymnasium, "__file__", str(tmp_path / "__init__.py"))
    with pytest.raises(MissingLibrary, match=r'pip install .*"gymnasium\[mujoco\]>=1\.1"'):
        make_task("Ant-v5", {})
