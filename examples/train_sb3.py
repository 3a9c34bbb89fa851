"""Train a policy with Stable-Baselines3's PPO.

    pip install stable-baselines3 torch tqdm
    python examples/train_sb3.py CartPoleSwingUp --seed 0

In ``out/sb3/TASK-SEED`` it leaves ``model.zip`` for `PPO.load`, and ``normalize.pkl`` for `VecNormalize.load`, which
holds the means and variances by which the policy's observations were scaled.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from learning.places import OUT
from learning.program import command_line, needed, report
from numpy.typing import NDArray

from evaluation import evaluate, told
from tightloop.whole_files import whole_file

with needed("stable_baselines3", "torch", "tqdm"):
    import torch
    from stable_baselines3 import PPO
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.vec_env import VecNormalize
    from tqdm import tqdm

    from tightloop.adapters.sb3 import Sb3VecEnv

RUNS = OUT / "sb3"
EVALUATED = 20  # rollouts between two evaluations


@dataclass(frozen=True)
class Preset:
    """What differs from task to task."""

    rollouts: int
    num_envs: int
    steps: int = 24  # of a rollout, in every world
    hidden: int = 128  # units of each of two layers, in actor and critic
    gamma: float = 0.99  # what a reward is worth one step later
    lam: float = 0.95  # λ of the advantages
    lr: float = 1e-3  # learning rate at the start; it falls to a tenth
    std: float = 1.0  # standard deviation of actions at the start
    minibatches: int = 4  # of an epoch

    @property
    def total(self) -> int:
        """Env steps of all worlds together."""
        return self.rollouts * self.steps * self.num_envs


PRESETS = {
    "CartPoleBalance": Preset(30, 512, hidden=64),
    "CartPoleSwingUp": Preset(80, 512, steps=64, hidden=64, gamma=0.98, lr=2e-3),
    "FrankaReach": Preset(150, 512, gamma=0.9, lam=0.9, std=0.6),
    "QuadrupedVelocityFlat": Preset(160, 1024, gamma=0.97, lr=2e-3, std=0.7, minibatches=8),
}


class Progress(BaseCallback):
    """A progress bar in a terminal, and an evaluation every so many rollouts."""

    def __init__(self, task: str, rollouts: int, normalize: VecNormalize, threads: int) -> None:
        super().__init__()
        self._task, self._rollouts, self._normalize, self._threads = task, rollouts, normalize, threads
        self._done, self.found = 0, {}

    def act(self, obs: NDArray[np.float32]) -> NDArray[Any]:
        """The most likely actions."""
        return self.model.predict(self._normalize.normalize_obs(obs), deterministic=True)[0]

    def _on_training_start(self) -> None:
        self._bar = tqdm(total=self._rollouts, desc=self._task, unit="rollout", disable=None)

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        # the policy is that of the rollout before
        self._done += 1
        self._bar.update()
        if self._done % EVALUATED == 0 and self._done < self._rollouts:
            self.evaluate()

    def _on_training_end(self) -> None:
        self.evaluate()
        self._bar.close()

    def evaluate(self) -> None:
        """Evaluate, and show it."""
        self.found = evaluate(self._task, self.act, threads=self._threads)
        self._bar.set_postfix(told(self.found))
        report(self._task, f"{self._done} of {self._rollouts} rollouts", self.found)


def train(task: str, preset: Preset, seed: int, folder: Path, threads: int) -> dict[str, float]:
    """Train, show how it goes, and save; returns the last evaluation."""
    # the adapter sets torch's threads to 1: more would take cores from the simulation
    env = VecNormalize(Sb3VecEnv(task, preset.num_envs, threads=threads), gamma=preset.gamma)
    try:
        model = PPO(
            "MlpPolicy",
            env,
            learning_rate=lambda left: preset.lr * max(0.1, left),
            n_steps=preset.steps,
            batch_size=preset.num_envs * preset.steps // preset.minibatches,
            n_epochs=5,
            gamma=preset.gamma,
            gae_lambda=preset.lam,
            seed=seed,
            device="cpu",
            policy_kwargs={
                "net_arch": [preset.hidden] * 2,
                "activation_fn": torch.nn.ELU,
                "log_std_init": float(np.log(preset.std)),
            },
        )
        progress = Progress(task, preset.rollouts, env, threads)
        model.learn(preset.total, callback=progress, log_interval=None)
        with whole_file(folder / "model.zip") as part:
            model.save(part)
        with whole_file(folder / "normalize.pkl") as part:
            env.save(str(part))
        return progress.found
    finally:
        env.close()


if __name__ == "__main__":
    command_line("Stable-Baselines3", PRESETS, RUNS, train, "model.zip")
