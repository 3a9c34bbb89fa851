"""Proximal policy optimisation (Schulman et al. 2017, arXiv 1707.06347), made for the zero-copy loop.

    pip install matplotlib onnx onnxscript tensorboard torch tqdm
    python examples/ppo.py FrankaReach --seed 0     # with the wheel alone: python -m tightloop.train FrankaReach

Observations are read where the environment puts them, a ring of slots; each is copied once, into the rollout. What
an action led to is learned from with generalised advantages (arXiv 1506.02438); an episode that was cut off is
continued by the critic's value of its last observation. The learning rate follows the change of the policy (its KL
divergence).

In ``out/ppo/TASK-SEED`` it leaves a checkpoint every few seconds (``--resume`` goes on from it), the log for
TensorBoard, the curve as CSV and PNG, and the policy as ONNX with its metadata, which ``examples/play.py`` runs.
``--wandb`` logs to Weights & Biases, too. ``--film-every 5`` films the policy every five minutes, in another process.
It writes elsewhere only with ``--out``. With ``--daemon NAME`` it joins worlds that
``python -m tightloop.env serve TASK --name NAME`` keeps, so that it can be killed and come back.

A terminal shows a progress bar; a file or a pipe gets a line per evaluation. The log has all metrics of the task. Terms
of a reward are in it if `Task.metrics` returns them; a name should end with its unit, such as ``height_m``.
"""

from __future__ import annotations

import argparse
import copy
import math
import os
import sys
import time
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

# Threads of torch that wait for each other by spinning take the processor from the simulation
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

import numpy as np
from learning.films import Films
from learning.log import Log, Statistics
from learning.places import OUT, PLAY
from learning.program import draw, needed, report
from learning.watch import TermWatch, nothing_learnt
from numpy.typing import NDArray

from evaluation import FINAL_SEED, episodes, evaluate, told, told_with_intervals, with_unit
from tightloop.env import AutoresetMode, VectorEnv, policy_metadata
from tightloop.env.mirror import MirrorColumns
from tightloop.errors import TightloopError
from tightloop.whole_files import whole_file

# onnx and onnxscript are needed only at the end, for the policy's file
with needed("matplotlib", "onnx", "onnxscript", "tensorboard", "torch", "tqdm"):
    import torch
    from learning.agent import Agent
    from policy_file import export
    from torch import Tensor, nn
    from tqdm import tqdm

MODEL_MINUTES = 10.0  # for robots that are not the task's own, at least
RUNS = OUT / "ppo"


@dataclass(frozen=True)
class Config:
    """Numbers of a run; the command line changes any of them."""

    minutes: float = 3.0  # how long to train, evaluations and waiting included
    num_envs: int = 2048
    steps: int = 24  # of a rollout, in every world
    epochs: int = 5  # that a rollout is learned from
    minibatches: int = 4  # of an epoch
    hidden: int = 128  # units of each of two layers, in actor and critic
    gamma: float = 0.99  # what a reward is worth one step later
    lam: float = 0.95  # λ of the advantages
    clip: float = 0.2  # of the ratio of probabilities
    entropy: float = 0.0  # weight of the entropy in the loss
    lr: float = 1e-3  # learning rate at the start
    kl: float = 0.01  # change of the policy that the learning rate aims at, a rollout; a tenth of it at the end
    std: float = 0.6  # standard deviation of actions at the start
    grad_max: float = 1.0  # norm of a gradient, at most
    reward_scale: float = 1.0  # of the rewards that are learned from, which should be some hundredths a step
    symmetry: bool = False  # whether to learn from the mirror image too, if the task has one
    evaluate: float = 15.0  # seconds between evaluations
    film_every: float = 0.0  # minutes between films of the policy; 0 for none
    total: int = 0  # env steps after which to stop, instead of minutes; the same run then has the same bits
    evaluate_steps: int = 1_000_000  # env steps between them, if the run ends by steps
    enough: float = 2.0  # success at which to stop before the time is over; above 1 it never does
    threads: int = 1  # of the simulation
    torch_threads: int = 1  # of the learner, and of the policy beside the simulation


PRESETS = {
    "CartPoleBalance": Config(minutes=0.5, num_envs=512, hidden=64, threads=1),
    "CartPoleSwingUp": Config(
        1.0, 256, 64, minibatches=8, hidden=64, gamma=0.98, kl=0.02, std=1.0, evaluate=10.0, threads=1
    ),
    "FrankaReach": Config(3.0, 512, 32, minibatches=16, gamma=0.9, kl=0.02, std=1.0),
    "FrankaPushCube": Config(
        15.0, 1024, 20, epochs=8, minibatches=32, gamma=0.9, lam=0.9, hidden=256, kl=0.02, evaluate=30.0
    ),
    "FrankaPickCube": Config(
        60.0, 1024, 20, epochs=8, minibatches=32, gamma=0.8, lam=0.9, hidden=256, kl=0.02, evaluate=60.0
    ),
    "QuadrupedVelocityFlat": Config(5.0, 2048, 16, epochs=4, gamma=0.97, kl=0.02, std=0.7, evaluate=60.0),
    "QuadrupedVelocityRough": Config(60.0, 1024, 24, epochs=4, gamma=0.98, kl=0.02, std=0.7, evaluate=120.0),
    "HumanoidVelocityFlat": Config(60.0, 2048, 16, epochs=4, gamma=0.98, kl=0.02, std=0.7, evaluate=120.0),
    "AntRun": Config(5.0, 1024, 16, epochs=4, kl=0.02, std=0.6, evaluate=60.0),
    "Ant-v5": Config(10.0, 1024, 16, epochs=4, kl=0.02, std=0.4, reward_scale=0.02, evaluate=60.0),
    "FrankaLift": Config(minutes=30.0, num_envs=2048, gamma=0.98, hidden=256, entropy=0.005, evaluate=60.0),
}


class Rollout:
    """What all worlds did for some steps, ``(steps, worlds, …)``."""

    def __init__(
        self, config: Config, inputs: int, actions: int, critic_inputs: int | None, device: torch.device
    ) -> None:
        def room(*shape: int) -> Tensor:
            return torch.zeros((config.steps, config.num_envs, *shape), device=device)

        self.obs, self.action = room(inputs), room(actions)
        # the critic sees the same, or more
        self.critic_obs = self.obs if critic_inputs is None else room(critic_inputs)
        self.reward, self.done, self.log_prob, self.value, self.advantage = (room() for _ in range(5))

    def look_back(self, last: Tensor, config: Config) -> None:
        """Advantages, from the last step to the first; ``last`` is the value of the observations after it."""
        following, advantage = last, torch.zeros_like(last)
        for step in reversed(range(len(self.reward))):
            goes_on = 1.0 - self.done[step]
            error = self.reward[step] + config.gamma * goes_on * following - self.value[step]
            advantage = error + config.gamma * config.lam * goes_on * advantage
            self.advantage[step] = advantage
            following = self.value[step]


class Trainer:
    """A run: environment, agent, optimiser, and how far it is.

    One thread steps the worlds with a copy of the agent, while another learns from the rollout before.
    """

    def __init__(
        self,
        task: str,
        seed: int,
        config: Config,
        folder: Path,
        *,
        daemon: str | None,
        device: str,
        made: Mapping[str, Any] | None = None,
    ) -> None:
        """Start the environment, in which `made` are the arguments of the task, such as its ``model``."""
        torch.set_num_threads(config.torch_threads)
        torch.manual_seed(seed)
        self.task, self.seed, self.config, self.folder = task, seed, config, folder
        self.made = dict(made or {})
        options = {"threads": config.threads} if daemon is None else {"daemon": daemon}
        self.envs = VectorEnv(
            task, config.num_envs, autoreset_mode=AutoresetMode.SAME_STEP, copy=False, **self.made, **options
        )
        (inputs,), (actions,) = (self.envs.single_observation_space.shape, self.envs.single_action_space.shape)
        space = self.envs.evaluation.privileged_space
        critic_inputs = None if space is None else space.shape[0]
        self.device = torch.device(device)
        self.sizes = (inputs, actions, inputs if critic_inputs is None else critic_inputs, config.hidden, config.std)
        self.agent = Agent(*self.sizes).to(self.device)
        self.optimizer = torch.optim.Adam(self.agent.parameters(), lr=config.lr, eps=1e-5)
        self.acting = copy.deepcopy(self.agent)
        self.rollouts = [Rollout(config, inputs, actions, critic_inputs, self.device) for _ in range(2)]
        self.mirror = self.envs.mirror if config.symmetry else None
        # one each: the threads that collect and learn run at once
        self.noise, self.shuffle = (torch.Generator(self.device).manual_seed(2 * seed + k) for k in range(2))
        self.statistics, self.terms = Statistics(config.num_envs), TermWatch()
        self.films = Films(task, self.made, Path(folder), config.film_every, config.threads)
        self.seconds, self.steps = 0.0, 0
        self.levels: NDArray[np.int32] | None = None  # of the curriculum, at the last checkpoint
        self.curve: list[dict[str, float]] = []

    def _seen(self, obs: NDArray[np.float32], infos: dict[str, Any]) -> tuple[Tensor, Tensor]:
        """What actor and critic see."""
        own = torch.from_numpy(obs).to(self.device, torch.float32)
        return own, torch.from_numpy(infos["privileged"]).to(self.device) if "privileged" in infos else own

    def begin(self) -> tuple[Tensor, Tensor]:
        """Start episodes that no other seed has, and no part of the run before; their ends are spread."""
        options = None if self.levels is None else {"level": self.levels}
        obs, infos = self.envs.reset(seed=(self.seed << 40) + (len(self.curve) << 24), options=options)
        if self.envs.max_episode_steps is not None:
            spread = np.random.default_rng(len(self.curve))
            self.envs.elapsed = spread.integers(0, self.envs.max_episode_steps, self.config.num_envs)
        return self._seen(obs, infos)

    @torch.no_grad()
    def collect(self, seen: tuple[Tensor, Tensor], rollout: Rollout) -> tuple[Tensor, Tensor]:
        """Fill a rollout, from these observations on; returns those after it."""
        agent, config = self.acting, self.config
        std = torch.exp(agent.log_std)
        for step in range(config.steps):
            rollout.obs[step].copy_(seen[0])
            rollout.critic_obs[step].copy_(seen[1])
            mean = agent(rollout.obs[step])
            action = mean + std * torch.randn(mean.shape, generator=self.noise, device=self.device)
            rollout.action[step] = action
            rollout.log_prob[step] = agent.log_prob(mean, action)
            rollout.value[step] = agent.value(rollout.critic_obs[step])
            obs, reward, terminated, truncated, infos = self.envs.step(action.cpu().numpy())
            seen = self._seen(obs, infos)
            rollout.reward[step].copy_(torch.from_numpy(reward)).mul_(config.reward_scale)
            rollout.done[step].copy_(torch.from_numpy(terminated | truncated))
            self.statistics.see(reward, terminated | truncated, infos)
            cut = np.flatnonzero(truncated & ~terminated)
            if len(cut):
                last = infos["final_info"].get("privileged", infos["final_obs"])[cut]
                rollout.reward[step, torch.from_numpy(cut)] += config.gamma * agent.value(
                    torch.from_numpy(last).to(self.device, torch.float32)
                )
        rollout.look_back(agent.value(seen[1]), config)
        self.steps += config.steps * config.num_envs
        return seen

    def learn(self, r: Rollout, progress: float) -> dict[str, float]:
        """Some epochs of minibatches over a rollout; returns what to log. ``progress`` is that of the run.

        The agent that acted is older than the one that learns. Changes of policy and values are clipped relative to the
        latter, and its probability relative to the former is a weight (Hilton et al. 2021, arXiv 2110.00641).
        """
        config, agent = self.config, self.agent
        acted, advantage, value = (x.flatten() for x in (r.log_prob, r.advantage, r.value))
        target = advantage + value
        advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
        std_old = torch.exp(agent.log_std.detach())
        views = []
        for obs, critic_obs, action in self._views(r):
            with torch.no_grad():
                mean_old, value_old = agent(obs), agent.value(critic_obs)
                views.append((obs, critic_obs, action, mean_old, agent.log_prob(mean_old, action), value_old))
        weight = torch.exp(views[0][4] - acted).clamp(max=2.0)
        moved, losses = [], []
        for epoch in range(config.epochs):
            order = torch.randperm(len(target), generator=self.shuffle, device=self.device)
            for batch in order.chunk(config.minibatches):
                obs, critic_obs, action, mean_old, log_old, value_old = (x[batch] for x in views[epoch % len(views)])
                mean, value = agent(obs), agent.value(critic_obs)
                ratio, own = torch.exp(agent.log_prob(mean, action) - log_old), advantage[batch]
                better = torch.min(ratio * own, ratio.clamp(1.0 - config.clip, 1.0 + config.clip) * own)
                clipped = value_old + (value - value_old).clamp(-config.clip, config.clip)
                off = torch.max((value - target[batch]) ** 2, (clipped - target[batch]) ** 2).mean()
                loss = off - (weight[batch] * better).mean() - config.entropy * agent.log_std.sum()
                self.optimizer.zero_grad()
                loss.backward()
                nn.utils.clip_grad_norm_(agent.parameters(), config.grad_max)
                with torch.no_grad():
                    std = torch.exp(agent.log_std)
                    change = (std_old**2 + (mean - mean_old) ** 2) / (2.0 * std**2)
                    kl = (torch.log(std / std_old) + change - 0.5).sum(-1).mean().item()
                self._follow(kl, progress)
                self.optimizer.step()
                moved.append(kl)
                losses.append(off.item())
        agent.normalizer.see(r.obs)
        agent.critic_normalizer.see(r.critic_obs)
        return {
            "learn/kl_nats": float(np.mean(moved)),
            "learn/value_loss": float(np.mean(losses)),
            "learn/action_std": float(std_old.mean()),
            "learn/learning_rate": self.optimizer.param_groups[0]["lr"],
        }

    def _views(self, r: Rollout) -> Iterator[tuple[Tensor, Tensor, Tensor]]:
        """Observations of actor and critic, and actions: as they were and, for every other epoch, in the mirror."""
        obs, critic_obs, action = (x.flatten(0, 1) for x in (r.obs, r.critic_obs, r.action))
        yield obs, critic_obs, action
        if self.mirror is None:
            return

        def flip(rows: Tensor, columns: MirrorColumns) -> Tensor:
            return rows[:, torch.from_numpy(columns.order)] * torch.from_numpy(columns.signs).to(rows.device)

        own, acts, critic = self.mirror
        yield flip(obs, own), flip(critic_obs, own if critic is None else critic), flip(action, acts)

    @property
    def progress(self) -> float:
        """Share of the run that is over, from 0 to 1."""
        minutes, total = self.config.minutes, self.config.total
        return min(1.0, self.steps / total if total else self.seconds / (60.0 * minutes))

    def _follow(self, kl: float, progress: float) -> None:
        """Let the learning rate follow how much the policy changes."""
        group, aim = self.optimizer.param_groups[0], self.config.kl * (1.0 - 0.9 * progress**4)
        if kl > 2.0 * aim:
            group["lr"] = max(1e-5, group["lr"] / 1.2)
        elif 0.0 < kl < 0.5 * aim:
            group["lr"] = min(3e-3, group["lr"] * 1.2)

    @torch.no_grad()
    def act(self, obs: NDArray[np.float32]) -> NDArray[np.float32]:
        """The most likely actions."""
        return self.acting(torch.from_numpy(obs).to(self.device, torch.float32)).cpu().numpy()

    def run(self, log: Log) -> None:
        """Train until the run is over; checkpoints and evaluations on the way."""
        config, begun = self.config, time.perf_counter() - self.seconds
        shown = (self.steps if config.total else self.seconds) if self.curve else -math.inf
        seen, learning, count = self.begin(), None, 0
        bar = tqdm(total=100, initial=round(100 * self.progress), unit="%", desc=self.task, disable=None)
        with bar, ThreadPoolExecutor(1, "learner") as learner:
            while self.progress < 1.0 and not (self.curve and self.curve[-1].get("success", 0.0) >= config.enough):
                rollout_begun, rollout = time.perf_counter(), self.rollouts[count % 2]
                seen = self.collect(seen, rollout)
                news = self.statistics.take() | ({} if learning is None else learning.result())
                self.acting.load_state_dict(self.agent.state_dict())
                learning, count = learner.submit(self.learn, rollout, self.progress), count + 1
                now = time.perf_counter()
                self.seconds = now - begun
                news["time/steps_per_second"] = config.steps * config.num_envs / (now - rollout_begun)
                news["time/training_s"] = self.seconds
                bar.update(round(100 * self.progress) - bar.n)
                if (warning := self.terms.see(news, self.seconds)) is not None:
                    bar.write(f"warning: {warning}", file=sys.stderr)
                if self._is_due(shown):
                    news |= learning.result()
                    self.acting.load_state_dict(self.agent.state_dict())
                    shown, learning = self.steps if config.total else self.seconds, None
                    found = evaluate(self.task, self.act, threads=config.threads, options=self.made)
                    self.curve.append({**found, "seconds": self.seconds, "steps": self.steps})
                    self.levels = self.envs.level
                    self.save()
                    bar.set_postfix(told(found) | {"steps": f"{self.steps:,}"})
                    report(self.task, f"{self.seconds:.0f} of {60 * config.minutes:.0f} s, {self.steps:,} steps", found)
                    news |= {f"evaluation/{with_unit(name)}": value for name, value in found.items()}
                    # a run that goes on from the checkpoint begins the same episodes
                    seen = self.begin()
                log.write(news, self.steps)
                if (problem := self.films.take(self.snapshot, self.seconds, self.steps)) is not None:
                    bar.write(f"warning: {problem}", file=sys.stderr)

    def _is_due(self, shown: float) -> bool:
        """Whether to evaluate, some time after the last one: seconds, or steps if the run ends by these."""
        by_steps = self.steps - shown >= self.config.evaluate_steps
        by_time = self.seconds - shown >= self.config.evaluate
        return (by_steps if self.config.total else by_time) or self.progress >= 1.0

    def snapshot(self, path: Path, about: str) -> None:
        """Write the policy to a file from which another process makes it again."""
        weights = {name: value.cpu() for name, value in self.acting.state_dict().items()}
        state = {"sizes": self.sizes, "agent": weights, "about": about}
        with whole_file(path, durable=False) as part:
            torch.save(state, part)

    def save(self) -> None:
        """Write the checkpoint."""
        state = {
            "task": self.task,
            "config": asdict(self.config),
            "agent": self.agent.state_dict(),
            "optimizer": self.optimizer.state_dict(),
            "random": [self.noise.get_state(), self.shuffle.get_state()],
            "seconds": self.seconds,
            "steps": self.steps,
            "curve": self.curve,
            "levels": None if self.levels is None else torch.from_numpy(self.levels),
        }
        with whole_file(self.folder / "checkpoint.pt") as part:
            torch.save(state, part)

    def resume(self) -> None:
        """Go on from the checkpoint."""
        state = torch.load(self.folder / "checkpoint.pt", weights_only=True)
        if state["task"] != self.task:
            raise SystemExit(f"{self.folder / 'checkpoint.pt'} is of {state['task']}, not of {self.task}")
        self.agent.load_state_dict(state["agent"])
        self.optimizer.load_state_dict(state["optimizer"])
        self.acting.load_state_dict(state["agent"])
        for generator, random in zip((self.noise, self.shuffle), state["random"], strict=True):
            generator.set_state(random)
        self.seconds, self.steps, self.curve = (state["seconds"], state["steps"], state["curve"])
        levels = state.get("levels")
        # worlds of another number draw their levels anew
        self.levels = None if levels is None or len(levels) != self.config.num_envs else levels.numpy()

    def export(self) -> Path:
        """Write the policy as ONNX with its metadata: ``obs`` (worlds, size) in, ``action`` (worlds, actions) out."""
        path = self.folder / "policy.onnx"
        export(self.agent.cpu(), self.envs.single_observation_space.shape[0], path, policy_metadata(self.envs))
        return path

    def close(self) -> None:
        """End the environment, and a film that is being made."""
        self.films.close()
        self.envs.close()


def main() -> None:
    """Train, evaluate, and leave the curve and the policy."""
    parser = argparse.ArgumentParser(
        description="Train a policy.", formatter_class=argparse.ArgumentDefaultsHelpFormatter
    )
    parser.add_argument("task", help=f"what to learn: {', '.join(PRESETS)}, or a task of your own, FILE.py:CLASS")
    parser.add_argument("--model", type=Path, help="URDF or MJCF of a robot for a velocity task, instead of its own")
    parser.add_argument("--seed", type=int, default=0, help="of weights, actions and episodes")
    parser.add_argument("--resume", action="store_true", help="go on from the checkpoint in the folder")
    parser.add_argument("--daemon", help="name of a running daemon to join")
    parser.add_argument("--device", default="cpu", help="where torch computes")
    parser.add_argument("--wandb", action="store_true", help="log to Weights & Biases, too")
    parser.add_argument("--out", type=Path, default=RUNS, help="folder of all runs")
    for option in fields(Config):
        kind = type(option.default)
        how = {"action": argparse.BooleanOptionalAction} if kind is bool else {"type": kind}
        parser.add_argument(f"--{option.name.replace('_', '-')}", help="changes the preset", **how)
    args = parser.parse_args()
    own = {option.name: getattr(args, option.name) for option in fields(Config)}
    preset = PRESETS.get(args.task, Config())
    if args.model is not None:  # its gains and weights are found, not tuned
        preset = replace(preset, minutes=max(preset.minutes, MODEL_MINUTES))
    config = replace(preset, **{name: value for name, value in own.items() if value is not None})

    made, robot = ({}, "") if args.model is None else ({"model": args.model}, f"-{args.model.stem}")
    folder = args.out / f"{args.task.rpartition(':')[2]}{robot}-{args.seed}"
    with needed(*(["wandb"] if args.wandb else []), *(["av", "PIL"] if config.film_every else [])):
        folder.mkdir(parents=True, exist_ok=True)
    try:
        trainer = Trainer(args.task, args.seed, config, folder, daemon=args.daemon, device=args.device, made=made)
    except TightloopError as problem:
        raise SystemExit(str(problem)) from None
    try:
        if args.resume and (folder / "checkpoint.pt").exists():
            trainer.resume()
            print(f"goes on after {trainer.seconds:.0f} s and {trainer.steps:,} steps")
        with Log(folder, asdict(config), wandb=args.wandb, resumed=trainer.steps > 0) as log:
            trainer.run(log)
        end = trainer.curve[-1]
        title = f"{args.task}, seed {args.seed}: {end['steps'] / 1e6:.1f} M steps, {config.threads} threads"
        draw(trainer.curve, title, folder / "curve.png")
        policy = trainer.export()
        # not the episodes by which a run may have ended
        found = episodes(args.task, trainer.act, threads=config.threads, seed=FINAL_SEED, options=made)
        print(f"{end['seconds']:.0f} s, {end['steps']:,} steps: {told_with_intervals(found)}")
        if (warning := nothing_learnt(trainer.curve)) is not None:
            print(f"warning: {warning}", file=sys.stderr)
        if (problem := trainer.films.finish()) is not None:
            print(f"warning: {problem}", file=sys.stderr)
        print(f"curve: {folder / 'curve.png'}; policy: {policy}; {PLAY} {args.task} {policy}")
    finally:
        trainer.close()


if __name__ == "__main__":
    main()
