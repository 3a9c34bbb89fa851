"""Mirror symmetries of tasks: what a left turn is, seen in a mirror."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tightloop.errors import ArgumentError

#: Values in the mirror: value i is ``sign[i]`` times value ``order[i]``.
Flip = tuple[Sequence[int], Sequence[float]]


@dataclass(frozen=True)
class Mirror:
    """A mirror symmetry, for learners that use it to see every step twice.

    Attributes:
        observed: For each part of the observation by name: order and signs of its values in the mirror.
        action: The same of the action.
        privileged: The same of the parts of the privileged observation.
    """

    observed: Mapping[str, Flip]
    action: Flip
    privileged: Mapping[str, Flip] = field(default_factory=dict)


@dataclass(frozen=True)
class MirrorColumns:
    """Columns and signs of a whole array in the mirror: ``mirrored = array[:, order] * signs``."""

    order: NDArray[np.intp]
    signs: NDArray[np.float32]

    @staticmethod
    def of(what: str, flip: Flip, size: int) -> MirrorColumns:
        """Check order and signs of ``size`` values.

        Raises:
            ArgumentError: They are no permutation that is its own inverse, or other than +1 and -1.
        """
        order, signs = (np.asarray(part) for part in flip)
        places = np.arange(size)
        is_order = order.shape == (size,) and order.dtype.kind in "iu" and sorted(order) == [*places]
        if not is_order or (order[order] != places).any():
            raise ArgumentError(f"{what}: order is {[*order]!r:.80}; give {size} indices that swap values in pairs")
        if signs.shape != (size,) or not np.isin(signs, (-1, 1)).all():
            raise ArgumentError(f"{what}: signs are {[*signs]!r:.80}; give {size} times 1 or -1")
        if (signs[order] != signs).any():
            raise ArgumentError(f"{what}: values that swap have different signs; twice in the mirror is no change")
        return MirrorColumns(order.astype(np.intp), signs.astype(np.float32))

    @staticmethod
    def of_parts(what: str, flips: Mapping[str, Flip], parts: Sequence[tuple[str, int, int]]) -> MirrorColumns:
        """Join those of parts: name, size and history of each.

        Raises:
            ArgumentError: A part has none, or there is no such part.
        """
        names = [name for name, _, _ in parts]
        for name in flips.keys() - set(names):
            raise ArgumentError(f"{what}: there is no part {name!r}; there are: {', '.join(names)}")
        orders, signs, first = [], [], 0
        for name, size, history in parts:
            if name not in flips:
                raise ArgumentError(f"{what}: the part {name!r} is missing; give its order and signs")
            own = MirrorColumns.of(f"{what}, {name!r}", flips[name], size)
            for _ in range(history):
                orders.append(own.order + first)
                signs.append(own.signs)
                first += size
        return MirrorColumns(np.concatenate(orders), np.concatenate(signs))
