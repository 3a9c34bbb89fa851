"""Gains and biases of actuators that differ between simulations, as parameters of a simulation."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.mujoco.batch.library import mujoco

Array = NDArray[Any]

#: Model fields and the parameters that they become: of ten numbers, an affine law reads three.
PARAMS = {"actuator_gainprm": "actuator_gain", "actuator_biasprm": "actuator_bias"}
_LAWS = {
    "actuator_gainprm": ("actuator_gaintype", mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtGain.mjGAIN_AFFINE),
    "actuator_biasprm": ("actuator_biastype", None, mujoco.mjtBias.mjBIAS_AFFINE),
}

_MUSCLES = {"actuator_gainprm": mujoco.mjtGain.mjGAIN_MUSCLE, "actuator_biasprm": mujoco.mjtBias.mjBIAS_MUSCLE}


def factors(model: Any, name: str, values: Array) -> Array:
    """Return constant and factors of length and velocity, ``(n, nu, 3)``; 0 where MuJoCo does not read a number.

    Args:
        model: The model.
        name: ``actuator_gainprm`` or ``actuator_biasprm``.
        values: Its values, ``(n, nu, 10)``.
    """
    kind, constant, affine = _LAWS[name]
    kinds = np.asarray(getattr(model, kind))
    reads = np.repeat((kinds == affine)[:, None], 3, axis=1)
    reads[:, 0] |= constant is not None and kinds == constant
    if model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_ACTUATION):
        reads[:] = False
    groups = np.asarray(model.actuator_group)
    reads[(groups >= 0) & (groups <= 30) & (model.opt.disableactuator >> np.clip(groups, 0, 30) & 1 == 1)] = False
    return np.where(reads, values[..., :3].astype(np.float64), 0.0)


def inexpressible(model: Any, name: str, values: Array) -> Array:
    """Return which changed numbers no parameter expresses, ``(n, nu, 10)``: of muscles, and with velocity of adhesions.

    Args:
        model: The model.
        name: ``actuator_gainprm`` or ``actuator_biasprm``.
        values: Its values, ``(n, nu, 10)``.
    """
    kind, _, affine = _LAWS[name]
    kinds = np.asarray(getattr(model, kind))
    fixed = np.repeat((kinds == _MUSCLES[name])[:, None], values.shape[-1], axis=1)
    fixed[:, 2] |= (np.asarray(model.actuator_trntype) == mujoco.mjtTrn.mjTRN_BODY) & (kinds == affine)
    return (values != np.asarray(getattr(model, name)).astype(values.dtype)) & fixed
