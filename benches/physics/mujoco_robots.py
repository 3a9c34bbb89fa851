"""MuJoCo models of published robots, as their owners run them: what benches/physics/mujoco_models.py measures.

Needs MuJoCo and NumPy only, because the process of mjbatch has its own MuJoCo and reads the models here too.

- gymnasium's Ant and Humanoid (v5), and MuJoCo-Warp's humanoid: the XML files of their wheels.
- dm_control's quadruped: the file of its wheel, without what its tasks `walk` and `run` take out.
- mjlab's Go1 and G1: the files and constants of its wheel, with actuators, collisions and options of its velocity tasks
  on flat ground. The Go1 has mjlab's ``FEET_ONLY_COLLISION``, the G1 collides with itself.
- Hands and muscles: benches/physics/mujoco_hands.py says what they are.
- Legged robots in a heap: benches/physics/mujoco_heaps.py says what they are.
- Menagerie's Panda, and the G1 of MuJoCo-Warp's benchmarks, are in no wheel: they come from the reference folder.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
from mjlab_robots import feet_go1, full_g1
from mujoco_files import MENAGERIE, Robot, found
from mujoco_hands import HANDS
from mujoco_heaps import HEAPS

# Parts of dm_control's quadruped.xml that `make_model` of its suite takes out for the tasks `walk` and `run`
BALL_AND_WALLS = ("wall_px", "wall_py", "wall_nx", "wall_ny", "terrain")
# Floor of `run`: 20 s at 5 m/s [m]
QUADRUPED_FLOOR = 100.0


def _wheel(file: str) -> Callable[[Path], mujoco.MjModel]:
    return lambda _: mujoco.MjModel.from_xml_path(str(found(MENAGERIE, file)))


def _reference(file: str) -> Callable[[Path], mujoco.MjModel]:
    return lambda folder: mujoco.MjModel.from_xml_path(str(folder / file))


def _quadruped(_: Path) -> mujoco.MjModel:
    path = found(MENAGERIE, "dm_control/dm_control/suite/quadruped.xml")
    # MjSpec.delete leaves the sites' sensors behind, so the text is cut, as dm_control does
    text = re.sub(r"<rangefinder name=[^>]*/>", "", path.read_text())
    text = text.replace("./common/", f"{path.parent}/common/")
    spec = mujoco.MjSpec.from_string(text)
    for name in BALL_AND_WALLS:
        spec.delete(spec.geom(name))
    spec.delete(spec.body("ball"))
    spec.delete(spec.site("target"))
    spec.geom("floor").size = (QUADRUPED_FLOOR, QUADRUPED_FLOOR, 0.5)
    return spec.compile()


ROBOTS = {
    robot.name: robot
    for robot in (
        Robot("gymnasium Ant", _wheel("gymnasium/gymnasium/envs/mujoco/assets/ant.xml"), 5),
        Robot("gymnasium Humanoid", _wheel("gymnasium/gymnasium/envs/mujoco/assets/humanoid.xml"), 5),
        Robot("dm_control quadruped", _quadruped, 4),
        Robot("mjlab Go1, feet only", lambda _: feet_go1().compile(), 4, "start", 0.2),
        Robot("mjlab G1", lambda _: full_g1().compile(), 4, "start", 0.2),
        Robot("Menagerie Panda", _reference("menagerie_panda/scene.xml"), 8, "home", 0.5),
        Robot("MuJoCo-Warp humanoid", _wheel("mujoco-warp/mujoco_warp/test_data/humanoid/humanoid.xml"), 4),
        Robot("MuJoCo-Warp G1, flat", _reference("mjwarp/unitree_g1/scene_flat.xml"), 4, "home", 0.2),
        *HANDS,
        *HEAPS,
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
