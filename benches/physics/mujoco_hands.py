"""Models with hands, and with muscles on tendons that bend around shapes: a part of benches/physics/mujoco_robots.py.

- The Shadow hand of mujoco-mjx, as its scene has it: a ball of 3 cm falls into its palm. In the other row it is a
  cube of 5 cm.
- The arm26 of mujoco-mjx: two joints, six muscles, whose tendons bend around two cylinders.
- The same arm eight times in one world, for a model with as many muscles as a leg of the myo family.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import mujoco
from mujoco_files import MENAGERIE, Robot, found

DATA = "mujoco-mjx/mujoco/mjx/test_data"
# Half of an edge [m], and mass [kg] of the cube
CUBE, CUBE_MASS = 0.025, 0.05
ARMS = 8
# Between arms [m]
APART = 1.0


def _shadow(_: Path, *, cube: bool) -> mujoco.MjModel:
    path = found(MENAGERIE, f"{DATA}/shadow_hand/scene_right.xml")
    if not cube:
        return mujoco.MjModel.from_xml_path(str(path))
    spec = mujoco.MjSpec.from_file(str(path))
    spec.delete(spec.body("object"))
    body = spec.worldbody.add_body(name="cube", pos=(0.33, 0.0, 0.06))
    body.add_freejoint()
    geom = body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=(CUBE,) * 3, mass=CUBE_MASS)
    geom.contype = 7
    return spec.compile()


def _arms(_: Path, *, count: int) -> mujoco.MjModel:
    path = str(found(MENAGERIE, f"{DATA}/actuator/arm26.xml"))
    spec = mujoco.MjSpec.from_file(path)
    for place in range(1, count):
        frame = spec.worldbody.add_frame()
        frame.pos = (0.0, 0.0, place * APART)
        arm = mujoco.MjSpec.from_file(path)
        arm.delete(arm.geom("floor"))
        spec.attach(arm, prefix=f"{place}_", frame=frame)
    return spec.compile()


HANDS = (
    Robot("mjx Shadow hand", partial(_shadow, cube=False), 5, swing=0.5),
    Robot("mjx Shadow hand and cube", partial(_shadow, cube=True), 5, swing=0.5),
    Robot("mjx arm26, 6 muscles", partial(_arms, count=1), 4),
    Robot("eight arm26, 48 muscles", partial(_arms, count=ARMS), 4),
)
