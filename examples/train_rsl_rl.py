"""Train a policy with rsl_rl's PPO.

    pip install onnx onnxscript rsl-rl-lib torch tqdm
    python examples/train_rsl_rl.py CartPoleSwingUp --seed 0

In ``out/rsl_rl/TASK-SEED`` it leaves ``model.pt`` for `OnPolicyRunner.load` and the policy as ``policy.onnx``
with its metadata.
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
from tightloop.env import policy_metadata
from tightloop.whole_files import whole_file

# onnx and onnxscript are needed only at the end, for the policy's file
with needed("onnx", "onnxscript", "rsl_rl", "torch", "tqdm"):
    import torch
    from policy_file import export
    from rsl_rl.runners import OnPolicyRunner
    from tqdm import tqdm

    from tightloop.adapters.rsl_rl import GROUP, RslRlVecEnv

RUNS = OUT / "rsl_rl"
EVALUATED = 25  # iterations between two evaluations


@dataclass(frozen=True)
class Preset:
    """What differs from task to task."""

    iterations: int
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
        return self.iterations * self.steps * self.num_envs


PRESETS = {
    "CartPoleBalance": Preset(30, 512, hidden=64),
    "CartPoleSwingUp": Preset(80, 512, steps=64, hidden=64, gamma=0.98, kl=0.02),
    "FrankaReach": Preset(125, 512, gamma=0.9, lam=0.9, kl=0.02, std=0.6),
    "QuadrupedVelocityFlat": Preset(120, 1024, gamma=0.97, kl=0.02, std=0.7),
}


def configuration(preset: Preset, seed: int) -> dict[str, Any]:
    """What `OnPolicyRunner` takes."""
    model = {"class_name": "MLPModel", "hidden_dims": [preset.hidden] * 2, "obs_normalization": True}
    return {
        "seed": seed,
        "num_steps_per_env": preset.steps,
        "save_interval": 1_000_000,
        "obs_groups": {"actor": [GROUP], "critic": [GROUP]},
        "actor": model | {"distribution_cfg": {"class_name": "GaussianDistribution", "init_std": preset.std}},
        "critic": model,
        "algorithm": {
            "class_name": "PPO",
            "num_learning_epochs": 5,
            "num_mini_batches": 8,
            "gamma": preset.gamma,
            "lam": preset.lam,
            "learning_rate": 1e-3,
            "schedule": "adaptive",
            "desired_kl": preset.kl,
            "entropy_coef": 0.0,
            # values are not of the size of 1, to which its clipping is made
            "use_clipped_value_loss": False,
        },
    }


def train(task: str, preset: Preset, seed: int, folder: Path, threads: int) -> dict[str, float]:
    """Train, show how it goes, and save; returns the last evaluation."""
    torch.manual_seed(seed)
    # the adapter sets torch's threads to 1: more would take cores from the simulation
    env = RslRlVecEnv(task, preset.num_envs, threads=threads)
    try:
        env.reset(seed=seed)
        runner = OnPolicyRunner(env, configuration(preset, seed))

        def act(obs: NDArray[np.float32]) -> NDArray[Any]:
            policy = runner.get_inference_policy()
            with torch.inference_mode():
                return policy({GROUP: torch.tensor(obs)}).numpy()

        found: dict[str, float] = {}
        with tqdm(total=preset.iterations, desc=task, unit="it", disable=None) as bar:
            for done in range(0, preset.iterations, EVALUATED):
                count = min(EVALUATED, preset.iterations - done)
                runner.learn(count, init_at_random_ep_len=done == 0)
                found = evaluate(task, act, threads=threads)
                bar.update(count)
                bar.set_postfix(told(found))
                report(task, f"{done + count} of {preset.iterations} iterations", found)
        with whole_file(folder / "model.pt") as part:
            runner.save(str(part))
        policy = runner.alg.get_policy().as_onnx(verbose=False).to("cpu")
        size = env.env.single_observation_space.shape[0]
        export(policy, size, folder / "policy.onnx", policy_metadata(env.env))
        return found
    finally:
        env.close()


if __name__ == "__main__":
    command_line("rsl_rl", PRESETS, RUNS, train, "model.pt")
