"""A legged robot from MuJoCo's MJCF on a plane, as MuJoCo runs it beside its scene."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from tightloop.tasks.legged_models.rebuilt import rebuilt

#: Options of the step.
_OPTIONS = ("timestep", "integrator", "solver", "cone", "impratio", "iterations", "ls_iterations", "tolerance")


def grounded(model: Any) -> Any:
    """Return an MjModel of a robot with its actuators, on MuJoCo's default plane.

    Args:
        model: That of a `LeggedModel`, whose actuators drive single joints.

    Raises:
        ArgumentError: It has what `rebuilt` cannot keep.
    """
    mujoco: Any = import_module("mujoco")

    spec = rebuilt(model)
    for name in _OPTIONS:
        setattr(spec.option, name, getattr(model.opt, name))
    spec.option.gravity = model.opt.gravity
    spec.worldbody.add_geom(name="ground", type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0.0, 0.0, 0.05))
    for place in range(model.nu):
        known, own = model.actuator(place), spec.add_actuator(name=model.actuator(place).name)
        own.trntype, own.target = mujoco.mjtTrn.mjTRN_JOINT, model.joint(int(known.trnid[0])).name
        own.gaintype, own.biastype = int(known.gaintype[0]), int(known.biastype[0])
        own.gainprm[:], own.biasprm[:], own.gear[:] = known.gainprm, known.biasprm, known.gear
        own.ctrllimited, own.ctrlrange = bool(known.ctrllimited[0]), known.ctrlrange
        own.forcelimited, own.forcerange = bool(known.forcelimited[0]), known.forcerange
    return spec.compile()
