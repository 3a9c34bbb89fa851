"""Which geom of a model each shape of its simulation is."""

from __future__ import annotations

from typing import Any

import numpy as np

from tightloop.errors import ArgumentError
from tightloop.mujoco.batch.library import mujoco


def geoms_of_shapes(model: Any, shape_names: list[str]) -> list[int]:
    """Return the geom of each shape.

    Args:
        model: The model.
        shape_names: Names of the shapes of the simulation, ``model/body/geom``.

    Raises:
        ArgumentError: The names do not say which geoms they are.
    """
    touches = (np.asarray(model.geom_contype) != 0) | (np.asarray(model.geom_conaffinity) != 0)
    touches[[*model.pair_geom1, *model.pair_geom2]] = True
    touching = np.flatnonzero(touches)
    bodies = [_name(model, mujoco.mjtObj.mjOBJ_BODY, int(model.geom_bodyid[geom]), "body") for geom in touching]
    geoms = [_name(model, mujoco.mjtObj.mjOBJ_GEOM, int(geom), "geom") for geom in touching]
    known = {f"{body}/{geom}": int(index) for body, geom, index in zip(bodies, geoms, touching, strict=True)}
    found = [known.get(name.partition("/")[2]) for name in shape_names]
    if len(known) != len(touching) or None in found:
        raise ArgumentError("geoms and bodies need unique names without `/` to vary fields of geoms")
    return [geom for geom in found if geom is not None]


def _name(model: Any, kind: Any, index: int, word: str) -> str:
    return mujoco.mj_id2name(model, kind, index) or f"{word}{index}"
