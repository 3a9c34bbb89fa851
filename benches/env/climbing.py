"""How many robots cross stairs, blocks and slopes with a policy of QuadrupedVelocityRough.

    pip install onnxruntime
    python -m benches climbing examples/trained/QuadrupedVelocityRough.onnx

Each of 128 robots starts in the middle of a tile and has to walk ahead with 0.6 m/s for 12 s, in its own direction.
It crosses the tile if it comes 3.2 m away from its start.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime

from tightloop.env import AutoresetMode, VectorEnv
from tightloop.env.task import Array, Namespace, Worlds
from tightloop.tasks.quadruped_rough import FAR, HARDEST, LEVELS, QuadrupedVelocityRough

WORLDS, STEPS, SPEED = 128, 600, 0.6  # [–, –, m/s]
GROUNDS = {  # kinds of tiles whose first column leads up, and the second, if there is one, down
    "slopes up": ("slopes",),
    "blocks and pits": ("steps",),
    "stairs up": ("stairs",),
    "stairs down": ("stairs", "stairs"),
}
SHOWN = (2, 4, 6)  # levels


class Ahead(QuadrupedVelocityRough):
    """The command is to walk ahead."""

    def goal(self, xp: Namespace, worlds: Worlds, draws: Array) -> Array:
        """Return the command."""
        none = 0.0 * draws[:, 0]
        return xp.stack([none + SPEED, none, none], 1)


class AheadDown(Ahead):
    """It starts on the tiles of the second column."""

    def initial_state(self, xp: Namespace, worlds: Worlds, draws: Array) -> dict[str, Array]:
        """Return places in the second column."""
        draws[:, 2] = 0.75
        return dict(super().initial_state(xp, worlds, draws))


def crossed(policy: Any, ground: str, level: int) -> tuple[float, float]:
    """Return the shares of robots that cross the tile, and that fall before; the policy is a session of onnxruntime."""
    kinds = GROUNDS[ground]
    task = (Ahead if len(kinds) == 1 else AheadDown)(0.0, kinds=kinds, level=level)
    envs = VectorEnv(task, WORLDS, autoreset_mode=AutoresetMode.SAME_STEP, max_episode_steps=STEPS)
    try:
        obs, _ = envs.reset(seed=3)
        going, far, fell = np.ones(WORLDS, bool), np.zeros(WORLDS), np.zeros(WORLDS, bool)
        for _ in range(STEPS):
            obs, _, terminated, truncated, infos = envs.step(policy.run(["action"], {"obs": obs})[0])
            far[going] = np.maximum(far, infos["farthest"])[going]
            fell |= going & terminated & (far < FAR)
            going &= ~(terminated | truncated)
    finally:
        envs.close()
    return float((far > FAR).mean()), float(fell.mean())


def rows(policy: Any) -> Iterator[tuple[str, float, float, float]]:
    """Ground, its size [m], or slope [–], and the shares that cross and fall."""
    for ground, kinds in GROUNDS.items():
        for level in SHOWN:
            yield ground, HARDEST[kinds[0]] * (level + 1) / LEVELS, *crossed(policy, ground, level)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="How many robots cross stairs, blocks and slopes.")
    parser.add_argument("policy", type=Path, help="policy as ONNX")
    args = parser.parse_args()
    policy = onnxruntime.InferenceSession(args.policy, providers=["CPUExecutionProvider"])
    print("| ground | height or slope | crossed | fell |\n|---|---|---|---|")
    for ground, size, share, fell in rows(policy):
        print(f"| {ground} | {size:.3g} | {share:.0%} | {fell:.0%} |", flush=True)


if __name__ == "__main__":
    main()
