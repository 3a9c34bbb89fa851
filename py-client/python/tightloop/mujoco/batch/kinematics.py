"""Poses and velocities of bodies, geoms and sites, made in NumPy of the simulation's ``body_q`` and ``body_qd``.

A simulation that offers a field of this name itself is asked instead.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.mujoco.batch.rotations import cross, rotated, rotations

Array = NDArray[Any]


class Kinematics:
    """Fields of one frame, each computed when it is first asked for.

    Args:
        model: The model.
        body_q: Poses of the bodies in tightloop's conventions, ``(n, nbody, 7)`` [m, –].
        body_qd: Velocities of their centres of mass and angular velocities, ``(n, nbody, 6)`` [m/s, rad/s].
        mass: Masses of the bodies, ``(n, nbody)`` or ``(1, nbody)`` [kg].
    """

    def __init__(self, model: Any, body_q: Array, body_qd: Array | None, mass: Array) -> None:
        self._model, self._body_q, self._body_qd, self._mass = model, body_q, body_qd, mass

    @cached_property
    def xpos(self) -> Array:
        return self._body_q[..., :3].astype(np.float64)

    @cached_property
    def xquat(self) -> Array:
        return self._body_q[..., [6, 3, 4, 5]].astype(np.float64)

    @cached_property
    def _turns(self) -> Array:
        return rotations(self.xquat)

    @cached_property
    def xmat(self) -> Array:
        return _flat(self._turns)

    @cached_property
    def xipos(self) -> Array:
        return self.xpos + rotated(self._turns, self._model.body_ipos)

    @cached_property
    def ximat(self) -> Array:
        return _flat(self._turns @ rotations(self._model.body_iquat))

    @cached_property
    def geom_xpos(self) -> Array:
        return self._placed(self._model.geom_bodyid, self._model.geom_pos)

    @cached_property
    def geom_xmat(self) -> Array:
        return self._turned(self._model.geom_bodyid, self._model.geom_quat)

    @cached_property
    def site_xpos(self) -> Array:
        return self._placed(self._model.site_bodyid, self._model.site_pos)

    @cached_property
    def site_xmat(self) -> Array:
        return self._turned(self._model.site_bodyid, self._model.site_quat)

    @cached_property
    def subtree_com(self) -> Array:
        moments, masses = self.xipos * self._mass[..., None], np.array(self._mass, np.float64)
        for body in range(self._model.nbody - 1, 0, -1):
            parent = self._model.body_parentid[body]
            moments[:, parent] += moments[:, body]
            masses[:, parent] += masses[:, body]
        # a subtree without mass has its body's centre
        whole = np.maximum(masses, _MASS_MIN)[..., None]
        return np.where(masses[..., None] < _MASS_MIN, self.xipos, moments / whole)

    @cached_property
    def cvel(self) -> Array:
        assert self._body_qd is not None
        spin = self._body_qd[..., 3:].astype(np.float64)
        reference = self.subtree_com[:, self._model.body_rootid]
        linear = self._body_qd[..., :3] + cross(spin, reference - self.xipos)
        return np.concatenate([spin, linear], axis=-1)

    def _placed(self, bodies: Array, places: Array) -> Array:
        return self.xpos[:, bodies] + rotated(self._turns[:, bodies], places)

    def _turned(self, bodies: Array, turns: Array) -> Array:
        return _flat(self._turns[:, bodies] @ rotations(turns))


#: Mass below which MuJoCo takes a subtree for massless [kg].
_MASS_MIN = 1e-15
#: What each field is made of, by name.
SOURCES: dict[str, tuple[str, ...]] = {
    name: ("body_q", "body_qd") if name == "cvel" else ("body_q",)
    for name in (
        *("xpos", "xquat", "xmat", "xipos", "ximat", "geom_xpos", "geom_xmat"),
        *("site_xpos", "site_xmat", "subtree_com", "cvel"),
    )
}


def _flat(matrices: Array) -> Array:
    return matrices.reshape(*matrices.shape[:-2], 9)
