"""The floor of a scene, which pages, pictures and films draw without an edge."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from tightloop.view.parts import Part
from tightloop.view.poses import Array

# Smaller horizontal planes are drawn with their edges [m].
_SIZE = 4.0
# Round distances of lines [m], and about how many lines cross the scene.
_SPACINGS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)
_LINES = 12


def is_floor(part: Part) -> bool:
    """Return whether a part is a large horizontal plane that faces up."""
    turned = np.abs(part.pose[3:5]).max()
    is_flat = part.body < 0 and part.shape == "plane" and bool(turned < 1e-6)
    return is_flat and bool(np.ptp(part.mesh.vertices[:, :2], axis=0).min() >= _SIZE)


def height(parts: Iterable[Part], box: Array, ground: Array | None = None) -> float:
    """Return the height of the floor [m]: that of the highest one, or below everything else.

    Args:
        parts: Parts of one world.
        box: Bounding box of one world [m], shape ``(2, 3)``.
        ground: Bounding box of its large height fields [m], from `tightloop.view.meshes.ground.extent`.
    """
    own = [float(part.pose[2]) for part in parts if is_floor(part) and np.isfinite(part.pose[2])]
    # rounding may put the rim of an object below the floor
    lowest = float(box[0, 2])
    if ground is not None and not own:
        return float(ground[0, 2])
    return max(own) if own else (lowest if lowest < -1e-3 else 0.0)


def spacing(reach: float) -> float:
    """Return a round distance of lines on the floor [m] for a scene of this radius [m]."""
    return next((step for step in _SPACINGS if step * _LINES >= reach), _SPACINGS[-1])
