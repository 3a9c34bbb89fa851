"""Distributions of numbers that differ from world to world and from reset to reset."""

from __future__ import annotations

from dataclasses import dataclass

from tightloop import checks
from tightloop.errors import SceneError

# As the daemon has it: a draw stays within float32
_MOST = 1e6


@dataclass(frozen=True)
class Uniform:
    """Every number from ``low`` to ``high`` is as likely as any other.

    Raises:
        SceneError: A number is not finite or above 1e6, or ``low`` is above ``high``.
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
        """The distribution as a scene file has it."""
        return {"uniform": [self.low, self.high]}


@dataclass(frozen=True)
class Normal:
    """Gauss's distribution of that mean and standard deviation.

    Raises:
        SceneError: A number is not finite or above 1e6, or ``std`` is negative.
    """

    mean: float
    std: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "mean", _number("Normal: mean", self.mean))
        object.__setattr__(self, "std", _number("Normal: std", self.std, least=0.0))

    def table(self) -> dict[str, list[float]]:
        """The distribution as a scene file has it."""
        return {"normal": [self.mean, self.std]}


Distribution = Uniform | Normal


def from_table(table: dict[str, list[float]]) -> Distribution:
    """The inverse of ``table``."""
    [(kind, numbers)] = table.items()
    return {"uniform": Uniform, "normal": Normal}[kind](*map(float, numbers))


def _number(what: str, value: float, *, least: float | None = None) -> float:
    checked = checks.number(what, value, least=least)
    if abs(checked) > _MOST:
        raise SceneError(f"{what} is {checked:g}; give at most 1e6")
    return checked
