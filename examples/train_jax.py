"""Train a policy with PPO in JAX: rollout, advantages and learning are one compiled program.

    pip install jax
    python examples/train_jax.py CartPoleSwingUp --seed 0

It prints the mean return of episodes without noise, and leaves the weights in ``out/jax/TASK-SEED.npz``.
"""

from __future__ import annotations

import argparse
import time
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from learning.places import OUT
from learning.program import needed

from tightloop.whole_files import whole_file

with needed("jax"):
    import jax
    import jax.numpy as jnp
    from jax import lax

    from tightloop.adapters.jax import JaxEnv

STEPS, EPOCHS, BATCHES, HIDDEN = 64, 5, 4, 64
# weights, Adam's moments and steps, and where the worlds are: state and observations
Learner = tuple[Any, Any, Any, Any, Any]
GAMMA, LAMBDA, CLIP, RATE, EVALUATED = 0.99, 0.95, 0.2, 2e-3, 20


def network(key: Any, *sizes: int) -> list[tuple[Any, Any]]:
    """Layers with orthogonal weights; the last one is small."""
    keys, shapes = jax.random.split(key, len(sizes) - 1), list(pairwise(sizes))
    gains = [2.0**0.5] * (len(shapes) - 1) + [0.01]
    orthogonal = jax.nn.initializers.orthogonal
    return [(orthogonal(g)(k, shape), jnp.zeros(shape[1])) for g, k, shape in zip(gains, keys, shapes, strict=True)]


def run(weights: Any, name: str, obs: Any) -> Any:
    """The output of a network; large observations count as their logarithm."""
    mean, deviation = lax.stop_gradient(weights["scale"])
    x, (*hidden, (weight, bias)) = (obs - mean) / deviation, weights[name]
    x = jnp.sign(x) * jnp.log1p(jnp.abs(x))
    for w, b in hidden:
        x = jnp.tanh(x @ w + b)
    return x @ weight + bias


def log_prob(weights: Any, obs: Any, action: Any) -> Any:
    """Logarithm of the probability of an action, without its constant."""
    deviation = (action - run(weights, "actor", obs)) * jnp.exp(-weights["log_std"])
    return -(0.5 * deviation**2 + weights["log_std"]).sum(-1)


def collect(env: JaxEnv, weights: Any, carry: tuple[Any, Any], key: Any) -> tuple[Any, dict[str, Any]]:
    """One step of all worlds with noise."""
    state, obs = carry
    mean, value = run(weights, "actor", obs), run(weights, "critic", obs)[:, 0]
    action = mean + jnp.exp(weights["log_std"]) * jax.random.normal(key, mean.shape)
    state, after, reward, terminated, truncated, info = env.step(state, action)
    # values of about 1; where the time is over, what would have come counts
    late = GAMMA * truncated * ~terminated * run(weights, "critic", info["final_obs"])[:, 0]
    reward = (1.0 - GAMMA) * reward + late
    step = {"obs": obs, "action": action, "log_prob": log_prob(weights, obs, action), "value": value}
    return (state, after), step | {"reward": reward, "goes_on": 1.0 - (terminated | truncated)}


def loss(weights: Any, batch: dict[str, Any]) -> Any:
    """PPO's clipped objective (Schulman et al. 2017), and the error of the values."""
    ratio = jnp.exp(log_prob(weights, batch["obs"], batch["action"]) - batch["log_prob"])
    gain = (batch["gain"] - batch["gain"].mean()) / (batch["gain"].std() + 1e-8)
    surrogate = jnp.minimum(ratio * gain, jnp.clip(ratio, 1 - CLIP, 1 + CLIP) * gain)
    error = run(weights, "critic", batch["obs"])[:, 0] - batch["value"] - batch["gain"]
    return 0.5 * (error**2).mean() - surrogate.mean()


def learn(rate: Any, carry: tuple[Any, Any, Any], batch: dict[str, Any]) -> tuple[Any, None]:
    """A step of Adam (Kingma and Ba 2015)."""
    weights, (first, second), count = carry
    gradient, count = jax.grad(loss)(weights, batch), count + 1
    first = jax.tree.map(lambda m, g: 0.9 * m + 0.1 * g, first, gradient)
    second = jax.tree.map(lambda v, g: 0.999 * v + 0.001 * g**2, second, gradient)
    size = rate * jnp.sqrt(1 - 0.999**count) / (1 - 0.9**count)
    weights = jax.tree.map(lambda w, m, v: w - size * m / (jnp.sqrt(v) + 1e-8), weights, first, second)
    return (weights, (first, second), count), None


def update(env: JaxEnv, updates: int, learner: Learner, key: Any) -> Learner:
    """Collect a rollout and learn from it."""
    shuffle, noise = jax.random.split(key)
    weights, moments, count, state, obs = learner
    (state, obs), steps = lax.scan(partial(collect, env, weights), (state, obs), jax.random.split(noise, STEPS))
    after = jnp.concatenate([steps["value"][1:], run(weights, "critic", obs).T])
    delta = steps["reward"] + GAMMA * after * steps["goes_on"] - steps["value"]

    def back(gain: Any, now: tuple[Any, Any]) -> tuple[Any, Any]:
        gain = now[0] + GAMMA * LAMBDA * now[1] * gain
        return gain, gain

    _, steps["gain"] = lax.scan(back, jnp.zeros(env.num_envs), (delta, steps["goes_on"]), reverse=True)
    flat = jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]), steps)
    orders = jnp.stack([jax.random.permutation(k, STEPS * env.num_envs) for k in jax.random.split(shuffle, EPOCHS)])
    batches = jax.tree.map(lambda x: x[orders.reshape(EPOCHS * BATCHES, -1)], flat)
    done = count / (EPOCHS * BATCHES)
    rate = RATE * (1.0 - 0.9 * done / updates)
    (weights, moments, count), _ = lax.scan(partial(learn, rate), (weights, moments, count), batches)
    seen = flat["obs"].mean(0), flat["obs"].std(0) + 1e-3
    weights["scale"] = jax.tree.map(lambda old, new: old + (new - old) / (1.0 + done), weights["scale"], seen)
    return weights, moments, count, state, obs


def evaluate(env: JaxEnv, steps: int, learner: Learner) -> tuple[Any, Learner]:
    """The mean return of the first episodes without noise; the worlds are elsewhere then."""

    def step(carry: Any, _: None) -> tuple[Any, Any]:
        state, obs, goes_on = carry
        state, obs, reward, terminated, truncated, _ = env.step(state, run(learner[0], "actor", obs))
        return (state, obs, goes_on & ~(terminated | truncated)), reward * goes_on

    start = *env.reset(0, learner[3]), jnp.ones(env.num_envs, bool)
    (state, obs, _), rewards = lax.scan(step, start, None, length=steps)
    return rewards.sum(0).mean(), (*learner[:3], state, obs)


def main() -> None:
    """Train, and print how the policy does."""
    parser = argparse.ArgumentParser(description="Train a policy with PPO in JAX.")
    parser.add_argument("task", nargs="?", default="CartPoleSwingUp")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--num-envs", type=int, default=512)
    parser.add_argument("--updates", type=int, default=80)
    parser.add_argument("--threads", type=int, help="threads of the simulation; all cores if left out")
    parser.add_argument("--out", type=Path, default=OUT / "jax")
    given = parser.parse_args()
    env = JaxEnv(given.task, given.num_envs, threads=given.threads)
    key, *keys = jax.random.split(jax.random.key(given.seed), 3)
    sizes = env.observation_size, HIDDEN, HIDDEN
    weights = {"actor": network(keys[0], *sizes, env.action_size), "critic": network(keys[1], *sizes, 1)}
    weights |= {"log_std": jnp.zeros(env.action_size), "scale": (jnp.zeros(sizes[0]), jnp.ones(sizes[0]))}
    moments = jax.tree.map(jnp.zeros_like, (weights, weights))
    learner = (weights, moments, jnp.int32(0), *env.reset(given.seed))
    updated = jax.jit(partial(update, env, given.updates))
    evaluated = jax.jit(partial(evaluate, env, env.env.max_episode_steps))
    begin = time.perf_counter()
    for done, noise in enumerate(jax.random.split(key, given.updates), 1):
        learner = updated(learner, noise)
        if done % EVALUATED == 0 or done == given.updates:
            value, learner = evaluated(learner)
            took = time.perf_counter() - begin
            print(f"{given.task}, {done} of {given.updates} updates, {took:.0f} s: return {value:.1f}", flush=True)
    path = given.out / f"{given.task}-{given.seed}.npz"
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as part, part.open("wb") as file:
        np.savez(file, *jax.tree.leaves(learner[0]))
    env.close()


if __name__ == "__main__":
    main()
