"""Optimizer of `ppo.py` and `train_ddp.py`: Adam, or Muon for the weights of hidden layers and Adam for the rest."""

from __future__ import annotations

from typing import Any

import torch

from learning.agent import Agent

FASTEST, SLOWEST = 3e-3, 1e-5  # learning rates
MUON_SINCE = "2.9"


class Optimizer:
    """Adam (Kingma and Ba 2015, arXiv 1412.6980), beside which Muon may move the weights of hidden layers.

    Muon (Jordan et al. 2024, https://kellerjordan.github.io/posts/muon/) makes the momentum of a matrix orthogonal, so
    that all directions of a layer learn at once. Its steps are scaled to the size of Adam's (Liu et al. 2025, arXiv
    2502.16982), so that one learning rate suits both.
    """

    def __init__(self, agent: Agent, lr: float, *, muon: bool) -> None:
        """Start with the learning rate ``lr``."""
        hidden = agent.hidden_weights() if muon else []
        apart = {id(weight) for weight in hidden}
        others = [parameter for parameter in agent.policy_parameters() if id(parameter) not in apart]
        self.parts: list[torch.optim.Optimizer] = [torch.optim.Adam(others, lr=lr, eps=1e-5, fused=True)]
        if hidden:
            if not hasattr(torch.optim, "Muon"):
                raise SystemExit(
                    f"--muon needs torch {MUON_SINCE}, and this is {torch.__version__}; update it, or add --no-muon"
                )
            self.parts.append(torch.optim.Muon(hidden, lr=lr, weight_decay=0.0, adjust_lr_fn="match_rms_adamw"))

    @property
    def lr(self) -> float:
        """The learning rate."""
        return self.parts[0].param_groups[0]["lr"]

    def follow(self, kl: float, aim: float) -> None:
        """Let the learning rate follow how much the policy changes, against the change that is aimed at [nats]."""
        lr = self.lr
        if kl > 2.0 * aim:
            lr = max(SLOWEST, lr / 1.2)
        elif 0.0 < kl < 0.5 * aim:
            lr = min(FASTEST, lr * 1.2)
        for part in self.parts:
            part.param_groups[0]["lr"] = lr

    def zero_grad(self) -> None:
        """Forget the gradients."""
        for part in self.parts:
            part.zero_grad()

    def step(self) -> None:
        """Move the parameters along their gradients."""
        for part in self.parts:
            part.step()

    def state_dict(self) -> list[dict[str, Any]]:
        """Return what `load_state_dict` takes."""
        return [part.state_dict() for part in self.parts]

    def load_state_dict(self, states: list[dict[str, Any]]) -> None:
        """Go on from there."""
        if not isinstance(states, list) or len(states) != len(self.parts):
            raise SystemExit("the checkpoint has another optimizer; give --muon or --no-muon as before, or start anew")
        for part, state in zip(self.parts, states, strict=True):
            part.load_state_dict(state)
