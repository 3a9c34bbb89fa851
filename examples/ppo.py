"""Proximal policy optimisation (Schulman et al. 2017, arXiv 1707.06347), made for the zero-copy loop.

    pip install matplotlib onnx onnxscript tensorboard torch tqdm
    python examples/ppo.py FrankaReach --seed 0     # with the wheel alone: python -m tightloop.train FrankaReach
    python examples/ppo.py HumanoidVelocityFlat --model unitree_g1      # after pip install --no-deps mjlab

Observations are read where the environment puts them, a ring of slots; each is copied once, into the rollout. What
an action led to is learned from with generalised advantages (arXiv 1506.02438); an episode that was cut off is
continued by the critic's value of its last observation. The learning rate follows the change of the policy (its KL
divergence). With ``--mirror`` actor and critic are symmetric by construction, so that a step to the left teaches one to
the right. With ``--muon`` hidden layers learn by Muon, the others by Adam.

A task may observe images: parts with the shape (height, width). An estimator then learns beside the policy what only
the critic is shown (`Task.privileged_observed`), and the policy acts on its estimates.

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
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, astuple, fields, replace
from pathlib import Path
from typing import Any

# Threads of torch that wait for each other by spinning take the processor from the simulation
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

import numpy as np
from learning.config import PRESETS, ROBOTS, Config
from learning.films import Films
from learning.log import Log, Statistics
from learning.places import OUT, PLAY
from learning.program import draw, needed, report
from learning.watch import TermWatch, nothing_learnt
from numpy.typing import NDArray

from evaluation import FINAL_SEED, episodes, evaluate, told, told_with_intervals, with_unit
from tightloop.env import AutoresetMode, VectorEnv, policy_metadata
from tightloop.errors import TightloopError
from tightloop.tasks.legged_models.known import KNOWN
from tightloop.whole_files import whole_file

# onnx and onnxscript are needed only at the end, for the policy's file
with needed("matplotlib", "onnx", "onnxscript", "tensorboard", "torch", "tqdm"):
    import torch
    from learning.agent import Agent
    from learning.estimator import ESTIMATED, EstimatorTrainer, Sight
    from learning.optimizer import Optimizer
    from learning.rollout import Rollout
    from policy_file import export
    from torch import Tensor, nn
    from tqdm import tqdm

MODEL_MINUTES = 10.0  # for robots that are not the task's own, at least
RUNS = OUT / "ppo"


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
        sight = Sight.of(self.envs.task.observed(), self.envs.task.privileged_observed())
        self.device = torch.device(device)
        sizes = (inputs, actions, inputs if critic_inputs is None else critic_inputs, config.hidden, config.std)
        if config.mirror and self.envs.mirror is None:
            print(f"{task}: no mirror image of the robot is known, so actor and critic are plain", file=sys.stderr)
        mirrors = self.envs.mirror if config.mirror else None
        if sight is not None and mirrors is not None:
            raise SystemExit(f"{task}: a policy that sees images has no mirror image; give --no-mirror")
        self.agent = Agent(*sizes, mirrors=mirrors, sight=sight).to(self.device)
        self.optimizer = Optimizer(self.agent, config.lr, muon=config.muon)
        estimator = self.agent.estimator
        self.estimation = None if estimator is None else EstimatorTrainer(estimator)
        features, images = (inputs, None) if estimator is None else (estimator.outputs, inputs)
        self.acting = copy.deepcopy(self.agent)
        self.rollouts = [
            Rollout(config, features, actions, critic_inputs, self.device, images=images) for _ in range(2)
        ]
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
        if agent.estimator is not None:
            drawn = torch.rand(config.num_envs, generator=self.noise, device=self.device)
            rollout.worlds = drawn >= ESTIMATED
        for step in range(config.steps):
            own, critic = seen
            if agent.estimator is not None and rollout.images is not None:
                own = agent.features(rollout.images[step].copy_(own))
                agent.estimator.reveal(own, critic, rollout.worlds)
            rollout.see(step, own, critic)
            mean = agent.act(rollout.obs[step])
            action = mean + std * torch.randn(mean.shape, generator=self.noise, device=self.device)
            self.envs.send(action.cpu().numpy())
            # while the worlds step
            rollout.action[step] = action
            rollout.log_prob[step] = agent.log_prob(mean, action)
            obs, reward, terminated, truncated, infos = self.envs.recv()
            seen = self._seen(obs, infos)
            rollout.reward[step].copy_(torch.from_numpy(reward)).mul_(config.reward_scale)
            rollout.done[step].copy_(torch.from_numpy(terminated | truncated))
            self.statistics.see(reward, terminated | truncated, infos)
            cut = np.flatnonzero(truncated & ~terminated)
            if len(cut):
                last = infos["final_info"].get("privileged", infos["final_obs"])[cut]
                rows = torch.from_numpy(cut).to(self.device)
                rollout.cuts.append((step, rows, torch.from_numpy(last).to(self.device, torch.float32)))
        # the critic alone sees the last ones
        rollout.see(config.steps, seen[0] if agent.estimator is None else rollout.obs[-1], seen[1])
        self.steps += config.steps * config.num_envs
        return seen

    @torch.no_grad()
    def _look_back(self, r: Rollout) -> tuple[list[int], Tensor]:
        """A row for each step of each world to learn from, and the sizes of its parts, which `learn` names."""
        agent, steps = self.agent, self.config.steps
        obs, critic_obs = agent.inputs(r.obs, r.critic_obs)
        mean, value = agent.mean(obs[:steps]), agent.worth(critic_obs)
        log_prob = agent.log_prob(mean, r.action)
        advantage, target = r.look_back(value, [agent.value(last) for _, _, last in r.cuts])
        chosen = advantage[:, r.worlds]
        advantage = (advantage - chosen.mean()) / (chosen.std() + 1e-8)
        # a critic that sees the same needs no columns of its own
        of_critic = critic_obs[:steps, :, :0] if r.critic_obs is r.obs else critic_obs[:steps]
        weight = torch.exp(log_prob - r.log_prob).clamp(max=2.0)
        scalars = (log_prob, value[:steps], weight, advantage, target)
        parts = (obs[:steps], of_critic, r.action, mean, *(scalar[..., None] for scalar in scalars))
        rows = torch.cat(parts, -1)
        rows = rows if r.worlds.all() else rows[:, r.worlds]
        return [part.shape[-1] for part in parts], rows.flatten(0, 1)

    def learn(self, r: Rollout, progress: float) -> dict[str, float]:
        """Some epochs of minibatches over a rollout; returns what to log. ``progress`` is that of the run.

        The agent that acted is older than the one that learns. Changes of policy and values are clipped relative to the
        latter, and its probability relative to the former is a weight (Hilton et al. 2021, arXiv 2110.00641).
        """
        config, agent = self.config, self.agent
        sizes, rows = self._look_back(r)
        std_old, entropy = torch.exp(agent.log_std.detach()), config.entropy * (1.0 - config.anneal * progress)
        # mean actions stay near 0 where they have no effect, so that they can turn soon
        calm = config.calm * (1.0 - progress)
        moved, losses = [], []
        for _ in range(config.epochs):
            order = torch.randperm(len(rows), generator=self.shuffle, device=self.device)
            for batch in order.chunk(config.minibatches):
                obs, critic_obs, action, mean_old, *scalars = rows[batch].split(sizes, 1)
                log_old, value_old, weight, own, target = (scalar.squeeze(1) for scalar in scalars)
                mean, value = agent.mean(obs), agent.worth(critic_obs if critic_obs.shape[1] else obs)
                ratio = torch.exp(agent.log_prob(mean, action) - log_old)
                better = torch.min(ratio * own, ratio.clamp(1.0 - config.clip, 1.0 + config.clip) * own)
                clipped = value_old + (value - value_old).clamp(-config.clip, config.clip)
                off = torch.max((value - target) ** 2, (clipped - target) ** 2).mean()
                loss = off - (weight * better).mean() - entropy * agent.log_std.sum()
                if calm > 0.0:
                    loss = loss + calm * mean.square().sum(1).mean()
                self.optimizer.zero_grad()
                loss.backward()
                nn.utils.clip_grad_norm_(agent.policy_parameters(), config.grad_max)
                with torch.no_grad():
                    std = torch.exp(agent.log_std)
                    change = (std_old**2 + (mean - mean_old) ** 2) / (2.0 * std**2)
                    kl = (torch.log(std / std_old) + change - 0.5).sum(-1).mean().item()
                self.optimizer.follow(kl, config.kl * (1.0 - 0.9 * progress**4))
                self.optimizer.step()
                moved.append(kl)
                losses.append(off.item())
        agent.see(r.obs[: config.steps, r.worlds], r.critic_obs[: config.steps, r.worlds])
        estimated = {}
        if self.estimation is not None and r.images is not None:
            count = config.steps * config.num_envs
            order = torch.randperm(count, generator=self.shuffle, device=self.device)
            given = (values[: config.steps].flatten(0, 1) for values in (r.images, r.critic_obs))
            estimated["learn/estimate_error"] = self.estimation.learn(*given, order, progress)
        return {
            **estimated,
            "learn/kl_nats": float(np.mean(moved)),
            "learn/value_loss": float(np.mean(losses)),
            "learn/action_std": float(std_old.mean()),
            "learn/learning_rate": self.optimizer.lr,
        }

    @property
    def progress(self) -> float:
        """Share of the run that is over, from 0 to 1."""
        minutes, total = self.config.minutes, self.config.total
        return min(1.0, self.steps / total if total else self.seconds / (60.0 * minutes))

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
        agent = self.acting.plain()
        weights = {name: value.cpu() for name, value in agent.state_dict().items()}
        sight = None if agent.estimator is None else astuple(agent.estimator.sight)
        state = {"sizes": agent.sizes, "sight": sight, "agent": weights, "about": about}
        with whole_file(path, durable=False) as part:
            torch.save(state, part)

    def save(self) -> None:
        """Write the checkpoint."""
        state = {
            "task": self.task,
            "config": asdict(self.config),
            "agent": self.agent.state_dict(),
            "optimizer": self.optimizer.state_dict(),
            "estimator": None if self.estimation is None else self.estimation.optimizer.state_dict(),
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
        if self.estimation is not None:
            self.estimation.optimizer.load_state_dict(state["estimator"])
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
        export(self.agent.cpu().plain(), self.envs.single_observation_space.shape[0], path, policy_metadata(self.envs))
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
    parser.add_argument(
        "--model", help=f"URDF or MJCF of a robot for a velocity task, instead of its own, or {', '.join(KNOWN)}"
    )
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
    if args.model in ROBOTS:
        preset = replace(preset, **ROBOTS[args.model])
    elif args.model is not None:  # its gains and weights are found, not tuned
        preset = replace(preset, minutes=max(preset.minutes, MODEL_MINUTES))
    config = replace(preset, **{name: value for name, value in own.items() if value is not None})

    made, robot = ({}, "") if args.model is None else ({"model": args.model}, f"-{Path(args.model).stem}")
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
