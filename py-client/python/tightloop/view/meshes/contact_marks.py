"""Marks of contacts: their points, and arrows of their forces, in sizes that fit the robot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: With more worlds, marks hide the robots, and are off unless they are asked for.
WORLDS_MAX = 4


@dataclass(frozen=True, eq=False)
class ContactMarks:
    """Contacts of some worlds.

    Attributes:
        points: Contact points [m], shape ``(contacts, 3)``.
        arrows: Forces as vectors in the picture [m], shape ``(contacts, 3)``.
    """

    points: NDArray[np.float64]
    arrows: NDArray[np.float64]


def contact_marks(shown: Any, worlds: Sequence[int], offsets: Any, *, scale: float, longest: float) -> ContactMarks:
    """Return the contacts of some worlds.

    Args:
        shown: Frame with ``contact_count``, ``contact_pos`` and ``contact_force``.
        worlds: The worlds.
        offsets: Position of each of these worlds on the grid [m], shape ``(worlds, 3)``.
        scale: Length of an arrow [m/N].
        longest: Length of the longest arrow [m]: the first millisecond of an impact would fill the picture.
    """
    chosen = list(worlds)
    counts, places, forces = (
        np.asarray(getattr(shown, name))[chosen] for name in ("contact_count", "contact_pos", "contact_force")
    )
    used = np.arange(places.shape[1]) < counts.reshape(-1, 1)
    points = (places + np.asarray(offsets)[:, None])[used].astype(float)
    arrows = forces[used].astype(float) * scale
    length = np.linalg.norm(arrows, axis=-1, keepdims=True)
    return ContactMarks(points, arrows * np.minimum(1.0, longest / np.maximum(length, longest)))
