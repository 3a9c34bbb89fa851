"""A side of benches/env/mjlab_tasks.py: a task of mjlab on one class of simulation, in a process of its own.

mjlab is changed when it is imported, so each side has a process. It reads a line of JSON for each thing to do, and
answers each with one.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import sys
import time
from collections.abc import Callable
from importlib.metadata import version
from typing import Any

# mjlab takes a GPU where torch sees one
os.environ["CUDA_VISIBLE_DEVICES"] = ""

import torch  # pyright: ignore[reportMissingImports]

#: Standard deviation of random actions: that of an untrained policy of mjlab.
SPREAD = 1.0
ACTIONS, SEED = 16, 0


class Side:
    """An environment at work."""

    def __init__(self, side: str) -> None:
        if side == "mjbatch":
            from mjbatch_simulation import install  # its libraries are on the path of this side only

            install()
        elif side == "tightloop":
            from tightloop.adapters import mjlab

            mjlab.install()

    def start(self, task: str, worlds: int, settle: int) -> None:
        """Make an environment, and step it a while."""
        import mjlab.tasks  # pyright: ignore[reportMissingImports]  # noqa: F401
        from mjlab.envs import ManagerBasedRlEnv  # pyright: ignore[reportMissingImports]
        from mjlab.tasks.registry import load_env_cfg  # pyright: ignore[reportMissingImports]

        torch.set_num_threads(len(os.sched_getaffinity(0)))
        cfg = load_env_cfg(task)
        cfg.scene.num_envs, cfg.seed = worlds, SEED
        self.env = ManagerBasedRlEnv(cfg, device="cpu")
        generator = torch.Generator().manual_seed(SEED)
        shape = (ACTIONS, worlds, self.env.single_action_space.shape[0])
        self.actions, self.count = SPREAD * torch.randn(shape, generator=generator), 0
        self.spent = {"physics": 0.0, "forward": 0.0}
        sim = self.env.sim
        sim.step, sim.forward = self._clocked(sim.step, "physics"), self._clocked(sim.forward, "forward")
        self.env.reset()
        for _ in range(settle):
            self._step()

    def _clocked(self, method: Callable[[], None], name: str) -> Callable[[], None]:
        def call() -> None:
            begin = time.perf_counter()
            method()
            self.spent[name] += time.perf_counter() - begin

        return call

    def _step(self) -> Any:
        self.count += 1
        return self.env.step(self.actions[self.count % ACTIONS])

    def turn(self, seconds: float) -> dict[str, float]:
        """Step for that long, and at least twice.

        Returns:
            Environment steps per second, milliseconds of a control step for each part, and ends of episodes per 1000.
        """
        self.spent, steps, ends = dict.fromkeys(self.spent, 0.0), 0, 0
        begin = time.perf_counter()
        while (passed := time.perf_counter() - begin) < seconds or steps < 2:
            _, _, terminated, cut, _ = self._step()
            ends += int((terminated | cut).sum())
            steps += 1
        parts = self.spent | {"rest": passed - sum(self.spent.values())}
        return {
            "env_steps_per_s": steps * self.env.num_envs / passed,
            **{f"{name}_ms": 1e3 * taken / steps for name, taken in parts.items()},
            "ends_per_1000": 1e3 * ends / (steps * self.env.num_envs),
        }


def main() -> None:
    """Do what the lines of stdin say, until it closes."""
    answers = sys.stdout
    # Warp and mjlab print tables
    with contextlib.redirect_stdout(io.StringIO()):
        side = Side(sys.argv[1])
        names = ("mjlab", "mujoco", "mujoco-warp", "warp-lang", "torch") + ("mjbatch",) * (sys.argv[1] == "mjbatch")
        print(json.dumps({name: version(name) for name in names}), file=answers, flush=True)
        for line in sys.stdin:
            request = json.loads(line)
            print(json.dumps(getattr(side, request.pop("do"))(**request)), file=answers, flush=True)


if __name__ == "__main__":
    main()
