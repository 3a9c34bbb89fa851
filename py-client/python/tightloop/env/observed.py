"""Parts of an observation, as tasks list them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tightloop.checks import arguments as checks
from tightloop.checks.signatures import checked_calls
from tightloop.errors import ArgumentError
from tightloop.planning.policy_terms import Term

# Values of a part of an observation, which is far beyond any
_SIZE_MAX = 2**20


@checked_calls
@dataclass(frozen=True)
class Observed:
    """A part of the observation: name, size, bounds and unit.

    Attributes:
        name: What the part is.
        low: Lower bound, for all values or for each; values are clipped to it.
        high: Upper bound, likewise.
        size: Number of values that `Task.observe` returns; of a part with a ``shape``, its product.
        unit: Unit of the values.
        history: Steps that the observation holds of this part, the oldest first: the current one and those before it.
            An episode begins with copies of its first values.
        source: Where the values come from in a frame, for rollouts with a policy inside (`Sim.rollout`): a term of
            `tightloop.planning.policy_terms`. The metadata of policies has the terms if all parts have one.
        shape: Shape of the values, such as ``(64, 64)`` of a depth image; None for a vector.
        delay: Control steps by which the values are late, as those of slow sensors; or the least and the most of them,
            for a number that is drawn for each world and episode. Until then it has the first values of the episode.
    """

    name: str
    low: ArrayLike
    high: ArrayLike
    size: int = 1
    unit: str = "–"
    history: int = 1
    source: Term | None = None
    shape: Sequence[int] | None = None
    delay: int | Sequence[int] = 0
    bounds: NDArray[np.float32] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        name = checks.text("Observed: name", self.name, error=ArgumentError)
        checks.text(f"observation `{name}`: unit", self.unit, error=ArgumentError)
        size = checks.integer(f"observation `{name}`: size", self._size(name), error=ArgumentError)
        if size > _SIZE_MAX:
            raise ArgumentError(f"observation `{name}`: size is {size}; give at most {_SIZE_MAX}")
        object.__setattr__(self, "size", size)
        history = checks.integer(f"observation `{name}`: history", self.history, error=ArgumentError)
        if history * size > _SIZE_MAX:
            raise ArgumentError(f"observation `{name}`: history is {history}; give at most {_SIZE_MAX // size}")
        self._check_delay(name, _SIZE_MAX // size - history)
        try:
            low, high = (np.broadcast_to(np.asarray(end, np.float32), (self.size,)) for end in (self.low, self.high))
        except (TypeError, ValueError):
            raise ArgumentError(
                f"observation `{self.name}`: low and high must be numbers, or {self.size} each"
            ) from None
        if not (low < high).all():
            raise ArgumentError(f"observation `{self.name}`: low {self.low} must be below high {self.high}")
        if self.source is not None and not isinstance(self.source, Term):
            cure = "give a term of tightloop.planning.policy_terms"
            raise ArgumentError(f"observation `{self.name}`: source is {self.source!r:.80}; {cure}")
        object.__setattr__(self, "bounds", np.stack([low, high]))

    def _size(self, name: str) -> int:
        """Return the number of values, which is that of the shape if there is one."""
        if self.shape is None:
            return self.size
        what = f"observation `{name}`: shape"
        if isinstance(self.shape, str) or not isinstance(self.shape, Sequence) or not self.shape:
            raise ArgumentError(f"{what} is {self.shape!r:.80}; give lengths, such as (64, 64)")
        shape = tuple(checks.integer(what, length, error=ArgumentError) for length in self.shape)
        object.__setattr__(self, "shape", shape)
        size = math.prod(shape)
        if self.size not in (1, size):
            raise ArgumentError(
                f"observation `{name}`: size is {self.size}, and shape {shape} has {size}; leave size out"
            )
        return size

    def _check_delay(self, name: str, most: int) -> None:
        """Keep the delay as its least and its most."""
        what, delay = f"observation `{name}`: delay", cast("Any", self.delay)
        is_pair = isinstance(delay, Sequence) and not isinstance(delay, str)
        pair: Sequence[Any] = cast("Any", delay) if is_pair else (delay, delay)
        if len(pair) != 2:
            raise ArgumentError(f"{what} is {delay!r:.80}; give control steps, or the least and the most of them")
        least, longest = (checks.integer(what, cast("Any", steps), least=0, error=ArgumentError) for steps in pair)
        if least > longest:
            raise ArgumentError(f"{what} is {delay!r}; give the least first")
        if longest > most:
            raise ArgumentError(f"{what} is {longest}; give at most {most}")
        object.__setattr__(self, "delay", (least, longest))

    @property
    def delays(self) -> tuple[int, int]:
        """Least and most control steps by which the values are late."""
        least, longest = cast("tuple[int, int]", self.delay)
        return least, longest

    @property
    def term(self) -> Term | None:
        """The source with the bounds and history of this part; None if it has no source, or a delay."""
        if self.source is None or self.delays[1]:
            return None
        low, high = (float(str(end[0])) if (end == end[0]).all() else end for end in self.bounds)
        return replace(self.source, low=low, high=high, history=self.history)

    @property
    def width(self) -> int:
        """Number of values in the observation, history included."""
        return self.size * self.history
