"""What Ray costs a step: one daemon without Ray, one actor, and three actors on three nodes, all on this machine.

    python -m benches ray_cluster

The three raylets share the cores of one machine, so this measures what Ray adds, and never what more machines gain.
Actors and the daemon without Ray have one thread each. Sides take turns, step by step. Beside the latency of a step it
counts the bytes that cross between the driver and the actors, and measures the learner's share: the time that PPO of
``examples/ppo.py`` needs for its update, as a share of update and rollout together. The update needs torch.

Writes benches/results/MACHINE/ray_cluster.csv.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

# no report of use leaves the machine, and no package is sent to workers of the same one
os.environ |= {
    "RAY_USAGE_STATS_ENABLED": "0",
    "RAY_ENABLE_UV_RUN_RUNTIME_ENV": "0",
    "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0",
    "OMP_NUM_THREADS": "1",
}

import numpy as np
import ray
from ray.cluster_utils import Cluster

from tightloop.adapters.ray import RayVectorEnv
from tightloop.env import VectorEnv

sys.path.insert(0, str(Path(__file__).parents[1]))
from record import REPOSITORY, print_table, write_results

#: Tasks, and how many worlds of each are measured.
CASES = (("FrankaReach", 384), ("FrankaReach", 3072), ("QuadrupedVelocityFlat", 3072), ("HumanoidVelocityFlat", 3072))
#: Steps of a rollout, of which the learner makes one update.
ROLLOUT = 24
NODES, STORE = 3, 200 * 1024**2


def size_of(value: Any) -> int:
    """Bytes of all arrays in a result."""
    if isinstance(value, Mapping):
        return sum(map(size_of, value.values()))
    if isinstance(value, tuple):
        return sum(map(size_of, value))
    return value.nbytes


def learner_ms(task: str, worlds: int) -> float:
    """Time of an update after a rollout, on one thread [ms]; the median of three."""
    sys.path.insert(0, str(REPOSITORY / "examples"))
    import ppo  # pyright: ignore[reportMissingImports] # it needs torch

    config = replace(ppo.PRESETS[task], num_envs=worlds, steps=ROLLOUT)
    with tempfile.TemporaryDirectory() as folder:
        trainer = ppo.Trainer(task, 0, config, Path(folder), daemon=None, device="cpu")
        trainer.collect(trainer.begin(), trainer.rollouts[0])
        times = []
        for _ in range(3):
            begun = time.perf_counter()
            trainer.learn(trainer.rollouts[0], 0.0)
            times.append(time.perf_counter() - begun)
        trainer.close()
    return float(np.median(times)) * 1e3


def measure(task: str, worlds: int, steps: int) -> list[dict[str, Any]]:
    """A row of the results per side."""
    options: dict[str, Any] = {"autoreset_mode": "SAME_STEP", "copy": False}
    sides: dict[str, Any] = {
        "one daemon, no Ray": VectorEnv(task, worlds, threads=1, **options),
        "Ray, 1 actor": RayVectorEnv(task, worlds, actors=1, **options),
        "Ray, 3 actors": RayVectorEnv(task, worlds, actors=NODES, **options),
    }
    times: dict[str, list[float]] = {name: [] for name in sides}
    rng, bytes_up, bytes_down = np.random.default_rng(0), 0, list[int]()
    for env in sides.values():
        env.reset(seed=0)
    shape = next(iter(sides.values())).action_space.shape
    result: Any = ()
    for step in range(steps + 10):
        actions = rng.uniform(-1, 1, shape).astype(np.float32)
        for name, env in sides.items():
            begun = time.perf_counter()
            result = env.step(actions)
            taken = time.perf_counter() - begun
            if step >= 10:  # after caches are warm
                times[name].append(taken * 1e3)
        bytes_up = actions.nbytes
        bytes_down.append(size_of(result))
    for env in sides.values():
        env.close()
    update = learner_ms(task, worlds)
    rows = []
    for name, taken in times.items():
        p50, p99 = np.percentile(taken, [50, 99])
        rollout = ROLLOUT * float(np.mean(taken))
        remote = name.startswith("Ray")
        rows.append(
            {
                "task": task,
                "worlds": worlds,
                "side": name,
                "sent_kB": f"{bytes_up / 1e3:.0f}" if remote else "0",
                "received_kB": f"{np.mean(bytes_down) / 1e3:.0f}" if remote else "0",
                "p50_ms": f"{p50:.2f}",
                "p99_ms": f"{p99:.2f}",
                "steps_per_s": f"{worlds / np.mean(taken) * 1e3:.0f}",
                "update_ms": f"{update:.0f}",
                "learner_share": f"{update / (update + rollout):.2f}",
            }
        )
    return rows


def main() -> None:
    """Measure all cases, print and write the results."""
    parser = argparse.ArgumentParser(description="What Ray costs a step, on one machine.")
    parser.add_argument("--steps", type=int, default=500, help="steps of each side (default 500)")
    args = parser.parse_args()
    cluster = Cluster(
        initialize_head=True, head_node_args={"num_cpus": 0, "include_dashboard": False, "object_store_memory": STORE}
    )
    for _ in range(NODES):
        cluster.add_node(num_cpus=2, object_store_memory=STORE)
    ray.init(address=cluster.address, log_to_driver=False)
    rows = [row for task, worlds in CASES for row in measure(task, worlds, args.steps)]
    load = f"{os.getloadavg()[0]:.0f}"
    ray.shutdown()
    cluster.shutdown()
    print_table(rows)
    facts = {"command": f"python -m benches ray_cluster --steps {args.steps}", "ray": ray.__version__}
    write_results(
        "ray_cluster", rows, facts | {"nodes": "three raylets on this machine", "load": load, "nice": os.nice(0)}
    )


if __name__ == "__main__":
    main()
