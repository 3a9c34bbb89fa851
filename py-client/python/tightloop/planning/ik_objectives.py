"""What inverse kinematics is asked for: frames that reach targets, and a posture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tightloop.arrays.inputs import reals
from tightloop.checks import arguments as checks
from tightloop.checks.signatures import checked_calls
from tightloop.errors import ArgumentError

Array = NDArray[np.float64]

#: Largest difference of a quaternion's length from 1.
_QUAT_SLACK = 1e-3


@checked_calls
@dataclass(frozen=True, eq=False)
class Reach:
    """A frame that is to reach a pose; an objective of `ik`.

    Give the target here, or to `IkSolver.solve`, which overrides it. Weights decide what matters where a target is out
    of reach. With a weight of 0, the error does not count, and needs no target.

    Args:
        frame: A link ``robot/link``, a site, or a site ``robot/site`` of a MuJoCo model.
        position: Target position [m], shape ``(3,)`` or ``(n, 3)``.
        orientation: Target quaternion (x, y, z, w), shape ``(4,)`` or ``(n, 4)``.
        position_weight: Weight of the position error [1/m], or one per axis of what the target is measured from.
        orientation_weight: Weight of the rotation error [1/rad], or one per axis of the target.
        relative_to: Link or site that the target is measured from; None for the world.

    Raises:
        ArgumentError: An argument is not valid.
    """

    frame: str
    position: ArrayLike | None = None
    orientation: ArrayLike | None = None
    position_weight: float | Sequence[float] = 1.0
    orientation_weight: float | Sequence[float] = 1.0
    relative_to: str | None = None

    def __post_init__(self) -> None:
        checks.text("Reach: frame", self.frame, error=ArgumentError)
        if self.relative_to is not None:
            checks.text("Reach: relative_to", self.relative_to, error=ArgumentError)
        for name, columns in (("position", 3), ("orientation", 4)):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, rows(f"Reach: {name}", value, columns))
            weight = _weights(f"Reach: {name}_weight", getattr(self, f"{name}_weight"))
            object.__setattr__(self, f"{name}_weight", weight)
        if self.orientation is not None:
            unit_quaternions("Reach: orientation", self.orientation)
        if not any((*_triple(self.position_weight), *_triple(self.orientation_weight))):
            raise ArgumentError(f"Reach: all weights of `{self.frame}` are 0; give one of them a positive value")

    @property
    def weights(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Weights of position and orientation, three each."""
        return _triple(self.position_weight), _triple(self.orientation_weight)


@checked_calls
@dataclass(frozen=True, eq=False)
class Posture:
    """Joint positions that a robot with joints to spare keeps near to; an objective of `ik`.

    The solver minimizes it together with the errors of the frames, then lets go of it, so that it does not keep frames
    from their targets. Free joints have no posture.

    Args:
        joint_q: Joint positions [rad or m], shape ``(coords,)`` or ``(n, coords)``; where each problem starts if left
            out.
        weight: Weight of the distance [1/rad or 1/m], or one per dof, shape ``(dofs,)``.

    Raises:
        ArgumentError: An argument is not valid.
    """

    joint_q: ArrayLike | None = None
    weight: float | ArrayLike = 0.1

    def __post_init__(self) -> None:
        if self.joint_q is not None:
            object.__setattr__(self, "joint_q", rows("Posture: joint_q", self.joint_q, None))
        weight = reals("Posture: weight", self.weight).astype(np.float64)
        if weight.ndim > 1 or not np.isfinite(weight).all() or (weight < 0.0).any() or not (weight > 0.0).any():
            raise ArgumentError(
                f"Posture: weight is {self.weight!r:.80}; give a positive number, or numbers from 0 on, one per dof"
            )
        object.__setattr__(self, "weight", weight)


def rows(what: str, value: Any, columns: int | None) -> Array:
    """Check finite numbers of one row ``(columns,)`` or of many ``(n, columns)``.

    Raises:
        ArgumentError: A shape, dtype or value is wrong.
    """
    given = reals(what, value)
    size = "columns" if columns is None else columns
    if given.ndim not in (1, 2) or (columns is not None and given.shape[-1] != columns):
        raise ArgumentError(f"{what} has shape {given.shape}; give ({size},), or (n, {size}) for many problems")
    if given.ndim == 2 and not len(given):
        raise ArgumentError(f"{what} has no row; give at least one")
    # a float128 may become inf
    with np.errstate(over="ignore"):
        checked = np.ascontiguousarray(given, dtype=np.float64)
    if not np.isfinite(checked).all():
        where = np.argwhere(~np.isfinite(checked))[0].tolist()
        raise ArgumentError(f"{what}: entry {where} is {checked[tuple(where)]}; give finite numbers")
    return checked


def unit_quaternions(what: str, value: ArrayLike) -> None:
    """Refuse quaternions that are not of length 1.

    Raises:
        ArgumentError: A length is off by more than 0.001.
    """
    lengths = np.linalg.norm(np.asarray(value), axis=-1)
    wrong = np.abs(lengths - 1.0) > _QUAT_SLACK
    if wrong.any():
        row = int(np.flatnonzero(np.atleast_1d(wrong))[0])
        length = float(np.atleast_1d(lengths)[row])
        raise ArgumentError(f"{what}: row {row} has length {length:.4g}; give unit quaternions (x, y, z, w)")


def _triple(weight: Any) -> tuple[float, ...]:
    return weight if isinstance(weight, tuple) else (weight,) * 3


def _weights(what: str, value: Any) -> float | tuple[float, ...]:
    if np.ndim(value) == 0:
        return checks.number(what, value, least=0.0, error=ArgumentError)
    weights = checks.triple(what, value, error=ArgumentError)
    if min(weights) < 0.0:
        raise ArgumentError(f"{what} is {weights}; give numbers from 0 on")
    return weights
