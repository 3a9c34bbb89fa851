"""The actor and the critic that `ppo.py` trains."""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn


class Normalizer(nn.Module):
    """Shifts and scales observations by the mean and variance of all that were seen (Chan et al. 1979)."""

    mean: Tensor
    var: Tensor
    count: Tensor

    def __init__(self, size: int) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(size))
        self.register_buffer("var", torch.ones(size))
        self.register_buffer("count", torch.tensor(1e-4))

    def see(self, obs: Tensor) -> None:
        """Take observations ``(…, size)`` into account."""
        obs = obs.reshape(-1, obs.shape[-1])
        count, mean, var = len(obs), obs.mean(0), obs.var(0, correction=0)
        total = self.count + count
        apart = mean - self.mean
        self.var.copy_((self.var * self.count + var * count + apart**2 * self.count * count / total) / total)
        self.mean.add_(apart * count / total)
        self.count.copy_(total)

    def forward(self, obs: Tensor) -> Tensor:
        return ((obs - self.mean) / torch.sqrt(self.var + 1e-6)).clamp(-10.0, 10.0)


def mlp(inputs: int, hidden: int, outputs: int, last: float) -> nn.Sequential:
    """Two hidden layers; orthogonal weights, those of the last layer scaled by ``last``."""
    layers = [nn.Linear(inputs, hidden), nn.Linear(hidden, hidden), nn.Linear(hidden, outputs)]
    for layer, gain in zip(layers, (math.sqrt(2.0), math.sqrt(2.0), last), strict=True):
        nn.init.orthogonal_(layer.weight, gain)
        nn.init.zeros_(layer.bias)
    return nn.Sequential(layers[0], nn.ELU(), layers[1], nn.ELU(), layers[2])


class Agent(nn.Module):
    """An actor, whose actions are normal about its output, and a critic, which may see more than the actor."""

    def __init__(self, inputs: int, actions: int, critic_inputs: int, hidden: int, std: float) -> None:
        super().__init__()
        self.normalizer, self.critic_normalizer = (Normalizer(inputs), Normalizer(critic_inputs))
        self.actor = mlp(inputs, hidden, actions, 0.01)
        self.critic = mlp(critic_inputs, hidden, 1, 1.0)
        self.log_std = nn.Parameter(torch.full((actions,), math.log(std)))

    def forward(self, obs: Tensor) -> Tensor:
        """The most likely action, ``(…, actions)``."""
        return self.actor(self.normalizer(obs))

    def value(self, obs: Tensor) -> Tensor:
        """What is still to come, ``(…,)``, at observations of the critic."""
        return self.critic(self.critic_normalizer(obs)).squeeze(-1)

    def log_prob(self, mean: Tensor, action: Tensor) -> Tensor:
        """Logarithm of the probability of actions about ``mean``, ``(…,)``."""
        off = (action - mean) * torch.exp(-self.log_std)
        return (-0.5 * off**2 - self.log_std - 0.5 * math.log(2.0 * math.pi)).sum(-1)
