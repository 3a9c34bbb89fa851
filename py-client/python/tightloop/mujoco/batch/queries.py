"""Rays and Jacobians at the poses that MuJoCo computes for each simulation in a scratch ``MjData``."""

from __future__ import annotations

import copy
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.errors import ArgumentError
from tightloop.mujoco.batch.expansions import Expansions
from tightloop.mujoco.batch.layout import StateLayout
from tightloop.mujoco.batch.library import mujoco
from tightloop.scene.scene import Scene
from tightloop.sim.rays import RayHits, Rays, check_lengths, points

Array = NDArray[Any]

#: Fields of the model that say where geoms are and what rays meet. Each simulation may have its own, also of integers.
SEEN = (
    *("qpos0", "body_pos", "body_quat", "body_ipos", "body_iquat", "body_mocapid", "body_sameframe"),
    *("jnt_pos", "jnt_axis", "geom_type", "geom_dataid", "geom_pos", "geom_quat", "geom_size", "geom_sameframe"),
    *("geom_rgba", "geom_matid", "geom_group", "mat_rgba"),
)
#: Those of them that place bodies and geoms, and change no geom.
_PLACING = (
    *("qpos0", "body_pos", "body_quat", "body_ipos", "body_iquat", "body_mocapid", "body_sameframe"),
    *("jnt_pos", "jnt_axis", "geom_pos", "geom_quat", "geom_sameframe"),
)
_REAL = (np.dtype(np.float64), np.dtype(np.float32))


class Queries:
    """Answers for states of a model; they change no simulation.

    Args:
        model: The batch's own copy of the model.
        layout: Its state.
        scene: The scene with the model alone.
        threads: Largest number of threads.
        expansions: Fields with a value per simulation, some of which place bodies and geoms.
    """

    def __init__(self, model: Any, layout: StateLayout, scene: Scene, threads: int, *, expansions: Expansions) -> None:
        self._layout, self._expansions = layout, expansions
        self._scene, self._threads = scene, threads
        # it takes the references of the simulation whose bodies are placed
        self._model = copy.copy(model)
        self._data = mujoco.MjData(model)

    @cached_property
    def _rays(self) -> Rays:
        return Rays(self._scene.to_toml(), "/", None, self._model.nbody)

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
        excluded = np.full(count, -1, np.int32)
        if exclude is not None:
            is_body = (exclude >= 0) & (exclude < self._model.nbody)
            excluded[is_body] = exclude[is_body]
        origins, directions = pnt[ids], vec[ids]
        if self._rays.is_complete and not self._shapes_vary(ids):
            cast = partial(self._rays.cast, self._poses(rows, ids), threads=self._threads)
        else:
            cast = partial(self._by_mujoco, rows, ids)
        found = cast(origins, directions, geomgroup=geomgroup, flg_static=bool(static), bodyexclude=excluded[None, :])
        for array, values in zip(filled, found, strict=True):
            if array is not None:
                array[ids] = values

    def _shapes_vary(self, ids: Array) -> bool:
        """Whether geoms of these simulations are other geoms than the model's, and not only elsewhere."""
        names = [name for name in self._expansions.names if name in SEEN and name not in _PLACING]
        return any(self._expansions.differs(name, ids).any() for name in names)

    def _poses(self, rows: Array, ids: Array) -> list[Array]:
        """``geom_xpos`` and ``geom_xmat`` of rows."""
        geoms = self._model.ngeom
        poses = [np.empty((len(rows), geoms, 3)), np.empty((len(rows), geoms, 9))]
        for at, (row, sim) in enumerate(zip(rows, ids, strict=True)):
            self._place(row, sim)
            poses[0][at], poses[1][at] = self._data.geom_xpos, self._data.geom_xmat
        return poses

    def _by_mujoco(
        self,
        rows: Array,
        ids: Array,
        pnt: Array,
        vec: Array,
        *,
        geomgroup: Array | None,
        flg_static: bool,
        bodyexclude: Array,
    ) -> RayHits:
        """What rays meet where a geom is an SDF, or geoms of simulations differ."""
        origins, directions = points("pnt", pnt).astype(np.float64), points("vec", vec).astype(np.float64)
        check_lengths(directions)
        shape = pnt.shape[:2]
        found = RayHits(np.empty(shape), np.empty(shape, np.int32), np.zeros((*shape, 3)))
        hit, face = np.zeros(1, np.int32), np.zeros(3)
        excluded = bodyexclude[0].tolist()
        for at, (row, sim) in enumerate(zip(rows, ids, strict=True)):
            self._place(row, sim)
            for ray in range(shape[1]):
                origin, direction, body = origins[at, ray], directions[at, ray], excluded[ray]
                far = mujoco.mj_ray(self._model, self._data, origin, direction, geomgroup, flg_static, body, hit, face)
                found.dist[at, ray], found.geomid[at, ray] = far, hit[0]
                if far >= 0.0:
                    found.normal[at, ray] = face
        return found

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
            self._place(row, sim)
            mujoco.mj_comPos(self._model, self._data)
            mujoco.mj_jac(self._model, self._data, linear, angular, point[sim].astype(np.float64), int(body[sim]))
            if jacp is not None:
                jacp[sim] = linear
            if jacr is not None:
                jacr[sim] = angular

    def _place(self, row: Array, sim: int) -> None:
        for name in self._expansions.names:
            if name in SEEN:
                getattr(self._model, name)[:] = self._expansions.of(name)[sim]
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
