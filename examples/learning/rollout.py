"""What worlds did, and what it was worth."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import torch
from torch import Tensor


class Sizes(Protocol):
    """Numbers of a run."""

    @property
    def num_envs(self) -> int: ...
    @property
    def steps(self) -> int: ...
    @property
    def gamma(self) -> float: ...
    @property
    def lam(self) -> float: ...


class Rollout:
    """What all worlds did for some steps, ``(steps, worlds, …)``; observations have those after the last step, too."""

    def __init__(
        self,
        config: Sizes,
        inputs: int,
        actions: int,
        critic_inputs: int | None,
        device: torch.device,
        *,
        images: int | None = None,
    ) -> None:
        """Make room.

        Args:
            config: Numbers of the run.
            inputs: Numbers that the actor takes.
            actions: Numbers of an action.
            critic_inputs: Numbers that the critic takes; None if they are the actor's.
            device: Where the arrays are.
            images: Numbers of an observation of which the actor takes features; None if it takes observations.
        """

        def room(steps: int, *shape: int) -> Tensor:
            return torch.zeros((steps, config.num_envs, *shape), device=device)

        steps = config.steps
        self._config = config
        self.obs, self.action = room(steps + 1, inputs), room(steps, actions)
        # the critic sees the same, or more
        self.critic_obs = self.obs if critic_inputs is None else room(steps + 1, critic_inputs)
        self.images = None if images is None else room(steps, images)
        #: Worlds that the policy learns from, a mask; those that it acted in as it learns to.
        self.worlds = torch.ones(config.num_envs, dtype=torch.bool, device=device)
        self.reward, self.done, self.log_prob = (room(steps) for _ in range(3))
        #: Step, worlds and last observations for the critic of episodes that were cut off.
        self.cuts: list[tuple[int, Tensor, Tensor]] = []

    def see(self, step: int, obs: Tensor, critic_obs: Tensor) -> None:
        """Keep the observations before a step."""
        self.obs[step].copy_(obs)
        if self.critic_obs is not self.obs:
            self.critic_obs[step].copy_(critic_obs)
        if step == 0:
            self.cuts = []

    def look_back(self, value: Tensor, last: Sequence[Tensor]) -> tuple[Tensor, Tensor]:
        """Return generalised advantages (arXiv 1506.02438) and targets of the values, ``(steps, worlds)``.

        Args:
            value: Values of all observations, ``(steps + 1, worlds)``.
            last: Values of the last observations in `cuts`, with which those episodes go on.
        """
        gamma, lam = self._config.gamma, self._config.lam
        reward, goes_on = self.reward.clone(), gamma * (1.0 - self.done)
        for (step, rows, _), beyond in zip(self.cuts, last, strict=True):
            reward[step, rows] += gamma * beyond
        errors = reward + goes_on * value[1:] - value[:-1]
        advantages, following = torch.empty_like(reward), torch.zeros_like(reward[0])
        for step in reversed(range(len(reward))):
            following = errors[step] + lam * goes_on[step] * following
            advantages[step] = following
        return advantages, advantages + value[:-1]
