"""Rays against the geoms of MuJoCo models, in all worlds at once and in this process."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tightloop import _core
from tightloop._core import Frame
from tightloop.arrays.frames import FrameCopy
from tightloop.arrays.inputs import reals
from tightloop.checks import arguments as checks
from tightloop.errors import ArgumentError, SceneError, UnknownField

Array = NDArray[Any]

#: Groups of geoms, MuJoCo's mjNGROUP.
_GROUPS = 6
#: Shortest direction of a ray, MuJoCo's mjMINVAL [–].
_LENGTH_MIN = 1e-15
_OTHERS = "leave it out with geomgroup, or call mujoco.mj_ray"


class RayHits(NamedTuple):
    """What rays meet first; `Sim.rays` returns it."""

    dist: NDArray[np.float64]
    """Distances in units of the directions, ``(worlds, rays)``; -1 where nothing is met."""
    geomid: NDArray[np.int32]
    """Geoms in the order of ``geom_xpos``, ``(worlds, rays)``; -1 where nothing is met."""
    normal: NDArray[np.float64]
    """Normals of length 1 that point out of the geom, ``(worlds, rays, 3)``; 0 where nothing is met."""


class Rays:
    """What rays meet in a scene.

    Args:
        scene: The scene as TOML.
        folder: The folder of its relative paths.
        first_bodies: The first body of each robot and model, by its name; None for one model alone, which may have no
            geoms.
        bodies: Number of bodies.

    Raises:
        SceneError: A model's file cannot be read here, or lacks what rays need, or there is no geom.
    """

    def __init__(self, scene: str, folder: str, first_bodies: dict[str, int] | None, bodies: int) -> None:
        self._core = _core.RayScene(scene, folder, first_bodies or {})
        self._bodies = bodies
        geoms = self._core.geoms()
        self._names, self._kinds, self._groups = geoms["name"], geoms["kind"], geoms["group"]
        if first_bodies is not None and not self._names:
            raise SceneError("rays: the scene has no geoms for rays to meet; add a MuJoCo model")
        self._has_shape, self._static, self._visible = (
            np.array(geoms[name], bool) for name in ("has_shape", "is_static", "is_visible")
        )

    @property
    def is_complete(self) -> bool:
        """Whether rays can meet all geoms that are visible."""
        return bool((self._has_shape | ~self._visible).all())

    def cast(
        self,
        poses: list[Array],
        pnt: ArrayLike,
        vec: ArrayLike,
        *,
        geomgroup: ArrayLike | None,
        flg_static: bool,
        bodyexclude: ArrayLike,
        threads: int,
    ) -> RayHits:
        """Find what rays meet; see `Sim.rays`.

        Args:
            poses: ``geom_xpos`` and ``geom_xmat``, or ``body_q`` alone.
            pnt: As in `Sim.rays`, as all arguments below.
            vec: Directions.
            geomgroup: Groups that count.
            flg_static: Whether static geoms count.
            bodyexclude: Bodies that rays pass through.
            threads: Most threads.
        """
        worlds = len(poses[0])
        origins, directions = points("pnt", pnt), points("vec", vec)
        try:
            shape = np.broadcast_shapes(origins.shape, directions.shape, (worlds, 1, 3))
        except ValueError:
            shape = ()
        if len(shape) != 3 or shape[0] != worlds:
            raise ArgumentError(
                f"rays: pnt has shape {origins.shape} and vec {directions.shape}; give ({worlds}, rays, 3), "
                f"(rays, 3) for rays that all {worlds} worlds share, or (3,) for one vector of all rays"
            )
        check_lengths(directions)
        excluded = self._excluded(bodyexclude, shape[:2])
        dist, geomid, normal = self._core.cast(
            self._chosen(geomgroup, checks.flag("rays: flg_static", flg_static, error=ArgumentError)),
            poses,
            np.broadcast_to(origins, shape),
            np.broadcast_to(directions, shape),
            excluded,
            threads,
        )
        return RayHits(dist.reshape(shape[:2]), geomid.reshape(shape[:2]), normal.reshape(shape))

    def _chosen(self, geomgroup: ArrayLike | None, flg_static: bool) -> NDArray[np.int64]:
        """Geoms that count."""
        counts = self._visible & (flg_static | ~self._static)
        if geomgroup is not None:
            groups = np.asarray(geomgroup)
            if groups.shape != (_GROUPS,) or groups.dtype.kind not in "biu":
                raise ArgumentError(f"rays: geomgroup must be {_GROUPS} flags, 0 or 1; got {geomgroup!r}")
            if None in self._groups:
                name = self._names[self._groups.index(None)]
                raise ArgumentError(
                    f"rays: the model file of geom `{name}` has no groups; save the scene again, or omit geomgroup"
                )
            own = np.clip(np.array(self._groups, int), 0, _GROUPS - 1)
            counts &= groups.astype(bool)[own]
        strange = np.flatnonzero(counts & ~self._has_shape)
        if len(strange):
            name, kind = self._names[strange[0]], self._kinds[strange[0]]
            raise ArgumentError(f"rays: geom `{name}`: no support for {kind}; {_OTHERS}")
        return np.flatnonzero(counts)

    def _excluded(self, bodyexclude: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.int32]:
        given = np.asarray(bodyexclude)
        if given.dtype.kind not in "iu":
            raise ArgumentError(f"rays: bodyexclude has dtype {given.dtype}; give indices of bodies, or -1 for none")
        if ((given < -1) | (given >= self._bodies)).any():
            raise ArgumentError(f"rays: bodyexclude must be from -1 to below {self._bodies}, the number of bodies")
        if given.ndim == 1:
            given = given[:, None]
        try:
            return np.broadcast_to(given.astype(np.int32), shape)
        except ValueError:
            raise ArgumentError(
                f"rays: bodyexclude has shape {np.shape(bodyexclude)}; give an index, ({shape[0]},) or {shape}"
            ) from None


def check_lengths(directions: Array) -> None:
    """Check that directions have a length; for one without, MuJoCo ends the process.

    Raises:
        ArgumentError: One has none.
    """
    if (np.linalg.norm(directions.astype(np.float64), axis=-1) < _LENGTH_MIN).any():
        raise ArgumentError("rays: a direction in vec has length 0")


def ray_poses(frame: Frame | FrameCopy) -> list[Array]:
    """Return ``geom_xpos`` and ``geom_xmat`` of a frame if it has them, else ``body_q``.

    Raises:
        UnknownField: The frame has neither.
    """
    found = [getattr(frame, name, None) for name in ("geom_xpos", "geom_xmat")]
    if any(array is None for array in found):
        found = [getattr(frame, "body_q", None)]
    if found[0] is None:
        raise UnknownField(
            'rays: the frame has no poses; launch with "body_q" in fields, or with "geom_xpos" and "geom_xmat"'
        )
    return [array for array in found if array is not None]


def points(name: str, value: ArrayLike) -> Array:
    """Convert origins or directions, ``(..., 3)``, to finite float32 or float64.

    Raises:
        ArgumentError: They are not.
    """
    given = reals(f"rays: {name}", value)
    if given.dtype != np.float32:
        given = given.astype(np.float64, copy=False)
    if given.ndim == 0 or given.shape[-1] != 3:
        raise ArgumentError(f"rays: {name} has shape {given.shape}; its last axis must be x, y and z")
    if not np.isfinite(given).all():
        raise ArgumentError(f"rays: {name} has a value that is NaN or infinite")
    return given
