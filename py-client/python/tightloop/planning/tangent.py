"""Joint states in MuJoCo's conventions, and their tangent space, for scenes of any robots.

A state is ``qpos`` and ``qvel`` as MuJoCo has them. A displacement has a column per dof: of a free joint the position
in world axes, then a rotation vector in the body's axes; of a ball joint a rotation vector in the child's axes. These
are the displacements of ``mj_integratePos`` and ``mj_differentiatePos``.

`joint_qd` of a free joint has the velocity of the centre of mass and the angular velocity, in world axes. With the
rotation R and the centre c in the body's axes:

    v' = v + R ω × R c        ω' = R ω
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tightloop.planning.rotations import cross, rotated, rotations

Array = NDArray[np.float64]

#: Columns of a quaternion in ``joint_q``, and of the position before that of a free joint.
_QUATERNION, _POSITION = (".qx", ".qy", ".qz", ".qw"), (".x", ".y", ".z")


class Tangent:
    """Tangent space of the positions of a scene.

    Args:
        coord_names: ``robot/joint`` of each coordinate, as `Sim.coord_names`.
        dof_names: ``robot/joint`` of each dof, as `Sim.dof_names`.

    Attributes:
        free: First coordinate and first dof of each free joint.
        centers: Centre of mass of the body of each free joint from the joint's origin, in the body's axes [m],
            ``(free joints, 3)``; `velocities` reads it.
    """

    def __init__(self, coord_names: Sequence[str], dof_names: Sequence[str]) -> None:
        self.free: list[tuple[int, int]] = []
        # first coordinate of each quaternion, and its first dof
        self._turns: list[tuple[int, int]] = []
        scalars, order, q, d = [], [], 0, 0
        while q < len(coord_names):
            if _has(coord_names, q, _POSITION + _QUATERNION):
                self.free.append((q, d))
                scalars += [(q + axis, d + axis) for axis in range(3)]
                order += [q, q + 1, q + 2]
                q, d = q + 3, d + 3
            if _has(coord_names, q, _QUATERNION):
                self._turns.append((q, d))
                order += [q + 1, q + 2, q + 3, q]
                q, d = q + 4, d + 3
            else:
                scalars.append((q, d))
                order.append(q)
                q, d = q + 1, d + 1
        assert d == len(dof_names), "each joint has its dofs in the order of its coordinates"
        self._coords, self._dofs = np.array(scalars, np.intp).reshape(-1, 2).T
        self._order = np.array(order, np.intp)
        self.centers = np.zeros((len(self.free), 3))

    def positions(self, qpos: Array) -> Array:
        """Convert ``qpos``, ``(n, coords)``, to ``joint_q``."""
        return qpos[:, self._order]

    def velocities(self, qpos: Array, qvel: Array) -> Array:
        """Convert ``qvel``, ``(n, dofs)``, to ``joint_qd``."""
        joint_qd = np.array(qvel)
        for (q, d), center in zip(self.free, self.centers, strict=True):
            turn = rotations(qpos[:, q + 3 : q + 7])
            spin = rotated(turn, qvel[:, d + 3 : d + 6])
            joint_qd[:, d : d + 3] += cross(spin, rotated(turn, center))
            joint_qd[:, d + 3 : d + 6] = spin
        return joint_qd

    def moved(self, qpos: Array, by: Array) -> Array:
        """Add displacements, ``(n, dofs)``, to ``qpos``, ``(n, coords)``, as ``mj_integratePos`` does."""
        there = np.array(qpos)
        there[:, self._coords] += by[:, self._dofs]
        for q, d in self._turns:
            there[:, q : q + 4] = _product(qpos[:, q : q + 4], _quaternions(by[:, d : d + 3]))
        return there

    def difference(self, start: Array, end: Array) -> Array:
        """Return displacements from ``start`` to ``end``, ``(n, dofs)``, as ``mj_differentiatePos`` does."""
        by = np.empty((len(end), len(self._dofs) + 3 * len(self._turns)))
        by[:, self._dofs] = end[:, self._coords] - start[:, self._coords]
        for q, d in self._turns:
            back = start[:, q : q + 4] * (1.0, -1.0, -1.0, -1.0)
            by[:, d : d + 3] = _rotation_vectors(_product(back, end[:, q : q + 4]))
        return by


def _has(names: Sequence[str], first: int, endings: Sequence[str]) -> bool:
    """Return whether names from ``first`` on are one joint's, with these endings."""
    joint = names[first].removesuffix(endings[0])
    return list(names[first : first + len(endings)]) == [joint + ending for ending in endings]


def _product(a: Array, b: Array) -> Array:
    """Multiply quaternions (w, x, y, z), ``(n, 4)``."""
    (aw, ax, ay, az), (bw, bx, by, bz) = a.T, b.T
    return np.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ],
        axis=1,
    )


def _quaternions(vectors: Array) -> Array:
    """Convert rotation vectors, ``(n, 3)`` [rad], to quaternions (w, x, y, z)."""
    half = 0.5 * np.linalg.norm(vectors, axis=1, keepdims=True)
    # sin(x)/x is numpy's sinc(x/π)
    return np.concatenate((np.cos(half), 0.5 * vectors * np.sinc(half / np.pi)), axis=1)


def _rotation_vectors(quaternions: Array) -> Array:
    """Convert quaternions (w, x, y, z) to rotation vectors below half a turn, ``(n, 3)`` [rad]."""
    axis = quaternions[:, 1:]
    sine = np.linalg.norm(axis, axis=1)
    angle = 2.0 * np.arctan2(sine, quaternions[:, 0])
    angle -= 2.0 * np.pi * (angle > np.pi)
    return axis * np.divide(angle, sine, out=np.full(len(sine), 2.0), where=sine > 0.0)[:, None]
