"""Environments in programs of JAX: the bits of `VectorEnv`, and errors in place of wrong results."""

from __future__ import annotations

import gc
import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

import tightloop as tl
from tightloop.adapters.jax import JaxEnv, JaxSim, programs
from tightloop.env import VectorEnv

STEPS, WORLDS = 80, 6
EXAMPLES = Path(__file__).parents[2] / "examples"
PAGE = Path(__file__).parents[2] / "docs/pages/use/jax.md"
WAYS = pytest.mark.parametrize("via", programs.WAYS)


def steps_of(env: JaxEnv) -> Any:
    """A program that steps through actions."""

    def step(state, action):
        state, *results = env.step(state, action)
        return state, results

    return jax.jit(lambda state, actions: lax.scan(step, state, actions))


def failed(call: Any) -> str:
    """What a program that fails says."""
    with pytest.raises(jax.errors.JaxRuntimeError) as raised:
        jax.block_until_ready(call())
    return str(raised.value)


@WAYS
def test_a_scan_has_the_bits_of_vector_env_and_the_last_observations_of_episodes(made, vector, hasty, actions, via):
    env = made(JaxEnv(hasty, WORLDS, threads=1, via=via))
    given = actions(STEPS, WORLDS, 1)
    state, obs = env.reset(3)
    _, (found, reward, terminated, truncated, info) = steps_of(env)(state, given)
    twin = vector(hasty, WORLDS, threads=1, autoreset_mode="SAME_STEP")
    first, _ = twin.reset(seed=3)
    assert np.array_equal(obs, first)
    assert terminated.any() and truncated.any() and set(info) == {"final_obs", "fault", "success"}
    for at, action in enumerate(given):
        after, *others, infos = twin.step(action)
        assert np.array_equal(found[at], after), at
        for mine, theirs in zip((reward, terminated, truncated), others, strict=True):
            assert np.array_equal(mine[at], theirs), at
        ended = others[1] | others[2]
        last = np.where(ended[:, None], infos.get("final_obs", after), after)
        assert np.array_equal(info["final_obs"][at], last), at
        success = np.where(ended, infos.get("final_info", infos)["success"], infos["success"])
        assert np.array_equal(info["success"][at], success), at
    assert not info["fault"].any()


def test_a_reset_by_key_is_part_of_a_program_and_repeats_its_episodes(made, hasty, actions):
    env = made(JaxEnv(hasty, WORLDS, threads=1))
    given = actions(30, WORLDS, 1)

    @jax.jit
    def rollout(key):
        state, obs = env.reset(key)
        state, results = lax.scan(lambda s, a: env.step(s, a)[:2], state, given)
        return state, obs, results

    state, obs, results = rollout(jax.random.key(5))
    _, again, same = rollout(jax.random.PRNGKey(5))
    assert np.array_equal(obs, again) and np.array_equal(results, same)
    _, other, _ = rollout(jax.random.key(6))
    assert not np.array_equal(obs, other) and len(np.unique(obs[:, 0])) == WORLDS
    # behind a step of the same program
    both = jax.jit(lambda state: env.reset(2, env.step(env.reset(1)[0], given[0])[0]))
    assert np.array_equal(both(state)[1], env.reset(2)[1])
    keys = jax.random.split(jax.random.key(0), 3)
    for wrong in (-1, 2**32, 2**70, np.array(2**32), 1.5, True, None, jnp.arange(3), keys):
        with pytest.raises(tl.ArgumentError, match=r"seed is .*; give a"):
            env.reset(wrong)
    assert np.array_equal(env.reset(2**32 - 1)[1], env.reset(2**32 - 1)[1])


def test_an_environment_of_ones_own_is_taken_and_other_modes_are_refused(vector, hasty):
    own = vector(hasty, WORLDS, threads=1, autoreset_mode="SAME_STEP")
    env = JaxEnv(own)
    assert env.env is own and (env.num_envs, env.observation_size, env.action_size) == (WORLDS, 5, 1)
    with pytest.raises(tl.ArgumentError, match="this library expects SAME_STEP"):
        JaxEnv(vector(hasty, 2, threads=1))


@WAYS
def test_errors_of_an_environment_have_their_names(made, hasty, via):
    env = made(JaxEnv(hasty, WORLDS, threads=1, via=via))
    state, _ = env.reset(1)
    action = jnp.zeros((WORLDS, 1))
    after = env.step(state, action)[0]
    assert "the token of call 1 of the environment of Hasty was used before" in failed(lambda: env.step(state, action))
    env.step(after, action)
    with pytest.raises(tl.ArgumentError, match=r"action: expected real numbers of shape \(6, 1\); got .* \(6, 2\)"):
        env.step(after, jnp.zeros((WORLDS, 2)))
    with pytest.raises(tl.ArgumentError, match=r"action: expected real numbers.*got complex64"):
        env.step(after, action + 1j)
    with pytest.raises(tl.ArgumentError, match=r"state is .*; give what `reset\(\)` or the last call"):
        env.step(None, action)
    with pytest.raises(tl.ArgumentError, match=r"tightloop\.linearize"):
        jax.grad(lambda a: env.step(env.reset(1)[0], a)[2].sum())(action)
    with pytest.raises(tl.ArgumentError, match="its worlds are the batch"):
        jax.vmap(lambda a: env.step(env.reset(1)[0], a)[2])(action[None])
    with pytest.raises(tl.ArgumentError, match="its worlds are the batch"):
        jax.vmap(env.reset)(jax.random.split(jax.random.key(0), 2))
    state, _ = env.reset(1)
    os.kill(env.env.sim.pid, signal.SIGKILL)
    assert "DaemonLost: daemon" in failed(lambda: env.step(state, action))


@WAYS
def test_a_token_of_something_else_is_an_error_before_a_step(made, hasty, via):
    env, twin, smaller = (made(JaxEnv(hasty, worlds, threads=1, via=via)) for worlds in (WORLDS, WORLDS, 2))
    action, sim = jnp.zeros((WORLDS, 1)), env.env.sim
    (state, _), (others, _), (small, _) = (one.reset(1) for one in (env, twin, smaller))
    for given in (JaxSim(sim, via=via).step, JaxSim(sim, via=via).reset):
        said = failed(lambda given=given: given(state))
        assert "ArgumentError: this token is of the environment of Hasty; the program was made for a JaxSim" in said
    said = failed(lambda: env.step(small, action))
    assert "this token is of the environment of Hasty (action [2, 1]" in said
    assert "the program was made for the environment of Hasty (action [6, 1]" in said
    # of a simulation
    before = sim.forward().step.tolist()
    said = failed(lambda: env.step(JaxSim(sim).token(), action))
    assert f"ArgumentError: this token is of simulation `{sim.name}`; the program was made for the step of" in said
    assert sim.forward().step.tolist() == before
    # all were refused before they counted; and a twin runs with its own token
    env.step(state, action)
    env.step(others, action)
    smaller.step(small, jnp.zeros((2, 1)))


def test_an_error_of_a_task_is_one_of_the_program(made, hasty):
    class Wrong(hasty):
        def reward(self, xp, worlds):
            return worlds.joint_q[:, 0] * (xp.nan if worlds.elapsed[0] == 3 else 1.0)

    env = made(JaxEnv(Wrong, 2, threads=1))
    state, _ = env.reset(1)
    said = failed(lambda: steps_of(env)(state, jnp.zeros((5, 2, 1))))
    assert "ArgumentError: Wrong.reward is nan in world 0 (and 1 more)" in said
    state, _ = env.reset(1)
    env.step(state, jnp.zeros((2, 1)))


def test_a_compiled_program_whose_environment_was_dropped_is_an_error(hasty):
    own = VectorEnv(hasty, 2, threads=1, autoreset_mode="SAME_STEP")
    env, given = JaxEnv(own), jnp.zeros((3, 2, 1))
    state, _ = env.reset(1)
    program = steps_of(env).lower(state, given).compile()
    del env
    gc.collect()
    assert "SimClosed: the JaxEnv of this program was dropped" in failed(lambda: program(state, given))
    own.close()


def test_the_blocks_of_the_page_run(capsys):
    names: dict[str, Any] = {}
    for block in re.findall(r'^```python title="needs jax"\n(.*?)^```$', PAGE.read_text(), re.MULTILINE | re.DOTALL):
        exec(block, names)
    standing, mean = re.findall(r"^poles that stand: (\d+) of 64\nmean return: ([\d.]+)$", capsys.readouterr().out)[0]
    assert int(standing) == 64 and float(mean) > 490


def test_train_jax_learns_to_balance_and_leaves_its_weights(tmp_path):
    command = [sys.executable, f"{EXAMPLES}/train_jax.py", "CartPoleBalance", "--threads", "1", "--updates", "40"]
    done = subprocess.run([*command, "--out", str(tmp_path)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    returns = re.findall(r"^CartPoleBalance, \d+ of 40 updates, \d+ s: return ([\d.]+)$", done.stdout, re.MULTILINE)
    # an untrained policy falls after some 40 steps of 500
    assert len(returns) == 2 and float(returns[-1]) > 400, done.stdout
    assert (tmp_path / "CartPoleBalance-0.npz").stat().st_size > 10_000
