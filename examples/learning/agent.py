"""The actor and the critic that `ppo.py` trains."""

from __future__ import annotations

import math

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from learning.estimator import Estimator, Sight
from learning.normalizer import Normalizer
from tightloop.env.mirror import MirrorColumns

HALF = math.sqrt(0.5)
#: Mirror images of observations, actions and observations of the critic; None where it sees those of the actor.
Mirrors = tuple[MirrorColumns, MirrorColumns, MirrorColumns | None]


class Halves(nn.Module):
    """Coordinates of which the mirror image keeps the first, the even ones, and turns the sign of the others.

    They are sums and differences of values that swap, divided by √2, and values that stay where they are.
    """

    order: Tensor
    signs: Tensor
    basis: Tensor

    def __init__(self, columns: MirrorColumns) -> None:
        super().__init__()
        even, odd = [], []
        for place, (twin, sign) in enumerate(zip(columns.order, columns.signs, strict=True)):
            unit = np.zeros(len(columns.order), np.float32)
            unit[place] = 1.0
            if twin == place:
                (even if sign > 0 else odd).append(unit)
            elif twin > place:
                other = np.zeros_like(unit)
                other[twin] = sign
                even.append((unit + other) / math.sqrt(2.0))
                odd.append((unit - other) / math.sqrt(2.0))
        self.even = len(even)
        self.register_buffer("order", torch.from_numpy(columns.order), persistent=False)
        self.register_buffer("signs", torch.from_numpy(columns.signs), persistent=False)
        self.register_buffer("basis", torch.from_numpy(np.stack([*even, *odd])), persistent=False)

    def flip(self, values: Tensor) -> Tensor:
        """Return the mirror image."""
        return values[..., self.order] * self.signs

    def forward(self, values: Tensor) -> Tensor:
        return values @ self.basis.T


def mlp(inputs: int, hidden: int, outputs: int, last: float) -> nn.Sequential:
    """Two hidden layers; orthogonal weights, those of the last layer scaled by ``last``."""
    layers = [nn.Linear(inputs, hidden), nn.Linear(hidden, hidden), nn.Linear(hidden, outputs)]
    for layer, gain in zip(layers, (math.sqrt(2.0), math.sqrt(2.0), last), strict=True):
        nn.init.orthogonal_(layer.weight, gain)
        nn.init.zeros_(layer.bias)
    return nn.Sequential(layers[0], nn.ELU(), layers[1], nn.ELU(), layers[2])


class Twins(nn.Module):
    """A layer on sums and differences of values that swap in the mirror, which does not mix them."""

    def __init__(self, inputs: tuple[int, int], outputs: tuple[int, int], gain: float) -> None:
        super().__init__()
        self.even = nn.Linear(inputs[0], outputs[0])
        self.odd = nn.Linear(inputs[1], outputs[1], bias=False)
        for layer in (self.even, self.odd):
            nn.init.orthogonal_(layer.weight, gain)
        nn.init.zeros_(self.even.bias)

    def forward(self, even: Tensor, odd: Tensor) -> tuple[Tensor, Tensor]:
        return self.even(even), self.odd(odd)

    def joined(self) -> Tensor:
        """Return the weight from these coordinates to values that swap, the first half with the second."""
        even, odd = self.even.weight, self.odd.weight
        return HALF * torch.cat([torch.cat([even, odd], 1), torch.cat([even, -odd], 1)])


class MirrorMlp(nn.Module):
    """Two hidden layers whose output is mirrored when the input is; without ``outputs`` it stays the same.

    Each hidden unit has a twin, which sees the mirror image: layers that are equivariant under a reflection (Su et al.
    2024, arXiv 2403.17320). Sums and differences of twins do not mix, so that it takes half the products of `mlp`.
    """

    def __init__(self, inputs: Halves, hidden: int, outputs: Halves | None, last: float) -> None:
        super().__init__()
        if hidden % 2:
            raise ValueError(f"hidden is {hidden}; give an even number, since each unit has a twin in the mirror")
        half, size, even = hidden // 2, len(inputs.order), inputs.even
        # a value that stays the same has one even coordinate, and an odd one that is not used
        ends = (1, 1) if outputs is None else (outputs.even, len(outputs.order) - outputs.even)
        self.inputs, self.outputs = inputs, outputs
        self.first = Twins((even, size - even), (half, half), math.sqrt(2.0))
        self.second = Twins((half, half), (half, half), math.sqrt(2.0))
        self.last = Twins((half, half), ends, last)

    def split(self, obs: Tensor) -> Tensor:
        """Return even and odd coordinates of inputs, which `of_halves` takes."""
        return self.inputs(obs)

    def of_halves(self, halves: Tensor) -> Tensor:
        """Return the outputs for coordinates that `split` returned."""
        even, odd = halves[..., : self.inputs.even], halves[..., self.inputs.even :]
        for layer in (self.first, self.second):
            a, b = layer(even, odd)
            a, b = functional.elu(HALF * (a + b)), functional.elu(HALF * (a - b))
            even, odd = HALF * (a + b), HALF * (a - b)
        if self.outputs is None:
            return self.last.even(even)
        return torch.cat(self.last(even, odd), -1) @ self.outputs.basis

    def forward(self, obs: Tensor) -> Tensor:
        return self.of_halves(self.split(obs))

    def layers(self) -> list[tuple[Tensor, Tensor]]:
        """Return weight and bias of each layer of an `mlp` that gives the same."""
        first, second, last = self.first, self.second, self.last
        unit = torch.eye(len(second.even.weight))
        twins = HALF * torch.cat([torch.cat([unit, unit], 1), torch.cat([unit, -unit], 1)])
        weight, bias = last.even.weight @ twins[: len(unit)], last.even.bias
        if self.outputs is not None:
            basis = self.outputs.basis
            weight = basis.T @ torch.cat([weight, last.odd.weight @ twins[len(unit) :]])
            bias = bias @ basis[: self.outputs.even]
        return [
            (first.joined() @ self.inputs.basis, HALF * first.even.bias.repeat(2)),
            (second.joined() @ twins, HALF * second.even.bias.repeat(2)),
            (weight, bias),
        ]


class Agent(nn.Module):
    """An actor, whose actions are normal about its output, and a critic, which may see more than the actor.

    With ``mirrors`` both are symmetric: the mirror image of an observation gives that of the action. With ``sight`` the
    actor takes `features` of observations, which an estimator finds in images.
    """

    def __init__(
        self,
        inputs: int,
        actions: int,
        critic_inputs: int,
        hidden: int,
        std: float,
        *,
        mirrors: Mirrors | None = None,
        sight: Sight | None = None,
    ) -> None:
        super().__init__()
        self.sizes = (inputs, actions, critic_inputs, hidden, std)
        self.estimator = None if sight is None else Estimator(sight)
        least = None
        if self.estimator is not None:
            inputs, least = self.estimator.outputs, self.estimator.least()
        self.normalizer, self.critic_normalizer = Normalizer(inputs, least), Normalizer(critic_inputs)
        self.halves: tuple[Halves, Halves] | None = None
        if mirrors is None:
            self.actor = mlp(inputs, hidden, actions, 0.01)
            self.critic = mlp(critic_inputs, hidden, 1, 1.0)
        else:
            own, acts, critic = mirrors
            self.halves = (Halves(own), Halves(own if critic is None else critic))
            self.actor = MirrorMlp(self.halves[0], hidden, Halves(acts), 0.01)
            self.critic = MirrorMlp(self.halves[1], hidden, None, 1.0)
        self.log_std = nn.Parameter(torch.full((actions,), math.log(std)))

    def policy_parameters(self) -> list[nn.Parameter]:
        """Return all parameters but those of the estimator, which learns by itself."""
        apart = set() if self.estimator is None else {id(parameter) for parameter in self.estimator.parameters()}
        return [parameter for parameter in self.parameters() if id(parameter) not in apart]

    def hidden_weights(self) -> list[nn.Parameter]:
        """Return the weight matrices that lead to hidden units."""
        layers: list[nn.Module] = []
        for network in (self.actor, self.critic):
            if isinstance(network, MirrorMlp):
                layers += [half for layer in (network.first, network.second) for half in (layer.even, layer.odd)]
            else:
                layers += [network[0], network[2]]
        return [layer.weight for layer in layers if isinstance(layer, nn.Linear)]

    def see(self, obs: Tensor, critic_obs: Tensor) -> None:
        """Take observations into account by which later ones are shifted and scaled."""
        halves = self.halves or (None, None)
        self.normalizer.see(obs, halves[0])
        self.critic_normalizer.see(critic_obs, halves[1])

    def inputs(self, obs: Tensor, critic_obs: Tensor) -> tuple[Tensor, Tensor]:
        """Return what `mean` and `worth` take, which is the same as long as nothing more was seen."""
        obs, critic_obs = self.normalizer(obs), self.critic_normalizer(critic_obs)
        if isinstance(self.actor, MirrorMlp) and isinstance(self.critic, MirrorMlp):
            return self.actor.split(obs), self.critic.split(critic_obs)
        return obs, critic_obs

    def mean(self, inputs: Tensor) -> Tensor:
        """Return the most likely action at `inputs`, ``(…, actions)``."""
        return self.actor.of_halves(inputs) if isinstance(self.actor, MirrorMlp) else self.actor(inputs)

    def worth(self, inputs: Tensor) -> Tensor:
        """Return what is still to come at `inputs` of the critic, ``(…,)``."""
        critic = self.critic
        return (critic.of_halves(inputs) if isinstance(critic, MirrorMlp) else critic(inputs)).squeeze(-1)

    def features(self, obs: Tensor) -> Tensor:
        """Return what the actor takes, ``(worlds, …)``: the observations themselves where there are no images."""
        return obs if self.estimator is None else self.estimator.features(obs)

    def act(self, features: Tensor) -> Tensor:
        """The most likely action, ``(…, actions)``."""
        return self.actor(self.normalizer(features))

    def forward(self, obs: Tensor) -> Tensor:
        """The most likely action at observations, ``(…, actions)``."""
        return self.act(self.features(obs))

    def value(self, obs: Tensor) -> Tensor:
        """What is still to come, ``(…,)``, at observations of the critic."""
        return self.critic(self.critic_normalizer(obs)).squeeze(-1)

    def log_prob(self, mean: Tensor, action: Tensor) -> Tensor:
        """Logarithm of the probability of actions about ``mean``, ``(…,)``."""
        off = (action - mean) * torch.exp(-self.log_std)
        return (-0.5 * off**2 - self.log_std - 0.5 * math.log(2.0 * math.pi)).sum(-1)

    @torch.no_grad()
    def plain(self) -> Agent:
        """Return an agent that gives the same, up to rounding, by plain layers; itself if it has these."""
        if self.halves is None:
            return self
        agent = Agent(*self.sizes)
        for own, other in ((self.actor, agent.actor), (self.critic, agent.critic)):
            assert isinstance(own, MirrorMlp) and isinstance(other, nn.Sequential)
            for (weight, bias), layer in zip(own.layers(), other[::2], strict=True):
                layer.weight.copy_(weight)
                layer.bias.copy_(bias)
        for name in ("normalizer", "critic_normalizer"):
            getattr(agent, name).load_state_dict(getattr(self, name).state_dict())
        agent.log_std.copy_(self.log_std)
        return agent
