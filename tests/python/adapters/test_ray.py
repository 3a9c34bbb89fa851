"""A vector environment over a real Ray cluster of three nodes on this machine, some of which are killed.

`TIGHTLOOP_RAY_WORLDS` and `TIGHTLOOP_RAY_STEPS` set how large the comparison is; `make test-ray` runs 3072 worlds.
"""

from __future__ import annotations

import gc
import os
import signal
import sys
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from same_bits import assert_same_bits, assert_same_steps

from processes import alive, children_of, command_of, wait_until

# no report of use leaves the machine, and no package is sent to workers of the same one
os.environ |= {
    "RAY_USAGE_STATS_ENABLED": "0",
    "RAY_ENABLE_UV_RUN_RUNTIME_ENV": "0",
    "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0",
}

import ray
from ray.cluster_utils import Cluster

import tightloop as tl
from tightloop.adapters.ray import RayVectorEnv

WORLDS = int(os.environ.get("TIGHTLOOP_RAY_WORLDS", "25"))
STEPS = int(os.environ.get("TIGHTLOOP_RAY_STEPS", "390"))  # an episode of FrankaReach has 360, and some begin at 20
#: Memory of a node's object store, the least that Ray takes without a warning [bytes].
STORE = 80 * 1024**2


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    """A head that runs no actors, and nodes that tests add and kill."""
    made = Cluster(
        initialize_head=True,
        head_node_args={"num_cpus": 0, "include_dashboard": False, "object_store_memory": STORE},
    )
    ray.init(address=made.address, log_to_driver=False)
    yield made
    ray.shutdown()
    made.shutdown()


@pytest.fixture
def nodes(cluster: Any) -> Iterator[Callable[[int], None]]:
    """Makes sure that the cluster has as many nodes of two CPUs."""

    def have(count: int) -> None:
        for _ in range(count - len(cluster.worker_nodes)):
            cluster.add_node(num_cpus=2, object_store_memory=STORE, wait=False)
        cluster.wait_for_nodes()

    yield have


@pytest.fixture
def spread(nodes: Any) -> Iterator[Callable[..., RayVectorEnv]]:
    """Makes environments over three nodes, and closes them."""
    made: list[RayVectorEnv] = []

    def make(task: Any, num_envs: int, *, on: int = 3, **options: Any) -> RayVectorEnv:
        nodes(on)
        given: dict[str, Any] = {"actors": 3} | options
        made.append(RayVectorEnv(task, num_envs, **given))
        return made[-1]

    yield make
    for env in made:
        env.close()


def kill_node(cluster: Any, env: RayVectorEnv, shard: int) -> None:
    """Kill the raylet of a shard's node by SIGKILL; its actors and their daemons end with it."""
    (node,) = (node for node in cluster.worker_nodes if node.node_id in env.places[shard])
    cluster.remove_node(node, allow_graceful=False)


def pids_of(env: RayVectorEnv) -> list[int]:
    """Return the processes of an environment's actors."""
    fleet: Any = env._shards._fleet
    return [ray.get(actor.pid.remote()) for actor in fleet._actors]


def descendants(pid: int) -> list[int]:
    """Return the processes that a process and its descendants have started."""
    return [found for child in children_of(pid) for found in (child, *descendants(child))]


def daemons_of(pid: int) -> list[int]:
    """Return the daemons among a process's descendants."""
    lines = {child: command_of(child) for child in descendants(pid)}
    return [child for child, words in lines.items() if b"serve" in words and any(b"tightloop" in w for w in words)]


def actions_of(env: Any, steps: int) -> Iterator[Any]:
    """Random actions, shape ``(worlds, actions)``."""
    rng = np.random.default_rng(1)
    for _ in range(steps):
        yield rng.uniform(-1, 1, env.action_space.shape).astype(np.float32)


def test_three_nodes_return_the_bits_of_one_machine(spread: Any, envs: Any) -> None:
    own, one = spread("FrankaReach", WORLDS), envs("FrankaReach", WORLDS, threads=1)
    assert len(set(own.places)) == 3
    every, some = np.ones(WORLDS, np.bool_), np.arange(WORLDS) % 7 == 0
    assert_same_steps(own.reset(seed=11), one.reset(seed=11), every)
    ended = 0
    for number, actions in enumerate(actions_of(own, STEPS)):
        if number == 20:
            assert_same_steps(own.reset(options={"reset_mask": some}), one.reset(options={"reset_mask": some}), every)
        mine = own.step(actions)
        assert_same_steps(mine, one.step(actions), every)
        ended += np.count_nonzero(mine[2] | mine[3])
    assert own.restarts == 0 and ended >= WORLDS * (STEPS // 360)


def test_a_killed_node_costs_no_more_than_the_episodes_of_its_worlds(cluster: Any, spread: Any, envs: Any) -> None:
    options = {"autoreset_mode": "SAME_STEP", "max_episode_steps": 60, "copy": False}
    own, one = spread("FrankaReach", WORLDS, **options), envs("FrankaReach", WORLDS, threads=1, **options)
    own.reset(seed=3)
    one.reset(seed=3)
    kill_at, rows, places = STEPS // 4, own.rows[1], own.places
    others = np.ones(WORLDS, np.bool_)
    others[rows] = False
    again: Any = None
    last = np.zeros(own.observation_space.shape, np.float32)
    for number, actions in enumerate(actions_of(own, STEPS)):
        if number == kill_at:
            kill_node(cluster, own, 1)
        mine, theirs = own.step(actions), one.step(actions)
        for place in range(4):
            assert_same_bits(f"step {number}, result {place}", mine[place], theirs[place], others)
        if "restarted" in mine[4]:
            # a worker may answer a moment longer than its node
            assert again is None and number >= kill_at
            assert (mine[4]["restarted"] == ~others).all() and mine[3][rows].all() and not mine[1][rows].any()
            assert mine[4]["final_obs"][rows].tobytes() == last[rows].tobytes()
            again = envs("FrankaReach", rows.stop - rows.start, threads=1, **options)
            first, _ = again.reset(seed=own.seeds[rows].tolist())
            assert mine[0][rows].tobytes() == first.tobytes()
        elif again is not None:
            instead = again.step(actions[rows])
            assert all(mine[place][rows].tobytes() == instead[place].tobytes() for place in range(4))
        last[:] = mine[0]
    assert again is not None and own.restarts == 1
    assert own.places[1] != places[1] and own.places[::2] == places[::2]


def test_a_killed_daemon_or_actor_is_started_again(spread: Any) -> None:
    own = spread("CartPoleBalance", 6)
    own.reset(seed=0)
    pids = pids_of(own)
    (daemon,) = daemons_of(pids[0])
    actions = np.zeros((6, 1))
    os.kill(daemon, signal.SIGKILL)
    restarted = own.step(actions)[4]["restarted"]
    assert restarted.tolist() == [True, True, False, False, False, False]
    assert wait_until(lambda: not alive(pids[0]), 10), "the actor without a daemon ends"
    (daemon,) = daemons_of(pids[2])
    os.kill(pids[2], signal.SIGKILL)
    restarted = own.step(actions)[4]["restarted"]
    assert restarted.tolist() == [False, False, False, False, True, True]
    assert wait_until(lambda: not alive(daemon), 10), "a daemon ends with its actor"
    assert own.restarts == 2 and "restarted" not in own.step(actions)[4]


def test_an_actor_that_hangs_is_started_again(spread: Any) -> None:
    own = spread("CartPoleBalance", 6, step_timeout=1.0)
    own.reset(seed=0)
    pid = pids_of(own)[1]
    os.kill(pid, signal.SIGSTOP)
    restarted = own.step(np.zeros((6, 1)))[4]["restarted"]
    assert restarted.tolist() == [False, False, True, True, False, False]
    assert wait_until(lambda: not alive(pid), 10)


def test_without_free_resources_the_error_has_a_cure_and_a_new_node_helps(cluster: Any, spread: Any) -> None:
    own = spread("CartPoleBalance", 6, num_cpus=2, launch_timeout=8.0, on=3)
    own.reset(seed=0)
    kill_node(cluster, own, 2)
    actions = np.zeros((6, 1))
    with pytest.raises(tl.LaunchError, match=r"worlds 4 to 5: .* within 8 s .* needs \{'CPU': 2.*\}: add a node"):
        while True:  # a worker may answer a moment longer than its node
            own.step(actions)
    cluster.add_node(num_cpus=2, object_store_memory=STORE)
    own.reset()
    own.step(actions)
    assert own.restarts == 1


def test_a_closed_or_forgotten_environment_leaves_no_process(spread: Any) -> None:
    for end in ("close", "forget"):
        env = RayVectorEnv("CartPoleBalance", 2, actors=2)
        pids = pids_of(env)
        pids += [daemon for pid in pids for daemon in daemons_of(pid)]
        assert len(pids) == 4
        if end == "close":
            env.close()
            env.close()
            with pytest.raises(tl.SimClosed):
                env.reset()
        del env
        gc.collect()
        assert wait_until(lambda pids=pids: not any(map(alive, pids)), 15), end


def test_after_a_shutdown_of_ray_no_call_starts_another_cluster(cluster: Any, nodes: Any) -> None:
    nodes(1)
    env = RayVectorEnv("CartPoleBalance", 2, actors=1)
    env.reset(seed=0)
    actions = np.zeros((2, 1), np.float32)
    env.send(actions)
    ray.shutdown()
    try:
        for call in (env.recv, env.reset, lambda: env.elapsed):
            with pytest.raises(tl.SimClosed, match="Ray was shut down, and the actors with it; close this environment"):
                call()
            assert not ray.is_initialized()
    finally:
        ray.init(address=cluster.address, log_to_driver=False)
    # another connection has other actors
    with pytest.raises(tl.SimClosed, match="Ray was shut down"):
        env.reset()
    env.close()
    RayVectorEnv("CartPoleBalance", 2, actors=1).close()


def test_one_actor_per_node_is_the_default(spread: Any, nodes: Any) -> None:
    nodes(3)
    env = spread("CartPoleBalance", 8, actors=None)
    assert len(env.rows) == 3 and len(set(env.places)) == 3
    two = spread("CartPoleBalance", 2, actors=None)
    assert [rows.stop - rows.start for rows in two.rows] == [1, 1]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"num_envs": 0}, "num_envs"),
        ({"actors": 0}, "actors"),
        ({"actors": 5}, "actors is 5 for 4 environments; give at most"),
        ({"num_cpus": -1}, "num_cpus"),
        ({"num_cpus": 1000}, "num_cpus is 1000, and no node of the cluster has more than"),
        ({"actor_options": 3}, "actor_options is 3; give a dict"),
        ({"actor_options": {"num_cpus": 2}}, "actor_options has 'num_cpus'; leave it out"),
        ({"actor_options": {"max_restarts": 2}}, "actor_options has 'max_restarts'; leave it out"),
        ({"launch_timeout": 0}, "launch_timeout"),
        ({"step_timeout": "soon"}, "step_timeout"),
        ({"threads": 0}, "threads"),
        ({"device": "abacus"}, "device"),
        ({"daemon": "shared"}, "daemon: each actor launches a daemon of its own; leave it out"),
        ({"render_mode": "human"}, "render_mode: a VectorEnv on one machine renders; leave it out"),
        ({"task": "NoSuchTask"}, "there is no task 'NoSuchTask'"),
        ({"frobnicate": 1}, "frobnicate"),
    ],
    ids=str,
)
def test_wrong_arguments_are_refused(options: dict[str, Any], said: str, nodes: Any) -> None:
    nodes(1)
    given: dict[str, Any] = {"task": "CartPoleBalance", "num_envs": 4}
    with pytest.raises(tl.TightloopError, match=said):
        RayVectorEnv(**(given | options))


def test_without_ray_the_error_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    monkeypatch.delitem(sys.modules, "tightloop.adapters.ray")
    with pytest.raises(tl.MissingLibrary, match="no module `ray`: pip install 'ray'"):
        import tightloop.adapters.ray  # noqa: F401
