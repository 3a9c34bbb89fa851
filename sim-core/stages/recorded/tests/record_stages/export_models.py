"""Write the models of the tests of MuJoCo's stages: ``python`` with the path of this file."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
from safetensors.numpy import save_file

from tightloop.mujoco import export
from tightloop.mujoco.texts import texts

FOLDER = Path(__file__).parent
OPTIONS = {
    "implicit": ("mjINT_IMPLICITFAST", "mjCONE_ELLIPTIC"),
    "runge_kutta": ("mjINT_RK4", "mjCONE_PYRAMIDAL"),
}

for name, (integrator, cone) in OPTIONS.items():
    model = mujoco.MjModel.from_xml_path(str(FOLDER / "every_actuator.xml"))
    model.opt.integrator = mujoco.mjtIntegrator.__members__[integrator]
    model.opt.cone = mujoco.mjtCone.__members__[cone]
    export.export(model, FOLDER / f"{name}.safetensors")

export.export(FOLDER / "every_sensor.xml", FOLDER / "sensors.safetensors")

# a step of these moves the rests of springs, which models of MuJoCo before 4.0 cannot have
found = export.arrays(export.compiled(FOLDER / "every_passive.xml"))
names = {kind: texts(found[f"names.{kind}"]) for kind in ("joint", "tendon")}
place = 0
for kind, name, width in (("joint", "swing", 1), ("joint", "wrist", 4), ("tendon", "sum", 2), ("tendon", "rope", 2)):
    prefix = {"joint": "jnt"}.get(kind, kind)
    found.setdefault(f"{prefix}_plasticadr", np.full(len(names[kind]), -1, np.int32))
    found.setdefault(f"{prefix}_springyield", np.zeros(len(names[kind])))
    found[f"{prefix}_plasticadr"][names[kind].index(name)] = place
    found[f"{prefix}_springyield"][names[kind].index(name)] = 0.1
    place += width
save_file(found, FOLDER / "passive.safetensors")
