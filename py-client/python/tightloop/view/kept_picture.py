"""The meshes of simulations that were drawn: loaded for the first picture, and kept for the next ones."""

from __future__ import annotations

from collections import OrderedDict
from threading import RLock
from typing import Any

from tightloop.view.parts import parts
from tightloop.view.picture import Picture

# Simulations whose meshes are kept at a time; beyond, the one drawn longest ago loses its meshes.
_KEPT_MAX = 4

# reentrant: garbage collection inside may close a simulation
_lock = RLock()
_kept: OrderedDict[_Entry, Picture] = OrderedDict()


class _Entry:
    """Companion of a simulation that frees its meshes; it holds no reference to the simulation."""

    def close(self) -> None:
        with _lock:
            _kept.pop(self, None)


def kept_picture(sim: Any) -> Picture:
    """Return the `Picture` of a simulation that keeps its meshes, until the simulation is closed.

    Draw with `Picture.anew`: the kept one has no camera.

    Raises:
        SceneError: A file of the scene cannot be read.
        MissingLibrary: What reads images of visuals is not installed.
    """
    entry = next((own for own in sim._companions if isinstance(own, _Entry)), _Entry())
    with _lock:
        if entry in _kept:
            _kept.move_to_end(entry)
            return _kept[entry]
    info = sim.info
    picture = Picture(parts(info["scene"], info["scene_folder"], info["body_names"]))
    if not sim._end.alive:
        return picture
    with _lock:
        if entry not in sim._companions:
            sim._companions.append(entry)
        _kept[entry] = picture
        while len(_kept) > _KEPT_MAX:
            _kept.popitem(last=False)
    return picture
