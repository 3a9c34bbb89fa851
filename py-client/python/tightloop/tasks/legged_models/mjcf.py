"""Legged robots from MuJoCo's MJCF: their own model, alone in its world, with position actuators."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np

import tightloop as tl
from tightloop.errors import ArgumentError, SceneError
from tightloop.mujoco import export, reflected
from tightloop.scene.options import Solver
from tightloop.tasks.legged_models.skeleton import Hinge, Source

#: Name of the model in its scenes.
NAME = "robot"
#: Keyframes that are tried first.
_STANDING = ("home", "stand", "standing", "default")


def prepare(model: Any, what: str, dt: float, solver: Solver) -> tuple[Any, Source]:
    """Return a model's MjSpec with the robot alone, without actuators, and what it has.

    Args:
        model: A path, an MjSpec or an MjModel.
        what: What it is called in messages.
        dt: Time step [s].
        solver: Options of the constraint solver.

    Raises:
        ArgumentError: The model's base is not free to move.
        SceneError: MuJoCo cannot compile it.
    """
    whole, spec = _spec(model)
    mujoco: Any = import_module("mujoco")

    for kind, elements in (("body", spec.bodies), ("joint", spec.joints), ("geom", spec.geoms)):
        for place, element in enumerate(elements):
            element.name = element.name or f"{kind}_{place}"
    hinges, poses = _hinges(whole, spec), _poses(whole, spec)
    robot = _alone(spec, what)
    own = {joint.name for joint in robot.find_all("joint")}
    free = [joint for joint in robot.joints if joint.type == mujoco.mjtJoint.mjJNT_FREE]
    if not free:
        if robot.joints:
            names = ", ".join(joint.name for joint in robot.joints)
            raise ArgumentError(
                f"{what}: its base `{robot.name}` moves by {names}, not freely; give it a <freejoint/> instead"
            )
        robot.add_freejoint(name="floating_base")
    robot.pos, robot.quat = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
    option = spec.option
    option.timestep, option.integrator = dt, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.gravity = (0.0, 0.0, -9.81)
    option.solver, option.cone = mujoco.mjtSolver.mjSOL_NEWTON, mujoco.mjtCone.mjCONE_PYRAMIDAL
    option.impratio, option.noslip_iterations = solver.impratio, 0
    option.iterations, option.ls_iterations, option.tolerance = (
        solver.iterations,
        solver.ls_iterations,
        solver.tolerance,
    )
    compiled = compile_spec(spec, what)
    scene = tl.Scene.from_mujoco(compiled, name=NAME)
    masses = {
        body: (float(compiled.body(body).mass[0]), np.array(compiled.body(body).ipos))
        for body in (compiled.body(place).name for place in range(1, compiled.nbody))
    }
    return spec, Source(what, scene, NAME, [hinge for hinge in hinges if hinge.name in own], masses, {}, poses)


def compile_spec(spec: Any, what: str) -> Any:
    """Compile an MjSpec.

    Raises:
        SceneError: MuJoCo cannot; the message is MuJoCo's.
    """
    try:
        return spec.compile()
    except (ValueError, RuntimeError) as error:
        raise SceneError(f"{what}: MuJoCo cannot compile the robot alone: {error}") from error


def finish(
    spec: Any,
    what: str,
    *,
    action: Mapping[str, tuple[Hinge, float, float]],
    held: Mapping[str, tuple[float, float, float]],
    armatures: Mapping[str, float],
    feet: Mapping[str, tuple[str, Any]],
    base: tuple[str, float],
) -> Any:
    """Add actuators, springs and sites, and compile.

    Args:
        spec: The robot alone.
        what: What it is called in messages.
        action: Joints with an actuator, in its order: the joint, its stiffness and its damping.
        held: Joints with a spring: its position, stiffness and damping.
        armatures: Armature of joints that have none.
        feet: Body and place of each site.
        base: The base, and its height above the ground at the positions of the file [m].
    """
    mujoco: Any = import_module("mujoco")

    spec.body(base[0]).pos = (0.0, 0.0, base[1])
    # MuJoCo brings keyframes back when it compiles
    for key in [*spec.keys]:
        spec.delete(key)
    for name, (hinge, stiffness, damping) in action.items():
        actuator = spec.add_actuator(name=name)
        actuator.trntype, actuator.target = mujoco.mjtTrn.mjTRN_JOINT, name
        actuator.dyntype = mujoco.mjtDyn.mjDYN_NONE
        actuator.gaintype, actuator.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
        actuator.gainprm[:3], actuator.biasprm[:3] = (stiffness, 0.0, 0.0), (0.0, -stiffness, -damping)
        actuator.gear[:] = (1, 0, 0, 0, 0, 0)
        actuator.actlimited = False
        actuator.ctrllimited = math.isfinite(hinge.high)
        actuator.ctrlrange = (hinge.low, hinge.high) if math.isfinite(hinge.high) else (0.0, 0.0)
        actuator.forcelimited = math.isfinite(hinge.effort)
        actuator.forcerange = (-hinge.effort, hinge.effort) if math.isfinite(hinge.effort) else (0.0, 0.0)
    for name, (position, stiffness, damping) in held.items():
        joint = spec.joint(name)
        joint.stiffness[:], joint.damping[:] = (stiffness, 0.0, 0.0), (damping, 0.0, 0.0)
        joint.springref = position
    for name, armature in armatures.items():
        spec.joint(name).armature = armature
    for name, (body, place) in feet.items():
        spec.body(body).add_site(name=name, pos=place)
    return compile_spec(spec, what)


def _spec(model: Any) -> tuple[Any, Any]:
    """The model as it is, compiled, and an MjSpec of it to change."""
    whole = export.compiled(model)
    mujoco: Any = import_module("mujoco")

    if isinstance(model, mujoco.MjSpec):
        return whole, model.copy()
    if isinstance(model, mujoco.MjModel):
        from tightloop.tasks.legged_models.rebuilt import rebuilt

        return whole, rebuilt(model)
    return whole, mujoco.MjSpec.from_file(str(model))


def _alone(spec: Any, what: str) -> Any:
    """The body of the world with most joints; all else in the world goes."""
    bodies = list(spec.worldbody.bodies)
    counts = [len(body.find_all("joint")) for body in bodies]
    if not bodies or max(counts) == 0:
        raise ArgumentError(f"{what}: it has no joints; give the model of a robot")
    robot = bodies[counts.index(max(counts))]
    _keep_shares(spec)
    # what may name something that goes
    for element in [*spec.keys, *spec.sensors, *spec.actuators, *spec.cameras, *spec.lights]:
        spec.delete(element)
    scenery = {geom.name for geom in spec.worldbody.geoms}
    for pair in list(spec.pairs):
        ends = {pair.geomname1, pair.geomname2}
        if ends & scenery:
            # the feet of some models touch by such pairs alone
            for name in ends - scenery:
                spec.geom(name).contype |= 1
            spec.delete(pair)
    for element in [*spec.worldbody.geoms, *(body for body in bodies if body is not robot)]:
        spec.delete(element)
    return robot


def _keep_shares(spec: Any) -> None:
    """Give joints the armature and damping that their actuators, which go, add to them."""
    mujoco: Any = import_module("mujoco")

    joints = {joint.name: joint for joint in spec.joints}
    kinds = (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)
    for actuator in spec.actuators:
        # older versions of MuJoCo have no such actuators
        if actuator.trntype not in kinds or not hasattr(actuator, "armature"):
            continue
        joint, square = joints[actuator.target], float(actuator.gear[0]) ** 2
        joint.armature += square * actuator.armature
        joint.damping[:] = np.add(joint.damping, square * np.asarray(actuator.damping))


def _hinges(model: Any, spec: Any) -> list[Hinge]:
    """The hinge joints of the whole model."""
    mujoco: Any = import_module("mujoco")

    found: dict[str, Hinge] = {}
    shares = reflected.shares(model)
    for place, joint in enumerate(spec.joints):
        if model.jnt_type[place] != mujoco.mjtJoint.mjJNT_HINGE:
            continue
        dof = model.jnt_dofadr[place]
        low, high = model.jnt_range[place] if model.jnt_limited[place] else (-math.inf, math.inf)
        effort = float(model.jnt_actfrcrange[place, 1]) if model.jnt_actfrclimited[place] else math.inf
        armature, damping = (float(share) for share in (shares[0][dof], shares[1][dof, 0]))
        armature, damping = armature + float(model.dof_armature[dof]), damping + float(model.dof_damping[dof])
        found[joint.name] = Hinge(joint.name, float(low), float(high), effort, armature, damping)
    names = list(found)
    by_place = {place: joint.name for place, joint in enumerate(spec.joints) if joint.name in found}
    for actuator in range(model.nu):
        if model.actuator_trntype[actuator] != mujoco.mjtTrn.mjTRN_JOINT:
            continue
        name = by_place.get(int(model.actuator_trnid[actuator, 0]))
        if name in names:
            hinge = found[name]
            effort = min(hinge.effort, _effort(model, actuator))
            found[name] = replace(hinge, effort=effort, gains=_gains(model, actuator, hinge.damping))
    return list(found.values())


def _effort(model: Any, actuator: int) -> float:
    """Largest torque of an actuator [N·m]."""
    mujoco: Any = import_module("mujoco")

    gear = abs(float(model.actuator_gear[actuator, 0]))
    if model.actuator_forcelimited[actuator]:
        return gear * float(np.abs(model.actuator_forcerange[actuator]).max())
    is_motor = model.actuator_biastype[actuator] == mujoco.mjtBias.mjBIAS_NONE
    if is_motor and model.actuator_ctrllimited[actuator]:
        gain = abs(float(model.actuator_gainprm[actuator, 0]))
        return gear * gain * float(np.abs(model.actuator_ctrlrange[actuator]).max()) or math.inf
    return math.inf


def _gains(model: Any, actuator: int, damping: float) -> tuple[float, float] | None:
    """Stiffness and damping of a position actuator; None for another one, or for one that nothing damps."""
    mujoco: Any = import_module("mujoco")

    stiffness, bias = float(model.actuator_gainprm[actuator, 0]), model.actuator_biasprm[actuator]
    is_position = (
        model.actuator_gaintype[actuator] == mujoco.mjtGain.mjGAIN_FIXED
        and model.actuator_biastype[actuator] == mujoco.mjtBias.mjBIAS_AFFINE
        and model.actuator_dyntype[actuator] == mujoco.mjtDyn.mjDYN_NONE
        and stiffness > 0.0
        and bias[1] == -stiffness
        and model.actuator_gear[actuator, 0] == 1.0
    )
    own = -float(bias[2])
    return (stiffness, own) if is_position and own + damping > 0.0 else None


def _poses(model: Any, spec: Any) -> list[dict[str, float]]:
    """Positions of the hinge joints in the keyframes, those that are called after standing first."""
    mujoco: Any = import_module("mujoco")

    found = []
    for key in range(model.nkey):
        name, positions = model.key(key).name.lower(), model.key_qpos[key]
        pose = {
            joint.name: float(positions[model.jnt_qposadr[place]])
            for place, joint in enumerate(spec.joints)
            if model.jnt_type[place] == mujoco.mjtJoint.mjJNT_HINGE
        }
        ranks = [place for place, known in enumerate(_STANDING) if known in name]
        found.append((min(ranks, default=len(_STANDING)), key, pose))
    return [pose for _, _, pose in sorted(found, key=lambda entry: entry[:2])]
