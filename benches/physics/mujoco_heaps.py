"""Legged robots that fall and lie on a plane, for benches/physics/mujoco_models.py.

Needs MuJoCo and NumPy only, because the process of mjbatch has its own MuJoCo and reads the models here too.

- pybullet's A1, Laikago and Mini Cheetah: the URDF files of its wheel as MuJoCo reads them, with collision geometry
  alone. The A1 has boxes, cylinders and spheres. The others have spheres and meshes, which collide as convex hulls.
  Stiffness and damping of the actuators grow with the robot's mass. Joints of the Laikago and the Mini Cheetah have no
  limits in their files and get none here, only a range for their targets.
- mjlab's Go1 and G1 with ``FULL_COLLISION``, their actuators and their joint limits. Feet of the Go1 have condim 6.

Every robot starts in the middle of its joints' ranges, `DROP` above the plane. Its targets swing about that posture.
MuJoCo lets no body collide with its parent; here, bodies that overlap at the start do not collide either. The hulls of
the Laikago's chassis and of its legs overlap by up to 9 cm there, those of the Mini Cheetah's body and front thighs by
2 cm. The other robots' bodies are apart.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import mujoco
import numpy as np
from mjlab_robots import full_g1, full_go1
from mujoco_files import PUBLISHED, Robot, found

# Free height below the lowest geom at the start, and a height for the robot's base at which it touches nothing [m]
DROP, ALOFT = 0.5, 5.0
# Position actuators per mass of the robot [N·m/rad/kg], [N·m·s/rad/kg]; rotors [kg·m²]
STIFFNESS, DAMPING, ARMATURE = 5.0, 1 / 6, 0.01
# Physics [s], [–], and steps per control step of 1/60 s
STEP, ITERATIONS, LINE_SEARCH, TOLERANCE, SUBSTEPS = 1 / 480, 20, 50, 1e-8, 8
# Largest amplitude of a target, as a part of half of the joint's range [–]
SWING = 0.5
# Targets of one leg's hip, thigh and knee [rad]: of the Laikago as laikago_toes_limits.urdf of its folder has them, of
# the Mini Cheetah so that they swing about a stance with the thigh back and the knee bent
LAIKAGO_RANGES = ((-0.873, 1.0472), (-1.3, 3.4), (-2.164, 0.0))
MINI_CHEETAH_RANGES = ((-0.8, 0.8), (-1.8, 0.2), (0.6, 2.6))
Ranges = tuple[tuple[float, float], ...]
# Name of the row, cone, impratio
SETTINGS = (
    ("pyramidal", mujoco.mjtCone.mjCONE_PYRAMIDAL, 1.0),
    ("elliptic 1000", mujoco.mjtCone.mjCONE_ELLIPTIC, 1000.0),
)


def _urdf(file: str, ranges: Ranges = ()) -> mujoco.MjSpec:
    """A floating robot of pybullet's wheel with a position actuator on each joint, above a plane.

    Args:
        file: Its path in `pybullet_data`.
        ranges: Ranges of the targets of a leg's joints, where joints have no limits; legs come one after another.
    """
    path = found(PUBLISHED, f"pybullet/pybullet_data/{file}")
    text = path.read_text()
    head = text.index(">", text.index("<robot")) + 1
    # the Mini Cheetah's thighs have inertias that no body can have
    compiler = f'<compiler fusestatic="true" discardvisual="true" balanceinertia="true" meshdir="{path.parent}"/>'
    spec = mujoco.MjSpec.from_string(f"{text[:head]}<mujoco>{compiler}</mujoco>{text[head:]}")
    joints = spec.joints
    spec.worldbody.first_body().add_freejoint(name="base")
    # a copy, because MuJoCo 3.14 loses the mass of fused bodies when it compiles a spec again
    mass = spec.copy().compile().body_mass.sum()
    for index, joint in enumerate(joints):
        joint.armature = ARMATURE
        actuator = spec.add_actuator(name=joint.name, target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        actuator.gaintype, actuator.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
        actuator.gainprm[0], actuator.biasprm[:3] = mass * STIFFNESS, (0, -mass * STIFFNESS, -mass * DAMPING)
        actuator.ctrlrange = ranges[index % len(ranges)] if ranges else joint.range
    spec.worldbody.add_geom(name="terrain", type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0, 0, 0.01))
    return spec


def _mjlab(full: Callable[[], mujoco.MjSpec]) -> mujoco.MjSpec:
    """A robot of mjlab, whose targets stay in the joints' ranges."""
    spec = full()
    for actuator in spec.actuators:
        actuator.ctrlrange = spec.joint(actuator.target).range
    return spec


def _heap(read: Callable[[], mujoco.MjSpec], cone: mujoco.mjtCone, impratio: float, _: Path) -> mujoco.MjModel:
    """A floating robot at its keyframe `drop`, without contacts between bodies that overlap there."""
    spec = read()
    option = spec.option
    option.timestep, option.integrator = STEP, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.solver, option.iterations, option.ls_iterations = mujoco.mjtSolver.mjSOL_NEWTON, ITERATIONS, LINE_SEARCH
    option.tolerance, option.cone, option.impratio = TOLERANCE, cone, impratio
    spec.add_key(name="drop")
    model = spec.copy().compile()
    data = _aloft(model)
    geoms = {tuple(sorted(contact.geom)) for contact in data.contact}
    for first, second in sorted({tuple(model.geom_bodyid[list(pair)]) for pair in geoms}):
        spec.add_exclude(bodyname1=model.body(first).name, bodyname2=model.body(second).name)
    model = spec.compile()
    drop = model.key("drop")
    drop.qpos[:], drop.ctrl[:] = data.qpos, data.ctrl
    drop.qpos[2] += DROP - _lowest(model, data)
    return model


def _aloft(model: mujoco.MjModel) -> mujoco.MjData:
    """The robot high above the plane, its joints in the middle of their targets' ranges."""
    data = mujoco.MjData(model)
    data.ctrl[:] = model.actuator_ctrlrange.mean(axis=1)
    data.qpos[model.jnt_qposadr[model.actuator_trnid[:, 0]]] = data.ctrl
    data.qpos[:7] = (0, 0, ALOFT, 1, 0, 0, 0)
    mujoco.mj_forward(model, data)
    return data


def _lowest(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Lower end of the boxes about the robot's colliding geoms [m]."""
    moving = (model.geom_bodyid > 0) & ((model.geom_contype | model.geom_conaffinity) > 0)
    rows = data.geom_xmat.reshape(-1, 3, 3)[moving, 2]
    center, half = model.geom_aabb[moving, :3], model.geom_aabb[moving, 3:]
    heights = data.geom_xpos[moving, 2] + np.sum(rows * center - np.abs(rows) * half, axis=1)
    return float(heights.min())


READERS: dict[str, Callable[[], mujoco.MjSpec]] = {
    "a1": partial(_urdf, "a1/a1.urdf"),
    "laikago": partial(_urdf, "laikago/laikago_toes_zup.urdf", LAIKAGO_RANGES),
    "mini cheetah": partial(_urdf, "mini_cheetah/mini_cheetah.urdf", MINI_CHEETAH_RANGES),
    "mjlab Go1": partial(_mjlab, full_go1),
    "mjlab G1": partial(_mjlab, full_g1),
}
HEAPS = tuple(
    Robot(f"{name} heap, {setting}", partial(_heap, read, cone, impratio), SUBSTEPS, "drop", SWING)
    for name, read in READERS.items()
    for setting, cone, impratio in SETTINGS
)
