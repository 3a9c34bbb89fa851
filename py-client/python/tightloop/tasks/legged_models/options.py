"""Options of a legged robot, by the names of its joints."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from tightloop.checks import arguments as checks
from tightloop.checks.attributes import suggestion
from tightloop.env.mirror import Flip
from tightloop.errors import ArgumentError
from tightloop.tasks.legged import ByJoint

#: Positions of twins differ by at most this [rad], gains and scales by at most this share.
_POSITION, _SHARE = 1e-3, 1e-2


def values(what: str, given: ByJoint | None, names: Sequence[str], found: Sequence[float]) -> tuple[float, ...]:
    """Return a value of each joint: what was given, else what was found."""
    if given is None:
        return tuple(found)
    if not isinstance(given, Mapping):
        return (checks.number(what, given, least=0.0, error=ArgumentError),) * len(names)
    own = by_name(what, given, names)
    return tuple(
        checks.number(f"{what} of {name!r}", own[name], least=0.0, error=ArgumentError) if name in own else value
        for name, value in zip(names, found, strict=True)
    )


def with_mirror(flip: Flip | None, standing: ArrayLike, *alike: ArrayLike) -> Flip | None:
    """Return a mirror image of the action's joints if the robot is its own; None otherwise.

    Args:
        flip: The mirror image.
        standing: Positions when it stands [rad], shape ``(joints,)``.
        alike: What twins have in common, such as gains, shape ``(joints,)`` each.
    """
    if flip is None:
        return None
    order, signs = flip
    q = np.asarray(standing)
    same = bool(np.abs(q[order] * signs - q).max() <= _POSITION)
    for given in alike:
        value = np.asarray(given)
        same = same and bool((np.abs(value[order] - value) <= _SHARE * np.abs(value)).all())
    return flip if same else None


def by_name(what: str, given: Mapping[str, float] | None, names: Sequence[str]) -> dict[str, float]:
    """Return values by the names of joints.

    Patterns are regular expressions for whole names, and names come before them.
    """
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise ArgumentError(f"{what} is {given!r:.80}; give a dict of numbers by name or pattern of joints")
    exact, matched = dict[str, float](), dict[str, float]()
    for pattern, value in given.items():
        number = checks.number(f"{what} of {pattern!r}", value, error=ArgumentError)
        if pattern in names:
            exact[pattern] = number
            continue
        try:
            own = [name for name in names if re.fullmatch(pattern, name)]
        except (re.error, TypeError):
            own = []
        if not own:
            raise ArgumentError(f"{what} has {pattern!r}, which no joint matches; {suggestion(str(pattern), names)}")
        matched |= dict.fromkeys(own, number)
    return matched | exact
