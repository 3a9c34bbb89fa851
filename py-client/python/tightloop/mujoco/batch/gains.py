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
_MOTORS = {"actuator_gainprm": mujoco.mjtGain.mjGAIN_DCMOTOR, "actuator_biasprm": mujoco.mjtBias.mjBIAS_DCMOTOR}
#: Least resistance (MuJoCo: ``mjMINVAL``) [Ω].
_TINY = 1e-15


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
    groups = np.asarray(model.actuator_group)
    is_off = (groups >= 0) & (groups <= 30) & (model.opt.disableactuator >> np.clip(groups, 0, 30) & 1 == 1)
    is_off |= bool(model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_ACTUATION))
    rows = np.where(reads & ~is_off[:, None], values[..., :3].astype(np.float64), 0.0)
    for motor in np.flatnonzero((kinds == _MOTORS[name]) & ~is_off):
        rows[:, motor] = _motor_laws(model, int(motor))[name]
    return rows


def _motor_laws(model: Any, motor: int) -> dict[str, tuple[float, float, float]]:
    """Return gain and bias of a DC motor, as `sim-core/model/src/mujoco/actuators/motors.rs` has them."""
    resistance, constant, _, _, stiffness, _, damping = model.actuator_gainprm[motor, :7]
    per_volt, inputs = constant / max(resistance, _TINY), mujoco.mjtCtrlInput
    controlled = (0.0, -stiffness, -damping)
    gains = {int(inputs.mjINPUT_POS): stiffness, int(inputs.mjINPUT_VEL): damping, int(inputs.mjINPUT_FF): 1.0}
    gain = gains.get(int(model.actuator_ctrlspec[motor]))
    if gain is None:
        gain, controlled = per_volt, (0.0, 0.0, -constant * per_volt)
    return {"actuator_gainprm": (gain, 0.0, 0.0), "actuator_biasprm": controlled}


def inexpressible(model: Any, name: str, values: Array) -> Array:
    """Return which changed numbers no parameter expresses, ``(n, nu, 10)``.

    These are numbers of muscles and DC motors, and factors of velocity of adhesions.

    Args:
        model: The model.
        name: ``actuator_gainprm`` or ``actuator_biasprm``.
        values: Its values, ``(n, nu, 10)``.
    """
    kind, _, affine = _LAWS[name]
    kinds = np.asarray(getattr(model, kind))
    fixed = np.repeat(np.isin(kinds, (_MUSCLES[name], _MOTORS[name]))[:, None], values.shape[-1], axis=1)
    fixed[:, 2] |= (np.asarray(model.actuator_trntype) == mujoco.mjtTrn.mjTRN_BODY) & (kinds == affine)
    return (values != np.asarray(getattr(model, name)).astype(values.dtype)) & fixed
