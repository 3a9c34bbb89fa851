"""Distributions of values that differ between worlds and between resets."""

from __future__ import annotations

from dataclasses import dataclass

from tightloop.checks import arguments as checks
from tightloop.checks.signatures import checked_calls
from tightloop.errors import SceneError

# the daemon has the same limit, which keeps draws within float32
_MOST = 1e6


@checked_calls
@dataclass(frozen=True)
class Uniform:
    """The uniform distribution from ``low`` to ``high``.

    Args:
        low: Lower bound.
        high: Upper bound.

    Raises:
        SceneError: A bound is not finite or its size is above 1e6, or ``low`` is above ``high``.
    """

    low: float
    high: float

    def __post_init__(self) -> None:
        low, high = _number("Uniform: low", self.low), _number("Uniform: high", self.high)
        if low > high:
            raise SceneError(f"Uniform: low is {low:g} and high is {high:g}; low must not be above high")
        object.__setattr__(self, "low", low)
        object.__setattr__(self, "high", high)

    def table(self) -> dict[str, list[float]]:
        """Return the distribution in the form of a scene file."""
        return {"uniform": [self.low, self.high]}


@checked_calls
@dataclass(frozen=True)
class Normal:
    """The normal distribution with a mean and a standard deviation.

    Args:
        mean: Mean.
        std: Standard deviation, at least 0.

    Raises:
        SceneError: A value is not finite or its size is above 1e6, or ``std`` is negative.
    """

    mean: float
    std: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "mean", _number("Normal: mean", self.mean))
        object.__setattr__(self, "std", _number("Normal: std", self.std, least=0.0))

    def table(self) -> dict[str, list[float]]:
        """Return the distribution in the form of a scene file."""
        return {"normal": [self.mean, self.std]}


Distribution = Uniform | Normal


def from_table(table: dict[str, list[float]]) -> Distribution:
    """Make a distribution from the form of a scene file."""
    [(kind, numbers)] = table.items()
    return {"uniform": Uniform, "normal": Normal}[kind](*map(float, numbers))


def _number(what: str, value: float, *, least: float | None = None) -> float:
    checked = checks.number(what, value, least=least)
    if abs(checked) > _MOST:
        raise SceneError(f"{what} is {checked:g}; give at most 1e6")
    return checked
