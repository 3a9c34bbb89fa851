"""Write the models of the tests of MuJoCo's stages: ``python`` with the path of this file."""

from __future__ import annotations

from pathlib import Path

import mujoco

from tightloop.mujoco import export

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
export.export(FOLDER / "every_passive.xml", FOLDER / "passive.safetensors")
