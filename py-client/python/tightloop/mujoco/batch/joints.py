"""MuJoCo's positions, velocities and forces of joints as tightloop has them, for many simulations at once.

tightloop has quaternions as (x, y, z, w). For a free joint it has the velocity of the centre of mass, then the angular
velocity, both in world axes. MuJoCo has the velocity of the body's origin in world axes, then the angular velocity in
the body's axes. With the rotation R and the centre r from the origin, both in world axes:

    v' = v + ω' × r        ω' = R ω        f' = f        τ' = R τ - r × f
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.mujoco.batch.library import mujoco
from tightloop.planning.rotations import cross, rotated, rotations

Array = NDArray[np.float64]

#: Norm below which MuJoCo takes a quaternion as the identity [–].
_NORM_MIN = 1e-15


class JointMap:
    """Converts between MuJoCo's and tightloop's conventions.

    Args:
        model: The model.
    """

    def __init__(self, model: Any) -> None:
        self._order = np.arange(model.nq)
        self._quaternions: list[int] = []
        # first position, first dof, centre of mass of the body and all that is fixed to it, in the body's axes [m]
        self._free: list[tuple[int, int, Array]] = []
        for joint in range(model.njnt):
            kind, q, d = model.jnt_type[joint], int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
            if kind == mujoco.mjtJoint.mjJNT_FREE:
                self._free.append((q, d, _center(model, int(model.jnt_bodyid[joint]))))
                q += 3
            elif kind != mujoco.mjtJoint.mjJNT_BALL:
                continue
            self._quaternions.append(q)
            self._order[q : q + 4] = q + np.array([1, 2, 3, 0])

    @property
    def has_free(self) -> bool:
        """Whether there are free joints, whose forces depend on the positions."""
        return bool(self._free)

    def positions(self, qpos: Array) -> Array:
        """Convert positions, ``(n, nq)``, to ``joint_q``. A quaternion of norm 0 counts as no rotation."""
        joint_q = qpos[:, self._order]
        for q in self._quaternions:
            lost = np.linalg.norm(joint_q[:, q : q + 4], axis=1) < _NORM_MIN
            joint_q[lost, q : q + 4] = (0.0, 0.0, 0.0, 1.0)
        return joint_q

    def velocities(self, qpos: Array, qvel: Array) -> Array:
        """Convert velocities, ``(n, nv)``, to ``joint_qd``."""
        joint_qd = np.array(qvel)
        for q, d, center in self._free:
            turn = rotations(qpos[:, q + 3 : q + 7])
            spin = rotated(turn, qvel[:, d + 3 : d + 6])
            joint_qd[:, d : d + 3] += cross(spin, rotated(turn, center))
            joint_qd[:, d + 3 : d + 6] = spin
        return joint_qd

    def forces(self, qpos: Array, qfrc: Array) -> Array:
        """Convert generalized forces, ``(n, nv)``, to ``joint_f``."""
        joint_f = np.array(qfrc)
        for q, d, center in self._free:
            turn = rotations(qpos[:, q + 3 : q + 7])
            moment = rotated(turn, qfrc[:, d + 3 : d + 6])
            joint_f[:, d + 3 : d + 6] = moment - cross(rotated(turn, center), qfrc[:, d : d + 3])
        return joint_f


def _center(model: Any, body: int) -> Array:
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    parts = np.flatnonzero(model.body_weldid == body)
    mass = model.body_mass[parts]
    center = mass @ data.xipos[parts] / mass.sum() - data.xpos[body]
    return data.xmat[body].reshape(3, 3).T @ center
