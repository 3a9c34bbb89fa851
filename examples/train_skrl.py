"""Train a policy with skrl's PPO.

    pip install skrl torch tqdm
    python examples/train_skrl.py QuadrupedVelocityFlat --seed 0

In ``out/skrl/TASK-SEED`` it leaves ``model.pt`` for `PPO.load`, with the means and variances by which observations and
values were scaled.
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

with needed("skrl", "torch", "tqdm"):
    import torch
    from skrl.agents.torch.ppo import PPO, PPO_CFG
    from skrl.memories.torch import RandomMemory
    from skrl.models.torch import DeterministicMixin, GaussianMixin, Model
    from skrl.resources.preprocessors.torch import RunningStandardScaler
    from skrl.resources.schedulers.torch import KLAdaptiveLR
    from skrl.trainers.torch import SequentialTrainer, SequentialTrainerCfg
    from skrl.utils import set_seed
    from torch import Tensor, nn
    from tqdm import tqdm

    from tightloop.adapters.skrl import SkrlEnv

RUNS = OUT / "skrl"
EVALUATED = 20  # updates between two evaluations


@dataclass(frozen=True)
class Preset:
    """What differs from task to task."""

    updates: int
    num_envs: int
    steps: int = 24  # of a rollout, in every world
    hidden: int = 128  # units of each of two layers, in actor and critic
    gamma: float = 0.99  # what a reward is worth one step later
    lam: float = 0.95  # λ of the advantages
    kl: float = 0.01  # change of the policy that the learning rate aims at
    std: float = 1.0  # standard deviation of actions at the start

    @property
    def total(self) -> int:
        """Env steps of all worlds together."""
        return self.updates * self.steps * self.num_envs


PRESETS = {
    "CartPoleBalance": Preset(40, 512, hidden=64),
    "QuadrupedVelocityFlat": Preset(120, 1024, gamma=0.97, kl=0.02, std=0.7),
}


def mlp(inputs: int, hidden: int, outputs: int) -> nn.Sequential:
    """Two hidden layers."""
    return nn.Sequential(
        nn.Linear(inputs, hidden), nn.ELU(), nn.Linear(hidden, hidden), nn.ELU(), nn.Linear(hidden, outputs)
    )


class Actor(GaussianMixin, Model):
    """Actions are normal about the output of a network."""

    def __init__(self, env: SkrlEnv, preset: Preset) -> None:
        Model.__init__(self, observation_space=env.observation_space, action_space=env.action_space, device=env.device)
        GaussianMixin.__init__(self)
        self.net = mlp(self.num_observations, preset.hidden, self.num_actions)
        self.log_std = nn.Parameter(torch.full((self.num_actions,), float(np.log(preset.std))))

    def compute(self, inputs: dict[str, Any], role: str) -> tuple[Tensor, dict[str, Any]]:
        """The means, for skrl."""
        return self.net(inputs["observations"]), {"log_std": self.log_std}


class Critic(DeterministicMixin, Model):
    """What is still to come."""

    def __init__(self, env: SkrlEnv, preset: Preset) -> None:
        Model.__init__(self, observation_space=env.observation_space, action_space=env.action_space, device=env.device)
        DeterministicMixin.__init__(self)
        self.net = mlp(self.num_observations, preset.hidden, 1)

    def compute(self, inputs: dict[str, Any], role: str) -> tuple[Tensor, dict[str, Any]]:
        """The values, for skrl."""
        return self.net(inputs["observations"]), {}


def configuration(preset: Preset, env: SkrlEnv) -> PPO_CFG:
    """What `PPO` takes."""
    return PPO_CFG(
        rollouts=preset.steps,
        learning_epochs=5,
        mini_batches=4,
        discount_factor=preset.gamma,
        gae_lambda=preset.lam,
        learning_rate=1e-3,
        learning_rate_scheduler=KLAdaptiveLR,
        learning_rate_scheduler_kwargs={"kl_threshold": preset.kl, "max_lr": 3e-3, "min_lr": 1e-5},
        observation_preprocessor=RunningStandardScaler,
        observation_preprocessor_kwargs={"size": env.observation_space, "device": env.device},
        value_preprocessor=RunningStandardScaler,
        value_preprocessor_kwargs={"size": 1, "device": env.device},
        grad_norm_clip=1.0,
        value_loss_scale=1.0,
        time_limit_bootstrap=True,
        experiment={"write_interval": 0, "checkpoint_interval": 0},
    )


def train(task: str, preset: Preset, seed: int, folder: Path, threads: int) -> dict[str, float]:
    """Train, show how it goes, and save; returns the last evaluation."""
    set_seed(seed)
    # the adapter sets torch's threads to 1: more would take cores from the simulation
    env = SkrlEnv(task, preset.num_envs, threads=threads)
    try:
        agent = PPO(
            models={"policy": Actor(env, preset), "value": Critic(env, preset)},
            memory=RandomMemory(memory_size=preset.steps, num_envs=env.num_envs, device=env.device),
            cfg=configuration(preset, env),
            observation_space=env.observation_space,
            action_space=env.action_space,
            device=env.device,
        )
        steps = SequentialTrainerCfg(
            timesteps=preset.steps * EVALUATED, disable_progressbar=True, close_environment_at_exit=False, headless=True
        )
        trainer = SequentialTrainer(env=env, agents=agent, cfg=steps)

        @torch.no_grad()
        def act(obs: NDArray[np.float32]) -> NDArray[Any]:
            agent.enable_training_mode(False)
            _, outputs = agent.act(torch.tensor(obs), None, timestep=0, timesteps=1)
            return outputs["mean_actions"].numpy()

        found: dict[str, float] = {}
        with tqdm(total=preset.updates, desc=task, unit="update", disable=None) as bar:
            for done in range(0, preset.updates, EVALUATED):
                count = min(EVALUATED, preset.updates - done)
                trainer.cfg.timesteps = preset.steps * count
                trainer.train()
                found = evaluate(task, act, threads=threads)
                bar.update(count)
                bar.set_postfix(told(found))
                report(task, f"{done + count} of {preset.updates} updates", found)
        with whole_file(folder / "model.pt") as part:
            agent.save(str(part))
        return found
    finally:
        env.close()


if __name__ == "__main__":
    command_line("skrl", PRESETS, RUNS, train, "model.pt")
