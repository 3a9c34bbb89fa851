"""What actuators add to the joints that they drive: armature and damping, times the square of their gear.

`sim-core/model/src/mujoco/reflected.rs` adds the same to what a model file says of its joints.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Numbers in ``jnt_actuatorid`` of a joint that no actuator adds to, and of one that several add to.
_NONE, _SEVERAL = -1, -2


def shares(model: Any) -> tuple[Array, Array]:
    """Return what actuators add to ``dof_armature`` ``(nv,)`` [kg·m² or kg], and to damping ``(nv, 3)``.

    The columns of damping are those of ``dof_damping`` [N·m·s/rad or N·s/m] and of ``dof_dampingpoly``.

    Args:
        model: An ``MjModel``. Those of older versions of MuJoCo have no such actuators.
    """
    import mujoco

    armature, damping = np.zeros(model.nv), np.zeros((model.nv, 3))
    parts = ("actuator_armature", "actuator_damping", "actuator_dampingpoly")
    # most models have none, and batches ask at each call
    if not any(np.any(getattr(model, part, 0.0)) for part in parts):
        return armature, damping
    kinds = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
    for actuator in np.flatnonzero(np.isin(np.asarray(model.actuator_trntype), kinds)):
        joint = int(model.actuator_trnid[actuator, 0])
        giver = int(model.jnt_actuatorid[joint]) if hasattr(model, "jnt_actuatorid") else _SEVERAL
        if giver == _NONE or giver not in (_SEVERAL, actuator):
            continue
        dofs = np.flatnonzero(np.asarray(model.dof_jntid) == joint)
        square = float(model.actuator_gear[actuator, 0]) ** 2
        armature[dofs] += square * model.actuator_armature[actuator]
        damping[dofs, 0] += square * model.actuator_damping[actuator]
        damping[dofs, 1:] += square * model.actuator_dampingpoly[actuator]
    return armature, damping
