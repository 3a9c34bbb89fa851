"""Time of a control frame with a policy inside of the daemon, beside a loop of an environment.

    pip install onnxruntime
    python -m benches policy_rollout

The quadruped follows commands by its trained policy, with 1, 64 and 1024 worlds on one thread. Sides take turns, and
the fastest of their turns counts:

- `frames without a policy`: rollouts in which the targets are held, and the robot stands;
- `rollout(policy=…)`: the same with the policy, which sees each frame in the daemon;
- `VectorEnv and onnxruntime`: a loop of a reset and steps with the same policy, which draws commands, and computes
  rewards and ends of episodes, too.

Writes benches/results/MACHINE/policy_rollout.csv.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack, closing
from pathlib import Path

import numpy as np
import onnxruntime

import tightloop as tl
from tightloop.env import VectorEnv
from tightloop.tasks.quadruped import QuadrupedVelocityFlat

sys.path.insert(0, str(Path(__file__).parents[1]))
from record import REPOSITORY, print_table, write_results

POLICY = REPOSITORY / "examples/trained/QuadrupedVelocityFlat.onnx"
FRAMES = {1: 500, 64: 250, 1024: 100}  # of a turn, by the number of worlds
FIELDS = ("joint_q", "joint_qd")


def sides(worlds: int, frames: int, stack: ExitStack) -> dict[str, Callable[[], object]]:
    """What is measured, by name; `stack` closes it."""
    task = QuadrupedVelocityFlat(pushes=0.0)
    sim = stack.enter_context(tl.launch(task.scene(), worlds=worlds, threads=1, fields=FIELDS))
    start = sim.snapshot()
    standing = np.array(task.robot.standing)
    held = {"joint_target_q": {task.robot.name: np.broadcast_to(standing, (frames, worlds, len(standing)))}}
    inputs = {"command": (0.5, 0.0, 0.0)}
    envs = stack.enter_context(closing(VectorEnv(QuadrupedVelocityFlat(pushes=0.0), worlds, threads=1, copy=False)))
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    session = onnxruntime.InferenceSession(POLICY, options, providers=["CPUExecutionProvider"])

    def loop() -> None:
        obs, _ = envs.reset(seed=0)
        for _ in range(frames):
            obs, *_ = envs.step(session.run(["action"], {"obs": obs})[0])

    return {
        "frames without a policy": lambda: sim.rollout(commands=held, start=start, fields=("joint_q",)),
        "rollout(policy=…)": lambda: sim.rollout(
            policy=POLICY, frames=frames, inputs=inputs, start=start, fields=("joint_q",)
        ),
        "VectorEnv and onnxruntime": loop,
    }


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description="Time of a control frame with a policy inside of the daemon.")
    parser.add_argument("--rounds", type=int, default=7)
    rounds = parser.parse_args().rounds
    rows: list[dict[str, str | int]] = []
    for worlds, frames in FRAMES.items():
        with ExitStack() as stack:
            measured = sides(worlds, frames, stack)
            took = dict.fromkeys(measured, float("inf"))
            for _ in range(rounds):
                for name, side in measured.items():
                    begin = time.perf_counter()
                    side()
                    took[name] = min(took[name], (time.perf_counter() - begin) / frames)
        rows += [{"worlds": worlds, "side": name, "us_a_frame": f"{1e6 * least:.0f}"} for name, least in took.items()]
    print_table(rows)
    write_results("policy_rollout", rows, {"command": f"python -m benches policy_rollout --rounds {rounds}"})


if __name__ == "__main__":
    main()
