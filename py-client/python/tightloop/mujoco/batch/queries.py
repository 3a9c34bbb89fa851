"""Rays and Jacobians, which MuJoCo computes for each simulation in a scratch ``MjData``."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.errors import ArgumentError
from tightloop.mujoco.batch.layout import StateLayout
from tightloop.mujoco.batch.library import mujoco

Array = NDArray[Any]

_REAL = (np.dtype(np.float64), np.dtype(np.float32))
#: Shortest direction of a ray, MuJoCo's mjMINVAL [–].
_LENGTH_MIN = 1e-15


class Queries:
    """Answers for states of a model; they change no simulation.

    Args:
        model: The batch's own copy of the model.
        layout: Its state.
    """

    def __init__(self, model: Any, layout: StateLayout) -> None:
        self._model, self._layout = model, layout
        self._data = mujoco.MjData(model)

    def rays(
        self,
        rows: Array,
        ids: Array,
        num_sims: int,
        *,
        given: tuple[Array, Array],
        filled: tuple[Array, Array | None, Array | None],
        options: tuple[Array | None, bool, Array | None],
    ) -> None:
        """Intersect rays with the geoms of simulations; see `Batch.rays`.

        Args:
            rows: States of the simulations ``ids``, ``(len(ids), nstate)``.
            ids: Their indices.
            num_sims: Number of all simulations.
            given: Origins and directions.
            filled: Distances, geoms and normals.
            options: Groups of geoms, whether static geoms count, and the excluded body of each ray.
        """
        (pnt, vec), (dist, geomid, normal), (geomgroup, static, exclude) = given, filled, options
        if not isinstance(pnt, np.ndarray) or pnt.ndim != 3:
            raise ArgumentError("rays: pnt must be an array of shape (num_sims, nray, 3)")
        count = pnt.shape[1]
        for name, array, shape, dtypes in (
            ("pnt", pnt, (num_sims, count, 3), _REAL),
            ("vec", vec, (num_sims, count, 3), (pnt.dtype,)),
            ("dist", dist, (num_sims, count), (pnt.dtype,)),
            ("geomid", geomid, (num_sims, count), (np.dtype(np.int32),)),
            ("normal", normal, (num_sims, count, 3), (pnt.dtype,)),
            ("geomgroup", geomgroup, (6,), (np.dtype(np.uint8),)),
            ("bodyexclude", exclude, (count,), (np.dtype(np.int32),)),
        ):
            _check("rays", name, array, shape, dtypes)
        for name, array in (("pnt", pnt), ("vec", vec)):
            if not np.isfinite(array[ids]).all():
                raise ArgumentError(f"rays: {name} has a value that is NaN or infinite")
        # for such a ray MuJoCo ends the process
        if (np.linalg.norm(vec[ids].astype(np.float64), axis=-1) < _LENGTH_MIN).any():
            raise ArgumentError("rays: a direction in vec has length 0")
        hit, face = np.zeros(1, np.int32), np.zeros(3)
        excluded = [-1] * count if exclude is None else exclude.tolist()
        for row, sim in zip(rows, ids, strict=True):
            self._place(row)
            origins, directions = pnt[sim].astype(np.float64), vec[sim].astype(np.float64)
            for ray in range(count):
                origin, direction, body = origins[ray], directions[ray], excluded[ray]
                far = mujoco.mj_ray(
                    self._model, self._data, origin, direction, geomgroup, bool(static), body, hit, face
                )
                dist[sim, ray] = far
                if geomid is not None:
                    geomid[sim, ray] = hit[0]
                if normal is not None:
                    normal[sim, ray] = face if far >= 0.0 else 0.0

    def jac(
        self, rows: Array, ids: Array, num_sims: int, filled: tuple[Array | None, Array | None], at: tuple[Array, Array]
    ) -> None:
        """Fill Jacobians of a point per simulation; see `Batch.jac`. ``at`` is the points and their bodies."""
        (jacp, jacr), (point, body) = filled, at
        shape = (num_sims, 3, self._model.nv)
        _check("jac", "point", point, (num_sims, 3), _REAL)
        for name, array, expected, dtypes in (
            ("jacp", jacp, shape, (point.dtype,)),
            ("jacr", jacr, shape, (point.dtype,)),
            ("body", body, (num_sims,), (np.dtype(np.int32),)),
        ):
            _check("jac", name, array, expected, dtypes)
        if np.any((body[ids] < 0) | (body[ids] >= self._model.nbody)):
            raise ArgumentError(f"jac: body must be at least 0 and below nbody, {self._model.nbody}")
        linear, angular = (np.empty((3, self._model.nv)) for _ in range(2))
        for row, sim in zip(rows, ids, strict=True):
            self._place(row)
            mujoco.mj_comPos(self._model, self._data)
            mujoco.mj_jac(self._model, self._data, linear, angular, point[sim].astype(np.float64), int(body[sim]))
            if jacp is not None:
                jacp[sim] = linear
            if jacr is not None:
                jacr[sim] = angular

    def _place(self, row: Array) -> None:
        self._layout.load(self._data, row)
        mujoco.mj_kinematics(self._model, self._data)


def _check(call: str, name: str, array: Any, shape: tuple[int, ...], dtypes: tuple[np.dtype[Any], ...]) -> None:
    if array is None and name in ("geomid", "normal", "geomgroup", "bodyexclude", "jacp", "jacr"):
        return
    if not isinstance(array, np.ndarray) or array.shape != shape:
        got = array.shape if isinstance(array, np.ndarray) else type(array).__name__
        raise ArgumentError(f"{call}: {name} must be an array of shape {shape}, num_sims first; got {got}")
    if array.dtype not in dtypes:
        raise ArgumentError(f"{call}: {name} is {array.dtype}; give {' or '.join(map(str, dtypes))}")
