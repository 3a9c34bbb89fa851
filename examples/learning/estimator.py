"""What an actor makes of its images: an estimate of what only the critic is shown."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from learning.normalizer import Normalizer
from tightloop.env import Observed

LEAST = 0.01  # part of a target's range that counts as its standard deviation, at least
SMALLEST = 28  # pixels of an image's side, which the filters need
AROUND = 2  # pixels of half the resolution, to each side, of which a mean is that of what is around
CONTRAST = 0.02  # part of an image's range by which a pixel differs from those around it, in inputs of 1
SHARE = 0.5  # of the images that the estimator learns from
#: Share of the worlds in which the policy acts on estimates; it learns in the others, where it acts on the truth.
ESTIMATED = 0.25
#: Largest target, in standard deviations: what is out of sight may be anywhere. And the error from which on the loss is
#: linear, so that such targets count no more than those that can be seen.
FARTHEST, LINEAR = 3.0, 0.1
BATCH = 512  # images of a minibatch
UNITS = 128  # of each of two layers behind the filters
LR, LAST_LR = 2e-3, 1e-4  # learning rates at the start and the end of a run


@dataclass(frozen=True)
class Sight:
    """Where images are in an observation, and what is estimated from them.

    Attributes:
        inputs: Numbers of an observation.
        images: First number, channels, height, width, and range of the values of each image.
        targets: Columns of the critic's observation that are estimated.
        ranges: The range of each, upper bound less lower bound.
    """

    inputs: int
    images: tuple[tuple[int, int, int, int, float], ...]
    targets: tuple[int, ...]
    ranges: tuple[float, ...]

    @classmethod
    def of(cls, parts: Sequence[Observed], privileged: Sequence[Observed]) -> Sight | None:
        """Return those of a task; None if it has no images.

        Args:
            parts: Of the observation.
            privileged: Of the critic's, of which those are estimated that have no twin of their name in the other.
        """
        images, place = [], 0
        for part in parts:
            # others are plain numbers, such as those of a scan
            if part.shape is not None and len(part.shape) > 1:
                images.append((place, part.history, *_checked(part), float(np.ptp(part.bounds))))
            place += part.width
        if not images:
            return None
        known, targets, ranges, column = {part.name for part in parts}, [], [], 0
        for part in privileged:
            if part.name not in known:
                targets += range(column, column + part.width)
                # without bounds a target has the scale of its values alone
                ends = np.where(np.isfinite(part.bounds), part.bounds, 0.0)
                ranges += (ends[1] - ends[0]).tolist() * part.history
            column += part.width
        if not targets:
            raise SystemExit(
                "a policy that sees images learns from what only the critic sees; give privileged_observed"
            )
        return cls(place, tuple(images), tuple(targets), tuple(ranges))


def _checked(part: Observed) -> tuple[int, int]:
    """Return height and width of an image that an estimator can take."""
    shape = part.shape or ()
    if len(shape) != 2 or min(shape) < SMALLEST:
        cure = f"give (height, width), both at least {SMALLEST}, such as of depths"
        raise SystemExit(f"the image {part.name!r} has shape {tuple(shape)}; {cure}")
    if not np.isfinite(part.bounds).all():
        raise SystemExit(f"the image {part.name!r} has no bounds; give its least and its largest value")
    return shape[0], shape[1]


class Estimator(nn.Module):
    """Estimates by regression, while the policy learns, what the critic sees and the actor does not.

    A state estimator that is trained beside the policy (Ji et al. 2022, arXiv 2202.05481), here with the filters of
    Mnih et al. 2015 for images. The policy takes the estimates as they are and sends no gradient back, so that it
    learns from few numbers, as often as it likes, and each image passes the filters twice: to act, and to learn.

    In most worlds the policy acts on the truth and learns. In the others it acts on estimates, so that the estimator
    learns from where these lead as well (DAgger, Ross et al. 2011, arXiv 1011.0686).
    """

    rest: Tensor
    targets: Tensor

    def __init__(self, sight: Sight) -> None:
        super().__init__()
        self.sight = sight
        seen = torch.zeros(sight.inputs, dtype=torch.bool)
        for first, channels, height, width, _ in sight.images:
            seen[first : first + channels * height * width] = True
        self.register_buffer("rest", torch.nonzero(~seen).squeeze(1), persistent=False)
        self.register_buffer("targets", torch.tensor(sight.targets), persistent=False)
        self.normalizer = Normalizer(len(self.rest))
        least = (LEAST * torch.tensor(sight.ranges)).clamp(min=1e-3)
        self.target_normalizer = Normalizer(len(sight.targets), least)
        for place, (_, _, height, width, _) in enumerate(sight.images):
            for axis, length in (("rows", height), ("columns", width)):
                half, near = averages(length)
                self.register_buffer(f"half_{axis}_{place}", half, persistent=False)
                self.register_buffer(f"near_{axis}_{place}", near, persistent=False)
        self.filters = nn.ModuleList(
            nn.Sequential(nn.Conv2d(channels, 16, 6, 2), nn.ELU(), nn.Conv2d(16, 32, 4, 2), nn.ELU(), nn.Flatten())
            for _, channels, *_ in sight.images
        )
        found = sum(
            net(image).shape[1]
            for net, image in zip(self.filters, self._images(torch.zeros(1, sight.inputs)), strict=True)
        )
        self.head = nn.Sequential(
            nn.Linear(found + len(self.rest), UNITS),
            nn.ELU(),
            nn.Linear(UNITS, UNITS),
            nn.ELU(),
            nn.Linear(UNITS, len(sight.targets)),
        )

    @property
    def outputs(self) -> int:
        """Numbers that the policy takes."""
        return len(self.rest) + len(self.targets)

    def least(self) -> Tensor:
        """Return the least standard deviations of these numbers: estimates keep their scale, so that noise is small."""
        return torch.cat([torch.full((len(self.rest),), 1e-3), torch.ones(len(self.targets))])

    def forward(self, obs: Tensor) -> Tensor:
        """Return the estimates, ``(worlds, targets)``, in units of their standard deviation."""
        found = [net(image) for image, net in zip(self._images(obs), self.filters, strict=True)]
        return self.head(torch.cat([self.normalizer(obs[:, self.rest]), *found], 1))

    def _images(self, obs: Tensor) -> Iterator[Tensor]:
        """Local contrast of the images (Jarrett et al. 2009), of half their size: what stands out from its ground."""
        for place, (first, channels, height, width, span) in enumerate(self.sight.images):
            image = obs[:, first : first + channels * height * width].reshape(-1, channels, height, width)
            image = self.get_buffer(f"half_rows_{place}") @ image @ self.get_buffer(f"half_columns_{place}").T
            around = self.get_buffer(f"near_rows_{place}") @ image @ self.get_buffer(f"near_columns_{place}").T
            yield ((image - around) / (CONTRAST * span)).clamp(-2.0, 2.0)

    def features(self, obs: Tensor) -> Tensor:
        """Return what the policy takes, ``(worlds, outputs)``: what is no image, and the estimates."""
        return torch.cat([obs[:, self.rest], self(obs)], 1)

    def wanted(self, critic_obs: Tensor) -> Tensor:
        """Return the truth in units of the estimates, ``(worlds, targets)``."""
        return self.target_normalizer(critic_obs[:, self.targets]).clamp(-FARTHEST, FARTHEST)

    def reveal(self, features: Tensor, critic_obs: Tensor, worlds: Tensor) -> None:
        """Write the truth in place of the estimates of some worlds, a mask of shape ``(worlds,)``."""
        truth = self.wanted(critic_obs)
        estimates = features[:, len(self.rest) :]
        estimates[worlds] = truth[worlds]


def averages(length: int) -> tuple[Tensor, Tensor]:
    """Matrices that take means along an axis of an image: of pairs of pixels, and of each of these with its neighbours.

    As products they take a quarter of the time that torch's pooling takes.
    """
    half = torch.arange(length) // 2 == torch.arange(length // 2)[:, None]
    place = torch.arange(length // 2)
    near = (place - place[:, None]).abs() <= AROUND
    return half / 2.0, near / near.sum(1, keepdim=True)


class EstimatorTrainer:
    """Learns from rollouts what images say."""

    def __init__(self, estimator: Estimator) -> None:
        self._estimator = estimator
        self.optimizer = torch.optim.Adam(estimator.parameters(), lr=LR, fused=True)

    def learn(self, obs: Tensor, critic_obs: Tensor, order: Tensor, progress: float) -> float:
        """One pass over a share of the rows; returns the error, as a part of the targets' standard deviation.

        Args:
            obs: Of the actor, ``(rows, inputs)``.
            critic_obs: Of the critic, ``(rows, …)``.
            order: In which rows come.
            progress: Share of the run that is over.
        """
        estimator = self._estimator
        estimator.normalizer.see(obs[:, estimator.rest])
        estimator.target_normalizer.see(critic_obs[:, estimator.targets])
        wanted = estimator.wanted(critic_obs)
        for group in self.optimizer.param_groups:
            group["lr"] = LR + (LAST_LR - LR) * progress
        squares = []
        for batch in order[: int(SHARE * len(order))].split(BATCH):
            found = estimator(obs[batch])
            loss = functional.smooth_l1_loss(found, wanted[batch], beta=LINEAR)
            self.optimizer.zero_grad()
            loss.backward()
            self.optimizer.step()
            squares.append(((found.detach() - wanted[batch]) ** 2).mean().item())
        return float(sum(squares) / len(squares)) ** 0.5
