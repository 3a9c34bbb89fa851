"""Train by PPO in several processes: each has a daemon with its share of the worlds, and torch averages gradients.

    pip install matplotlib onnx onnxscript tensorboard torch tqdm
    torchrun --nproc-per-node 2 examples/train_ddp.py CartPoleBalance --seed 0

Each rank collects rollouts in its own worlds and learns from them. `DistributedDataParallel` averages the gradients of
every minibatch, so all ranks have the same weights. Rank 0 evaluates, and leaves the policy as ``policy.onnx`` in
``out/ddp/TASK-SEED``. Networks, rollouts and presets are those of ``ppo.py``.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from learning.config import PRESETS, Config
from learning.places import OUT
from learning.program import needed, report
from numpy.typing import NDArray

from evaluation import evaluate, told
from tightloop.adapters.torchrun import Rank
from tightloop.env import AutoresetMode, policy_metadata

# all but torch are needed by ppo.py, or at the end for the policy's file
with needed("matplotlib", "onnx", "onnxscript", "tensorboard", "torch", "tqdm"):
    import torch
    import torch.distributed as dist
    from learning.agent import Agent, Normalizer
    from learning.optimizer import Optimizer
    from learning.rollout import Rollout
    from policy_file import export
    from torch import Tensor, nn
    from torch.nn.parallel import DistributedDataParallel

RUNS = OUT / "ddp"


class Loss(nn.Module):
    """The loss of a minibatch, as a module: `DistributedDataParallel` averages gradients of a module's forward.

    The weights of the entropy and of ``calm`` stay the same, also with ``anneal`` in the preset.
    """

    def __init__(self, agent: Agent, config: Config) -> None:
        super().__init__()
        self.agent, self.config = agent, config

    def forward(self, batch: tuple[Tensor, ...]) -> tuple[Tensor, Tensor]:
        """Return the loss, and the change of the policy as its mean KL divergence [nats]."""
        obs, action, mean_old, log_old, advantage, target = batch
        agent, clip = self.agent, self.config.clip
        mean, std = agent(obs), torch.exp(agent.log_std)
        ratio = torch.exp(agent.log_prob(mean, action) - log_old)
        better = torch.min(ratio * advantage, ratio.clamp(1.0 - clip, 1.0 + clip) * advantage)
        value = ((agent.value(obs) - target) ** 2).mean()
        # the standard deviation moves little within a rollout
        change = (((mean - mean_old) / std) ** 2).sum(-1).mean().detach() / 2.0
        loss = value - better.mean() - self.config.entropy * agent.log_std.sum()
        return loss + self.config.calm * mean.square().sum(1).mean(), change


def of_all_ranks(values: Tensor) -> Tensor:
    """Values of all ranks, one after the other."""
    parts = [torch.empty_like(values) for _ in range(dist.get_world_size())]
    dist.all_gather(parts, values.contiguous())
    return torch.cat(parts)


class Trainer:
    """A rank's part of a run."""

    def __init__(self, rank: Rank, task: str, seed: int, config: Config) -> None:
        rows = rank.worlds(config.num_envs)
        self.config = replace(config, num_envs=rows.stop - rows.start)
        self.envs = rank.make_env(task, config.num_envs, autoreset_mode=AutoresetMode.SAME_STEP, copy=False)
        if self.envs.evaluation.privileged_space is not None:
            raise SystemExit(f"train_ddp.py: the critic of {task} sees more than its actor; choose another task")
        (inputs,), (actions,) = self.envs.single_observation_space.shape, self.envs.single_action_space.shape
        torch.manual_seed(seed)  # all ranks begin with the same weights
        self.agent = Agent(inputs, actions, inputs, config.hidden, config.std)
        self.loss = DistributedDataParallel(Loss(self.agent, config))
        self.optimizer = Optimizer(self.agent, config.lr, muon=config.muon)
        self.rollout = Rollout(self.config, inputs, actions, None, torch.device("cpu"))
        self.noise = torch.Generator().manual_seed(seed * rank.size + rank.rank)  # each rank acts on its own
        self.seen = torch.from_numpy(self.envs.reset(seed=seed << 40)[0]).float()
        if self.envs.max_episode_steps is not None:
            spread = np.random.default_rng(rank.rank)
            self.envs.elapsed = spread.integers(0, self.envs.max_episode_steps, self.config.num_envs)

    @torch.no_grad()
    def collect(self) -> None:
        """Fill the rollout of this rank's worlds."""
        config, r, agent = self.config, self.rollout, self.agent
        for step in range(config.steps):
            r.see(step, self.seen, self.seen)
            mean = agent(r.obs[step])
            action = mean + torch.exp(agent.log_std) * torch.randn(mean.shape, generator=self.noise)
            r.action[step], r.log_prob[step] = action, agent.log_prob(mean, action)
            obs, reward, terminated, truncated, infos = self.envs.step(action.numpy())
            self.seen = torch.from_numpy(obs).float()
            r.reward[step].copy_(torch.from_numpy(reward)).mul_(config.reward_scale)
            r.done[step].copy_(torch.from_numpy(terminated | truncated))
            cut = np.flatnonzero(truncated & ~terminated)
            if len(cut):  # goes on in the critic's estimate
                r.cuts.append((step, torch.from_numpy(cut), torch.from_numpy(infos["final_obs"][cut]).float()))
        r.see(config.steps, self.seen, self.seen)

    def learn(self) -> None:
        """Some epochs over the rollout, with gradients averaged over the ranks."""
        config, r = self.config, self.rollout
        with torch.no_grad():
            beyond = [self.agent.value(last) for _, _, last in r.cuts]
            looked = r.look_back(self.agent.value(r.obs), beyond)
            parts = (r.obs[: config.steps], r.action, r.log_prob, *looked)
            obs, action, log_old, advantage, target = (part.flatten(0, 1) for part in parts)
            everywhere = of_all_ranks(advantage)
            advantage = (advantage - everywhere.mean()) / (everywhere.std() + 1e-8)
            data = (obs, action, self.agent(obs), log_old, advantage, target)
        # every rank takes as many minibatches as the others, since each waits for the others' gradients
        for _ in range(config.epochs):
            for batch in torch.randperm(len(target), generator=self.noise).chunk(config.minibatches):
                loss, change = self.loss(tuple(values[batch] for values in data))
                self.optimizer.zero_grad()
                loss.backward()
                nn.utils.clip_grad_norm_(self.agent.parameters(), config.grad_max)
                dist.all_reduce(change)
                # the same on all ranks
                self.optimizer.follow(change.item() / dist.get_world_size(), self.config.kl)
                self.optimizer.step()
        seen = of_all_ranks(obs)
        normalizers: tuple[Normalizer, ...] = (self.agent.normalizer, self.agent.critic_normalizer)
        for normalizer in normalizers:
            normalizer.see(seen)

    @torch.no_grad()
    def act(self, obs: NDArray[np.float32]) -> NDArray[np.float32]:
        """The most likely actions."""
        return self.agent(torch.from_numpy(obs).float()).numpy()


def is_same_on_all_ranks(agent: nn.Module) -> bool:
    """Whether weights and statistics of all ranks are equal, bit for bit."""
    values: list[Any] = [*agent.parameters(), *agent.buffers()]
    ranks = of_all_ranks(torch.cat([value.detach().reshape(-1) for value in values])[None])
    return bool((ranks == ranks[0]).all())


def main() -> None:
    """Train on this rank; rank 0 reports."""
    parser = argparse.ArgumentParser(description="Train a policy by PPO, with several processes under torchrun.")
    parser.add_argument("task", choices=PRESETS, help="what to learn")
    parser.add_argument("--seed", type=int, default=0, help="of weights, actions and episodes (default 0)")
    parser.add_argument("--rollouts", type=int, default=60, help="rollouts to learn from (default 60)")
    parser.add_argument("--out", type=Path, default=RUNS, help="folder of all runs (default out/ddp/)")
    args = parser.parse_args()
    rank, config = Rank.of_process(), PRESETS[args.task]
    torch.set_num_threads(1)  # several would take cores from the daemons
    dist.init_process_group("gloo")
    trainer, begun = Trainer(rank, args.task, args.seed, config), time.perf_counter()
    learning = 0.0
    for number in range(1, args.rollouts + 1):
        trainer.collect()
        collected = time.perf_counter()
        trainer.learn()
        learning += time.perf_counter() - collected
        if rank.rank == 0 and number % max(1, args.rollouts // 4) == 0:
            found = evaluate(args.task, trainer.act, threads=1)
            report(args.task, f"{number} of {args.rollouts} rollouts", found)
    seconds = time.perf_counter() - begun
    if not is_same_on_all_ranks(trainer.agent):
        raise SystemExit("train_ddp.py: the ranks have different weights; this is a bug")
    if rank.rank == 0:
        folder = args.out / f"{args.task}-{args.seed}"
        folder.mkdir(parents=True, exist_ok=True)
        policy = folder / "policy.onnx"
        export(trainer.agent, trainer.envs.single_observation_space.shape[0], policy, policy_metadata(trainer.envs))
        steps = args.rollouts * config.steps * config.num_envs
        print(f"{args.task}, seed {args.seed}: {steps / 1e6:.1f} M steps in {seconds:.0f} s on {rank.size} ranks")
        print(f"learning and waiting for other ranks took {learning / seconds:.0%} of it")
        found = evaluate(args.task, trainer.act, threads=1)
        print(", ".join(f"{name} {value}" for name, value in told(found).items()) + f"; {policy}")
    trainer.envs.close()
    dist.destroy_process_group()


if __name__ == "__main__":
    main()
