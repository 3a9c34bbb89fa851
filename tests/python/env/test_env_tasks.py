"""Tasks of one's own: what may be written in them, and the errors for what may not; the pool under them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

import tightloop as tl
from tightloop import _core
from tightloop.env import AutoresetMode, Env, Gripper, JointTorque, Observed, VectorEnv, make_groups
from tightloop.env.evaluation.array_pool import ArrayPool
from tightloop.tasks.cartpole import CartPoleBalance
from tightloop.tasks.reach import FrankaReach

REPOSITORY = Path(__file__).parents[3]


def test_gymnasium_finds_them_as_readme_says() -> None:
    program = """
import gymnasium, tightloop.env
envs = gymnasium.make_vec("tightloop/CartPoleBalance-v0", num_envs=3, device="auto", autoreset_mode="SameStep")
envs.reset(seed=0)
envs.step(envs.action_space.sample())
envs.close()
"""
    subprocess.run([sys.executable, "-c", program], check=True)


def test_one_task_serves_many_environments(envs: Any) -> None:
    task = FrankaReach()
    whole, groups = envs(task, 4), make_groups(task, 4)
    seen = [env.reset(seed=0)[0] for env in (whole, *groups)]
    for action in np.random.default_rng(0).uniform(-4, 4, (10, 4, 7)):
        seen = [env.step(part)[0] for env, part in zip((whole, *groups), (action, action[:2], action[2:]), strict=True)]
        np.testing.assert_array_equal(seen[0], np.concatenate(seen[1:]))
    for env in groups:
        env.close()


def test_an_environment_of_gymnasiums_make_ends_as_a_vectors_does(envs: Any) -> None:
    """At the end of an episode a goal is due too; its last observation keeps the old one."""
    one = gymnasium.make("tightloop/FrankaReach-v0")
    many = envs("FrankaReach", 2, autoreset_mode=AutoresetMode.DISABLED)
    obs, start = one.reset(seed=3)[0], many.reset(seed=3)[0]
    np.testing.assert_array_equal(obs, start[0])
    goals = set()
    for step in range(1, 361):
        obs, _, _, truncated, _ = one.step(np.zeros(7, np.float32))
        theirs = many.step(np.zeros((2, 7)))
        np.testing.assert_array_equal(obs, theirs[0][0])
        assert truncated == theirs[3][0] == (step == 360)
        goals.add(obs[18:21].tobytes())
    assert len(goals) == 3
    one.close()


class Shaped(CartPoleBalance):
    """Rewards the change of something, which it keeps from the step before."""

    def bind(self, names: Any) -> None:
        self.before = 0.0

    def reward(self, xp: Any, worlds: Any) -> Any:
        now = xp.cos(worlds.joint_q[:, 1]) * 10.0
        gain, self.before = now - self.before, now
        return gain


def test_what_a_task_keeps_stays_what_it_was(envs: Any) -> None:
    env = envs(Shaped, 3)
    env.reset(seed=0)
    before = np.zeros(3)
    for _ in range(5):
        obs, reward = env.step(np.ones((3, 1)))[:2]
        now = obs[:, 2].astype(float) * 10.0
        np.testing.assert_allclose(reward, now - before, atol=1e-5)
        before = now


@pytest.mark.parametrize(
    "function",
    [
        lambda xp, a, m: xp.where(a * 1.0, a, 0.0 * a),
        lambda xp, a, m: xp.where(m, a, -a) + xp.where(m, 1.0, a),
        lambda xp, a, m: xp.sum(a, axis=1, where=a > 0.5),
        lambda xp, a, m: xp.sum(a, axis=1, where=np.asarray(m)),
        lambda xp, a, m: xp.max(a) + a.mean(axis=1) + xp.sum(a),
        lambda xp, a, m: xp.divmod(a, 0.3)[1],
        lambda xp, a, m: (a @ a.T)[:, 0] + xp.vecdot(a, a),
        lambda xp, a, m: xp.cumulative_sum(a, axis=1)[:, -1],
        lambda xp, a, m: xp.add.accumulate(a, axis=1)[:, 1] if a[0, 0] > 0.5 else -a[:, 0],
    ],
)
def test_arithmetic_on_an_arena_is_numpys(function: Any) -> None:
    pool, tape, rng = ArrayPool(), [], np.random.default_rng(0)
    for _ in range(12):
        array = rng.uniform(size=(5, 3))
        mask = array > 0.4
        pool.play(tape)
        ours, theirs = function(np, pool.wrap(array), pool.wrap(mask)), function(np, array, mask)
        np.testing.assert_array_equal(np.asarray(ours), theirs)


def broken(**functions: Any) -> type[CartPoleBalance]:
    return type("Broken", (CartPoleBalance,), functions)


@pytest.mark.parametrize(
    ("functions", "said"),
    [
        ({"reward": lambda self, xp, w: xp.sum(w.joint_q)}, r"Broken\.reward: got .*shape \(2,\)"),
        ({"reward": lambda self, xp, w: w.joint_q[:, :1]}, r"Broken\.reward: got an array of shape \(2, 1\)"),
        ({"reward": lambda self, xp, w: None}, r"Broken\.reward: got NoneType"),
        ({"terminated": lambda self, xp, w: w.joint_q[:, 0]}, r"Broken\.terminated: dtype float32; return bool"),
        ({"success": lambda self, xp, w: w.joint_q[:, 0]}, r"Broken\.success: dtype float32; return bool"),
        ({"metrics": lambda self, xp, w: {"height": 3.0}}, r"Broken\.metrics, 'height': got float"),
        ({"metrics": lambda self, xp, w: w.joint_q[:, 0]}, r"Broken\.metrics: got .*dict"),
        ({"observe": lambda self, xp, w: (1.0, 2.0, 3.0, 4.0, 5.0)}, "`position of the cart` is float"),
        ({"observe": lambda self, xp, w: w.joint_q[:, 0]}, "return the parts as a tuple"),
        ({"observe": lambda self, xp, w: [w.joint_q[:, 0].astype("f2")] * 5}, "float16"),
        ({"observe": lambda self, xp, w: [w.joint_q] * 5}, r"shape \(2, 2\)"),
        ({"observed": lambda self: []}, "observed: there is nothing"),
        ({"controls": lambda self: []}, "controls: there is none"),
        ({"controls": lambda self: [JointTorque(["cart/slide"], 1.0)] * 2}, "two of them write joint_f of cart/slide"),
        ({"controls": lambda self: [JointTorque(["cart/wheel"], 1.0)]}, "no dof 'cart/wheel'.*cart/slide"),
        ({"goal_draws": 1, "goal": lambda self, xp, w, d: d[0]}, r"Broken\.goal: expected numbers of 2 worlds"),
        ({"fields": ("joint_q",)}, "no 'joint_qd'; name it in the task's `fields`"),
        ({"max_episode_steps": float("nan")}, "max_episode_steps is nan"),
        ({"observed": lambda self: [Observed("x", 1, 0)]}, "low 1 must be below high 0"),
    ],
)
def test_what_is_wrong_with_a_task_is_reported_by_name(functions: dict[str, Any], said: str, envs: Any) -> None:
    with pytest.raises((tl.ArgumentError, AttributeError), match=said):
        env = envs(broken(**functions), 2)
        env.reset(seed=0)
        env.step(np.zeros((2, 1)))


def test_arrays_of_the_environment_cannot_be_written(envs: Any) -> None:
    def reward(self: Any, xp: Any, worlds: Any) -> Any:
        action = worlds.action
        action += 5.0
        return action[:, 0]

    env = envs(broken(reward=reward), 2)
    env.reset(seed=0)
    with pytest.raises(ValueError, match="read-only"):
        env.step(np.zeros((2, 1)))


def test_nan_in_any_number_of_any_action_fails_that_world_alone(envs: Any) -> None:
    for task in ("CartPoleSwingUp", "FrankaReach", "FrankaLift", "FrankaPickCube"):
        size = envs(task, 1).single_action_space.shape[0]
        env = envs(task, size + 1)
        env.reset(seed=0)
        action = np.zeros((size + 1, size))
        action[np.arange(size), np.arange(size)] = np.nan
        obs, reward, terminated, _, infos = env.step(action)
        np.testing.assert_array_equal(terminated, infos["_fault"])
        assert terminated[:-1].all() and not terminated[-1], task
        assert obs in env.observation_space and np.isfinite(reward).all()


def test_torques_hold_the_arm(envs: Any) -> None:
    """An action of 0 bears the arm's weight, as a Franka's own controller does."""
    env = envs("FrankaPickCube", 2, control="torque")
    obs = start = env.reset(seed=0)[0]
    for _ in range(20):
        obs = env.step(np.zeros((2, 8)))[0]
    # without it the tcp falls to the ground within half a second
    assert np.abs(obs[:, 21] - start[:, 21]).max() < 0.02


def test_goals_of_a_late_episode_cost_what_those_of_an_early_one_do() -> None:
    seeds, episodes = np.arange(5, dtype=np.uint64), np.zeros(5, np.uint32)
    whole = _core.draw(seeds, episodes, 0, 60)
    some = np.empty((5, 3))
    firsts = np.array([0, 3, 57, 12, 6], np.uint32)
    _core.draw(seeds, episodes, 0, 3, some, firsts)
    for row, first in enumerate(firsts):
        np.testing.assert_array_equal(some[row], whole[row, first : first + 3])
    with pytest.raises(tl.ArgumentError, match="a stream has 16777216"):
        _core.draw(seeds, episodes, 0, 3, some, firsts + np.uint32(2**24))
    with pytest.raises(tl.ArgumentError, match="firsts"):
        _core.draw(seeds, episodes, 0, 3, some, firsts[:2])


def test_draws_of_goals_stay_below_1(envs: Any) -> None:
    class Draws(CartPoleBalance):
        goal_draws = 2

        def goal(self, xp: Any, worlds: Any, draws: Any) -> Any:
            return draws

        def metrics(self, xp: Any, worlds: Any) -> Any:
            return {"draw": worlds.goal[:, 0], "other": worlds.goal[:, 1]}

    env = envs(Draws, 1)
    # of this seed, rounding to nearest would make 1
    env.reset(seed=7065937)
    infos = env.step(np.zeros((1, 1)))[4]
    assert 0.99999 < max(infos["draw"][0], infos["other"][0]) < 1.0


def test_a_file_may_hold_the_task(tmp_path: Path, envs: Any) -> None:
    file = tmp_path / "mine.py"
    file.write_text(
        "from __future__ import annotations\n"
        "from dataclasses import dataclass\n"
        "from tightloop.tasks.cartpole import CartPoleBalance\n"
        "@dataclass\nclass Mine(CartPoleBalance):\n    force: float = 3.0\n"
    )
    env = envs(f"{file}:Mine", 2, force=4.0)
    assert env.task.force == 4.0
    env.reset(seed=0)
    env.step(np.zeros((2, 1)))
    for name, said in ((f"{file}:Yours", "no class 'Yours'"), (f"{tmp_path}/no.py:Mine", "no file")):
        with pytest.raises(tl.ArgumentError, match=said):
            VectorEnv(name)
    with pytest.raises(tl.SignatureError, match=r"colour.*force"):
        VectorEnv(f"{file}:Mine", colour="red")
    example = envs(f"{REPOSITORY}/examples/own_task.py:Circle", 4)
    example.reset(seed=0)
    assert example.step(np.zeros((4, 7)))[1].shape == (4,)


@pytest.mark.parametrize("binary", [False, True])
def test_a_gripper_closes_and_opens(binary: bool, envs: Any) -> None:
    fingers = ["arm/fr3_finger_joint1", "arm/fr3_finger_joint2"]

    class DragSpring(FrankaReach):
        def __init__(self) -> None:
            super().__init__()
            self._arm_control = Gripper(fingers, low=0.0, high=0.04, binary=binary)
            self._arm_controls = [self._arm_control]

    env = envs(DragSpring, 4)
    obs = env.reset(seed=0)[0]
    for _ in range(60):
        obs = env.step(np.array([[-1.0], [-0.5], [0.5], [1.0]]))[0]
    # observed less the start, 0.04
    expected = [-0.04, -0.04, 0.0, 0.0] if binary else [-0.04, -0.03, -0.01, 0.0]
    np.testing.assert_allclose(obs[:, 7], expected, atol=2e-3)


def test_an_error_of_recv_leaves_no_step_on_its_way() -> None:
    env = VectorEnv("CartPoleBalance", 1)
    env.reset(seed=0)
    env.send(np.zeros((1, 1)))
    os.kill(env.sim.pid, signal.SIGKILL)
    with pytest.raises(tl.DaemonLost):
        for _ in range(50):
            env.recv()
            env.send(np.zeros((1, 1)))
    with pytest.raises(tl.DaemonLost):
        env.reset(seed=0)
    env.close()
    env.close()


def test_flags_of_a_task_have_no_value_on_the_command_line(monkeypatch: Any) -> None:
    from tightloop.env.__main__ import arguments_of

    for wanted in (True, False):
        monkeypatch.setattr(CartPoleBalance, "launch_options", {"cpu_bits": wanted})
        arguments = arguments_of("CartPoleBalance", {}, [])[1]
        assert ("--cpu-bits" in arguments) == wanted
        assert f"{wanted}" not in arguments


def test_a_single_environment_joins_no_daemon_of_many(unique: Any) -> None:
    from tightloop.env.__main__ import arguments_of

    assert "--on-nan" in arguments_of("CartPoleBalance", {}, [])[1]
    with tl.launch(CartPoleBalance().scene(), worlds=4, name=unique(), draws="seed", on_nan="freeze") as sim:
        with pytest.raises(tl.ArgumentError, match=r"num_envs is 1.*has 4"):
            Env("CartPoleBalance", daemon=sim.name)
        with pytest.raises(tl.ArgumentError, match="precision is f64"):
            VectorEnv("CartPoleBalance", daemon=sim.name, precision="f64")
        with pytest.raises(tl.ArgumentError, match="threads"):
            VectorEnv("CartPoleBalance", daemon=sim.name, threads=2)
