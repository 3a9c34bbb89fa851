"""MuJoCo models of published robots, as their owners run them: what benches/mujoco_models.py measures.

Needs MuJoCo and NumPy only, because the process of mjbatch has its own MuJoCo and reads the models here too.

- gymnasium's Ant and Humanoid (v5), and MuJoCo-Warp's humanoid: the XML files of their wheels.
- dm_control's quadruped: the file of its wheel, without what its tasks `walk` and `run` take out. Its torso, an
  ellipsoid, has no contacts, since tightloop refuses those.
- mjlab's Go1 and G1: the files and constants of its wheel, with actuators, collisions and options of its velocity tasks
  on flat ground. The Go1 has mjlab's ``FEET_ONLY_COLLISION``, the G1 collides with itself.
- Menagerie's Panda, and the G1 of MuJoCo-Warp's benchmarks, are in no wheel: they come from the reference folder.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import mujoco
import numpy as np

REPOSITORY = Path(__file__).parents[1]
WHEELS = REPOSITORY / "out/menagerie"
# Parts of dm_control's quadruped.xml that `make_model` of its suite takes out for the tasks `walk` and `run`
BALL_AND_WALLS = ("wall_px", "wall_py", "wall_nx", "wall_ny", "terrain")
# Floor of `run`: 20 s at 5 m/s [m]
QUADRUPED_FLOOR = 100.0
# Options of mjlab's velocity tasks [s], [–]
MJLAB_STEP, MJLAB_ITERATIONS, MJLAB_LINE_SEARCH = 0.005, 10, 20


@dataclass(frozen=True)
class Robot:
    """A model and how it is driven.

    Attributes:
        name: Name of the row.
        build: Makes the model; the argument is the folder of what no wheel has.
        substeps: Physics steps per control step of its owner's task.
        keyframe: Keyframe where it begins, whose ctrl its own ctrl swings about; the model's start if left out.
        swing: Largest amplitude of its ctrl, as a part of half of ctrlrange [–].
    """

    name: str
    build: Callable[[Path], mujoco.MjModel]
    substeps: int
    keyframe: str | None = None
    swing: float = 1.0

    def model(self, folder: Path) -> mujoco.MjModel:
        """The model without sensors: MuJoCo would evaluate them in every step, tightloop only for a field that asks."""
        model = self.build(folder)
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_SENSOR
        return model


def _wheel(file: str) -> Callable[[Path], mujoco.MjModel]:
    return lambda _: mujoco.MjModel.from_xml_path(str(_found(WHEELS, file)))


def _reference(file: str) -> Callable[[Path], mujoco.MjModel]:
    return lambda folder: mujoco.MjModel.from_xml_path(str(folder / file))


def _found(folder: Path, file: str) -> Path:
    """The file whose wheel, the first part of its name, has any version."""
    wheel, _, rest = file.partition("/")
    found = sorted(folder.glob(f"{wheel}-*/{rest}"))
    if not found:
        raise FileNotFoundError(f"{folder.name}/{file} is missing; run tests/python/menagerie/fetch.py")
    return found[-1]


def _quadruped(_: Path) -> mujoco.MjModel:
    path = _found(WHEELS, "dm_control/dm_control/suite/quadruped.xml")
    # MjSpec.delete leaves the sites' sensors behind, so the text is cut, as dm_control does
    text = re.sub(r"<rangefinder name=[^>]*/>", "", path.read_text())
    text = text.replace("./common/", f"{path.parent}/common/")
    spec = mujoco.MjSpec.from_string(text)
    for name in BALL_AND_WALLS:
        spec.delete(spec.geom(name))
    spec.delete(spec.body("ball"))
    spec.delete(spec.site("target"))
    spec.geom("floor").size = (QUADRUPED_FLOOR, QUADRUPED_FLOOR, 0.5)
    # tightloop refuses contacts of ellipsoids
    spec.geom("torso").contype = spec.geom("torso").conaffinity = 0
    return spec.compile()


def _go1(_: Path) -> mujoco.MjModel:
    go1 = _constants("unitree_go1/go1_constants.py")
    spec = _mjlab(go1, go1["FEET_ONLY_COLLISION"], go1["INIT_STATE"], go1["GO1_ARTICULATION"])
    spec.option.cone, spec.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 10.0
    return spec.compile()


def _g1(_: Path) -> mujoco.MjModel:
    g1 = _constants("unitree_g1/g1_constants.py")
    return _mjlab(g1, g1["FULL_COLLISION"], g1["KNEES_BENT_KEYFRAME"], g1["G1_ARTICULATION"]).compile()


def _constants(file: str) -> dict[str, Any]:
    """The names of a robot's file of constants, without torch and Warp: classes that need them only hold data here."""
    path = _found(WHEELS, f"mjlab/mjlab/asset_zoo/robots/{file}")
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


ROBOTS = {
    robot.name: robot
    for robot in (
        Robot("gymnasium Ant", _wheel("gymnasium/gymnasium/envs/mujoco/assets/ant.xml"), 5),
        Robot("gymnasium Humanoid", _wheel("gymnasium/gymnasium/envs/mujoco/assets/humanoid.xml"), 5),
        Robot("dm_control quadruped, torso without contacts", _quadruped, 4),
        Robot("mjlab Go1, feet only", _go1, 4, "start", 0.2),
        Robot("mjlab G1", _g1, 4, "start", 0.2),
        Robot("Menagerie Panda", _reference("menagerie_panda/scene.xml"), 8, "home", 0.5),
        Robot("MuJoCo-Warp humanoid", _wheel("mujoco-warp/mujoco_warp/test_data/humanoid/humanoid.xml"), 4),
        Robot("MuJoCo-Warp G1, flat", _reference("mjwarp/unitree_g1/scene_flat.xml"), 4, "home", 0.2),
    )
}


def start_of(robot: Robot, model: mujoco.MjModel) -> mujoco.MjData:
    """Where the robot begins, with the ctrl that its own swings about."""
    data = mujoco.MjData(model)
    if robot.keyframe is not None:
        mujoco.mj_resetDataKeyframe(model, data, model.key(robot.keyframe).id)
    else:
        data.ctrl[:] = model.actuator_ctrlrange.mean(axis=1)
    return data


def contacts_of(model: mujoco.MjModel, state: dict[str, np.ndarray], ctrl: np.ndarray) -> tuple[float, float]:
    """Mean contacts and mean Newton iterations from a cold start, as this process's MuJoCo finds them in states."""
    data = mujoco.MjData(model)
    contacts, iterations = [], []
    for row, values in enumerate(ctrl):
        mujoco.mj_resetData(model, data)
        for name, array in state.items():
            getattr(data, name)[:] = array[row]
        data.ctrl[:] = values
        mujoco.mj_forward(model, data)
        contacts.append(data.ncon)
        iterations.append(data.solver_niter.max())
    return float(np.mean(contacts)), float(np.mean(iterations))
