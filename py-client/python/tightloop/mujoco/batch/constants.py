"""Constants that MuJoCo derives from a model, for each simulation."""

from __future__ import annotations

import copy
import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.mujoco.batch.expansions import CONSTANTS, Expansions
from tightloop.mujoco.batch.library import mujoco
from tightloop.mujoco.batch.varied_fields import AXES

#: Constants that make constraints soft.
_SOFTNESS = ("body_invweight0", "dof_invweight0", "tendon_invweight0")


def set_const(model: Any, expansions: Expansions, ids: NDArray[np.int64], num_sims: int) -> None:
    """Run ``mj_setConst`` for simulations and expand what it changed.

    Args:
        model: The batch's own copy of the model; it does not change.
        expansions: Its expanded fields.
        ids: Indices of the simulations.
        num_sims: Number of all simulations. If a field is expanded here, it is computed for all of them.

    Raises:
        RuntimeError: MuJoCo refuses a simulation's values; the first such simulation. The others are done.
    """
    scratch = copy.copy(model)
    if "body_ipos" in expansions.names:
        # where it is set, MuJoCo takes the frame of the body for that of the inertia
        scratch.body_sameframe[:] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
    data = mujoco.MjData(scratch)
    inputs = [name for name in expansions.names if name not in CONSTANTS and hasattr(model, name)]
    failed: str | None = None
    found: dict[int, dict[str, NDArray[Any]]] = {}
    todo = list(ids)
    while todo:
        sim = int(todo.pop(0))
        for name in inputs:
            getattr(scratch, name)[:] = expansions.of(name)[sim]
        try:
            mujoco.mj_setConst(scratch, data)
        except Exception as error:
            failed = failed or f"sim {sim}: {error}"
            continue
        found[sim] = {name: getattr(scratch, name).copy() for name in CONSTANTS if hasattr(scratch, name)}
        changed = [name for name, value in found[sim].items() if not np.array_equal(value, getattr(model, name))]
        fresh = [name for name in changed if name not in expansions.names]
        if fresh:
            for name in fresh:
                expansions.get(name, None)
            # what was never expanded is consistent for all simulations at once
            todo += [other for other in range(num_sims) if other not in found and other not in todo]
    done = np.array([sim for sim in ids if int(sim) in found], int)
    shares = np.broadcast_to(expansions.of("body_gravcomp"), (num_sims, model.nbody))
    expansions.compensated[done] = (shares[done] > 0.0).any(axis=1)
    for sim, values in found.items():
        for name, value in values.items():
            if name in expansions.names:
                expansions.of(name)[sim] = value
    if "tendon_length0" in expansions.names and _ties_tendons(model):
        warnings.warn(
            "set_const: equalities of tendons keep the tendon_length0 of the model, which qpos0 has changed; "
            "make a Batch per value",
            stacklevel=4,
        )
    if any(name in expansions.names for name in _SOFTNESS) and _keeps_softness(model):
        warnings.warn(
            "set_const: equalities, dry friction, tendons and limits of balls keep the softness of the model; "
            "contacts and limits of other joints follow body_invweight0 and dof_invweight0",
            stacklevel=4,
        )
    if failed:
        raise RuntimeError(failed)


def _ties_tendons(model: Any) -> bool:
    """Whether a model has equalities of tendons, which count from their lengths at ``qpos0``."""
    return bool((np.asarray(model.eq_type) == mujoco.mjtEq.mjEQ_TENDON).any())


def _keeps_softness(model: Any) -> bool:
    """Whether a model has constraints whose softness does not vary."""
    balls = np.asarray(model.jnt_limited).astype(bool) & ~np.isin(model.jnt_type, AXES)
    bounded = [balls, model.tendon_limited, model.dof_frictionloss, model.tendon_frictionloss]
    return any(len(array) and bool(np.any(array)) for array in bounded) or model.neq > 0
