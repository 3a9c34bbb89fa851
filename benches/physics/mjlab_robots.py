"""Go1 and G1 of mjlab's wheel, edited as mjlab's `Entity` does, without torch and Warp.

Needs MuJoCo only, because the process of mjbatch has its own MuJoCo and reads the models here too.
"""

from __future__ import annotations

import re
import sys
from enum import Enum
from types import ModuleType, SimpleNamespace
from typing import Any

import mujoco
from mujoco_files import MENAGERIE, found

# Options of mjlab's velocity tasks [s], [–]
MJLAB_STEP, MJLAB_ITERATIONS, MJLAB_LINE_SEARCH = 0.005, 10, 20


def feet_go1() -> mujoco.MjSpec:
    """The Go1 of mjlab's velocity task on flat ground, but only its feet collide."""
    spec = _go1("FEET_ONLY_COLLISION")
    spec.option.cone, spec.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 10.0
    return spec


def full_go1() -> mujoco.MjSpec:
    """The Go1 with all of its collision geoms."""
    return _go1("FULL_COLLISION")


def full_g1() -> mujoco.MjSpec:
    """The G1 of mjlab's velocity task on flat ground; it collides with itself."""
    g1 = _constants("unitree_g1/g1_constants.py")
    return _mjlab(g1, g1["FULL_COLLISION"], g1["KNEES_BENT_KEYFRAME"], g1["G1_ARTICULATION"])


def _go1(collision: str) -> mujoco.MjSpec:
    go1 = _constants("unitree_go1/go1_constants.py")
    return _mjlab(go1, go1[collision], go1["INIT_STATE"], go1["GO1_ARTICULATION"])


def _constants(file: str) -> dict[str, Any]:
    """The names of a robot's file of constants, without torch and Warp: classes that need them only hold data here."""
    path = found(MENAGERIE, f"mjlab/mjlab/asset_zoo/robots/{file}")
    folder = path.parents[3]
    for name in [name for name in sys.modules if name.partition(".")[0] == "mjlab"]:
        del sys.modules[name]
    holder: Any = SimpleNamespace
    entity = {"EntityArticulationInfoCfg": holder}
    entity["EntityCfg"] = type("EntityCfg", (SimpleNamespace,), {"InitialStateCfg": SimpleNamespace})
    kinds = Enum("TransmissionType", ["JOINT", "TENDON", "SITE"])
    stand_ins: dict[str, dict[str, Any]] = {
        "mjlab": {"MJLAB_SRC_PATH": folder, "__path__": [str(folder)]},
        "mjlab.entity": entity,
        "mjlab.actuator": {"BuiltinPositionActuatorCfg": holder, "__path__": []},
        "mjlab.actuator.actuator": {"TransmissionType": kinds},
    }
    for name, content in stand_ins.items():
        module = ModuleType(name)
        vars(module).update(content)
        sys.modules[name] = module
    names: dict[str, Any] = {"__name__": path.stem}
    exec(compile(path.read_text(), str(path), "exec"), names)
    return names


def _mjlab(names: dict[str, Any], collision: Any, start: Any, articulation: Any) -> mujoco.MjSpec:
    """A robot on mjlab's plane, edited as mjlab's `Entity` does."""
    from mjlab.utils.spec import create_position_actuator  # pyright: ignore[reportMissingImports]

    spec = names["get_spec"]()
    joints = [joint.name for joint in spec.joints if joint.type != mujoco.mjtJoint.mjJNT_FREE]
    for group in articulation.actuators:
        gains = {name: getattr(group, name) for name in ("stiffness", "damping", "effort_limit", "armature")}
        for joint in joints:
            if any(re.match(pattern, joint) for pattern in group.target_names_expr):
                create_position_actuator(spec, joint, **gains)
    collision.edit_spec(spec)
    spec.worldbody.add_geom(name="terrain", type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0, 0, 0.01))
    # an angle that no pattern names is 0
    angles = {
        joint: next((angle for pattern, angle in start.joint_pos.items() if re.match(pattern, joint)), 0.0)
        for joint in joints
    }
    spec.add_key(
        name="start",
        qpos=[*start.pos, 1, 0, 0, 0, *angles.values()],
        ctrl=[angles[actuator.target] for actuator in spec.actuators],
    )
    option = spec.option
    option.timestep, option.integrator = MJLAB_STEP, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.iterations, option.ls_iterations = MJLAB_ITERATIONS, MJLAB_LINE_SEARCH
    return spec
