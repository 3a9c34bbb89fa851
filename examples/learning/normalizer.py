"""Shifts and scales what networks take."""

from __future__ import annotations

from typing import Protocol

import torch
from torch import Tensor, nn


class Mirroring(Protocol):
    """The mirror image of observations."""

    order: Tensor

    def flip(self, values: Tensor) -> Tensor: ...


class Normalizer(nn.Module):
    """Shifts and scales observations by the mean and variance of all that were seen (Chan et al. 1979).

    What hardly varies is scaled by ``least``, the least standard deviations, ``(size,)``.
    """

    mean: Tensor
    var: Tensor
    count: Tensor
    least: Tensor

    def __init__(self, size: int, least: Tensor | None = None) -> None:
        super().__init__()
        self.register_buffer("least", torch.full((size,), 1e-3) if least is None else least, persistent=False)
        self.register_buffer("mean", torch.zeros(size))
        self.register_buffer("var", torch.ones(size))
        self.register_buffer("count", torch.tensor(1e-4))

    def see(self, obs: Tensor, mirror: Mirroring | None = None) -> None:
        """Take observations ``(…, size)`` into account, and their mirror image if there is one."""
        obs = obs.reshape(-1, obs.shape[-1])
        count, mean, var = len(obs), obs.mean(0), obs.var(0, correction=0)
        if mirror is not None:
            other = mirror.flip(mean)
            var = (var + var[mirror.order]) / 2.0 + ((mean - other) / 2.0) ** 2
            mean = (mean + other) / 2.0
        total = self.count + count
        apart = mean - self.mean
        self.var.copy_((self.var * self.count + var * count + apart**2 * self.count * count / total) / total)
        self.mean.add_(apart * count / total)
        self.count.copy_(total)

    def forward(self, obs: Tensor) -> Tensor:
        return ((obs - self.mean) / torch.sqrt(self.var + self.least**2)).clamp(-10.0, 10.0)
