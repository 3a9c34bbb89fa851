"""Masses and inertias of bodies that differ between simulations, as parameters of a simulation."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.planning.rotations import rotations

Array = NDArray[Any]

#: Model fields of masses.
FIELDS = ("body_mass", "body_inertia", "body_ipos")
# entries of a symmetric matrix in the order of `body_inertia`: xx, yy, zz, xy, xz, yz
_ROWS, _COLUMNS = (0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)


def params(expanded: Collection[str]) -> tuple[str, ...]:
    """Return the parameters that expanded fields become: mass and inertia together, inertia in the axes of the body."""
    heavy = ("body_mass", "body_inertia") if {"body_mass", "body_inertia"}.intersection(expanded) else ()
    return (*heavy, "body_com") if "body_ipos" in expanded else heavy


class Inertias:
    """Inertias in the axes of the bodies, computed again only if the principal moments have changed.

    Args:
        turns: Quaternions of the principal axes (w, x, y, z), ``(nbody, 4)``.
    """

    def __init__(self, turns: Array) -> None:
        self._axes = rotations(turns)
        self._moments: Array | None = None
        self._tensors: Array = np.empty(0)

    def of(self, moments: Array) -> Array:
        """Return the inertias, ``(n, nbody, 6)`` [kg·m²], of principal moments ``(n, nbody, 3)``."""
        if self._moments is None or not np.array_equal(moments, self._moments):
            self._moments = moments.copy()
            tensors = np.matmul(self._axes * moments[..., None, :], np.swapaxes(self._axes, -1, -2))
            self._tensors = tensors[..., _ROWS, _COLUMNS]
        return self._tensors
