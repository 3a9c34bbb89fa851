"""Reads a legged robot from a file or a MuJoCo model, and refuses what the task cannot walk with."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tightloop.checks import arguments as checks
from tightloop.errors import ArgumentError
from tightloop.files.kinds import instead, kind_of_file
from tightloop.scene.options import Solver
from tightloop.tasks.legged import LeggedModel, LeggedRobot, RobotOptions
from tightloop.tasks.legged_models import drives as gains
from tightloop.tasks.legged_models import legs as chains
from tightloop.tasks.legged_models import mjcf, urdf
from tightloop.tasks.legged_models.drives import Drive
from tightloop.tasks.legged_models.known import KNOWN, driven, known_robot, known_scale
from tightloop.tasks.legged_models.legs import Leg
from tightloop.tasks.legged_models.load import warn_of_load
from tightloop.tasks.legged_models.options import values, with_mirror
from tightloop.tasks.legged_models.pose import Sole, sole
from tightloop.tasks.legged_models.skeleton import Array, Skeleton
from tightloop.tasks.legged_models.standing import standing_pose, with_given

#: A robot starts this share of its legs' reach above the ground.
_GAP = 0.02
#: Effects of an action of 1 on the joints of a quadruped and on those that take a humanoid ahead, on the others of its
#: legs, and on all others [rad].
_SCALE, _ACROSS, _UPPER = 0.3, 0.2, 0.1
#: What a task of so many legs takes, and the task of other robots.
_KINDS = {4: "a quadruped", 2: "a humanoid"}
_TASKS = {2: "HumanoidVelocityFlat", 4: "QuadrupedVelocityFlat"}


def read(task: str, model: Any, *, own: LeggedRobot, count: int, options: RobotOptions, dt: float) -> LeggedRobot:
    """Read a robot.

    Args:
        task: The task, for messages.
        model: A path to URDF or MJCF, a name of `known.KNOWN`, or a model of the package ``mujoco``.
        own: The robot that the task has without a model.
        count: Number of legs.
        options: What replaces what is found.
        dt: Time step [s].

    Raises:
        ArgumentError: There is no such file, it has another number of legs, or an option does not fit it.
        SceneError: The robot cannot be simulated.
        MissingLibrary: It is MJCF, and the package ``mujoco`` is not installed.
    """
    known = model if isinstance(model, str) and model in KNOWN else None
    model, what, is_urdf = _source(task, model)
    spec = None
    if is_urdf:
        source = urdf.source(Path(model).expanduser())
    else:
        spec, source = mjcf.prepare(model, what, dt, Solver(cone="pyramidal", impratio=1.0))
    skeleton = Skeleton(source)
    left_out = chains.small_joints(skeleton) | chains.wheels(skeleton)
    legs = legs_of(what, skeleton, left_out, count)
    in_legs = {joint for leg in legs for joint in leg.joints}
    every = [joint for joint in range(len(skeleton.joints)) if joint not in left_out]
    action = every if count == 2 else sorted(in_legs)
    all_names = [hinge.name for hinge in skeleton.joints]
    if known is not None:
        is_driven = driven(known, all_names)
        action = [joint for joint in action if is_driven[joint]]
    names = [all_names[joint] for joint in action]
    flip = chains.mirror(skeleton, action)
    q = standing_pose(skeleton, legs, action, flip)
    q = with_given(f"{what}: standing", skeleton, legs, q, options.standing)
    warn_of_load(what, skeleton, legs, q)
    soles = [sole(skeleton, leg, q) for leg in legs]
    frames = skeleton.frames(q[None])
    lowest = min(float(skeleton.lowest(skeleton.moves[leg.joints[-1]], frames)[0]) for leg in legs)
    gap = _GAP * legs[0].reach
    all_drives = gains.drives(skeleton, legs, action, q)
    held = {all_names[j]: float(q[j]) for j in range(len(all_names)) if j not in action}
    chosen = _chosen(what, names, [all_drives[joint] for joint in action], options)
    targets = gains.targets(skeleton, soles, action, q, [drive.stiffness for drive in chosen.values()])
    axes = skeleton.axes(q)
    ahead = [names[p] for p, joint in enumerate(action) if joint in in_legs and abs(axes[joint, 1]) > 0.7]
    leg_names = {skeleton.joints[joint].name for joint in in_legs}
    scales = [_SCALE if count == 4 or n in ahead else _ACROSS if n in leg_names else _UPPER for n in names]
    if known is not None:
        scales = known_scale(known, names)
    scale = values(f"{what}: scale", options.scale, names, scales)
    used = list(chosen.values())
    flip = with_mirror(flip, q[action], scale, [drive.stiffness for drive in used], [drive.damping for drive in used])
    same = len({round(foot.radius, 6) for foot in soles}) == 1
    radius = soles[0].radius if same else 0.0
    places = {
        foot: (skeleton.bodies[own_sole.body], _place(skeleton, own_sole, q, radius))
        for foot, own_sole in zip(_feet(count), soles, strict=True)
    }
    common: dict[str, Any] = {
        "name": source.name,
        "base": skeleton.bodies[skeleton.base],
        "joints": tuple(names),
        "standing": tuple(float(q[joint]) for joint in action),
        "targets": tuple(targets.tolist()),
        "height": gap - lowest,
        "hip_height": float(np.mean([leg.hip[2] for leg in legs])) - lowest,
        "mass": skeleton.mass,
        "radius": radius,
        "groups": own.groups,
        "scale": scale,
        "quiet": tuple(name for name in names if name not in ahead) if own.quiet else (),
        "flip": flip,
    }
    free = gains.unlimited(skeleton, legs)
    if spec is None:
        others = {name: all_drives[all_names.index(name)] for name in held}
        return LeggedRobot(
            file=Path(model).expanduser(),
            feet=places,
            stiffness={name: drive.stiffness for name, drive in (chosen | others).items()},
            damping={name: drive.damping for name, drive in (chosen | others).items()},
            armature={name: drive.armature for name, drive in (chosen | others).items()},
            held=held,
            unlimited=tuple(all_names[joint] for joint in sorted(free)),
            **common,
        )
    return _of_spec(
        spec,
        skeleton,
        chosen=chosen,
        every=all_drives,
        held=held,
        feet=places,
        free=free,
        action=action,
        q=q,
        common=common,
    )


def _of_spec(
    spec: Any,
    skeleton: Skeleton,
    *,
    chosen: Mapping[str, Drive],
    every: Sequence[Drive],
    held: Mapping[str, float],
    feet: Mapping[str, tuple[str, tuple[float, float, float]]],
    free: set[int],
    action: Sequence[int],
    q: Array,
    common: Mapping[str, Any],
) -> LeggedModel:
    """The robot of an MjSpec, compiled with its drives."""
    hinges = {hinge.name: hinge for hinge in skeleton.joints}
    unlimited = {skeleton.joints[joint].name for joint in free}
    drives = {hinge.name: drive for hinge, drive in zip(skeleton.joints, every, strict=True)} | dict(chosen)
    sites = {f"{foot}_{common['name']}_sole": place for foot, place in feet.items()}
    lowest = skeleton.lowest(np.ones(len(skeleton.bodies), bool), skeleton.frames(skeleton.zero[None]))
    action_of = {
        name: (
            replace(hinges[name], effort=math.inf) if name in unlimited else hinges[name],
            drive.stiffness,
            drive.damping,
        )
        for name, drive in chosen.items()
    }
    model = mjcf.finish(
        spec,
        skeleton.source.what,
        action=action_of,
        held={
            name: (position, drives[name].stiffness, drives[name].damping + hinges[name].damping)
            for name, position in held.items()
        },
        armatures={name: drives[name].armature for name, hinge in hinges.items() if not hinge.armature},
        feet=sites,
        base=(common["base"], 0.01 - float(lowest[0])),
    )
    start = skeleton.state(q)
    start[2] = common["height"]
    columns = skeleton.columns
    ranges = [(columns[joint], skeleton.joints[joint].low, skeleton.joints[joint].high) for joint in action]
    return LeggedModel(
        file=Path(skeleton.source.what.rpartition(": ")[2]),
        feet=sites,
        stiffness={name: drive.stiffness for name, drive in chosen.items()},
        damping={name: drive.damping for name, drive in chosen.items()},
        held=held,
        model=model,
        start_q=start,
        ranges=np.array(ranges),
        **common,
    )


def _source(task: str, model: Any) -> tuple[Any, str, bool]:
    """The model or its path, what it is called in messages, and whether it is URDF."""
    if isinstance(model, str) and model in KNOWN:
        return known_robot(task, model), f"{task}: {model}", False
    if not isinstance(model, str | os.PathLike):
        kind = type(model).__name__
        if kind not in ("MjSpec", "MjModel"):
            raise ArgumentError(
                f"{task}: model is {kind}; give the path of a URDF or MJCF file, an mujoco.MjSpec or an mujoco.MjModel"
            )
        return model, f"{task}: {kind}", False
    # Path("") is the working directory
    if not str(model):
        raise ArgumentError(f"{task}: model is empty; give the path of a URDF or MJCF file")
    path = checks.path(f"{task}: model", model)
    if not path.is_file():
        problem = "is a folder" if path.is_dir() else "does not exist"
        names = " or ".join(KNOWN)
        raise ArgumentError(f"{task}: model: {path} {problem}; give the path of a URDF or MJCF file, or {names}")
    kind = kind_of_file(path)
    if kind not in ("robot", "mujoco"):
        wrong = instead(f"{task}: model", path, "robot") or f"{task}: model: {path.name} is neither URDF nor MJCF"
        raise ArgumentError(f"{wrong.partition(': scene')[0]}; give the path of a URDF or MJCF file")
    return model, f"{task}: {path.name}", kind == "robot"


def legs_of(what: str, skeleton: Skeleton, left_out: set[int], count: int) -> list[Leg]:
    """Return the legs, from front left to rear right."""
    found = chains.find(skeleton, left_out)
    legs = chains.alike(found, count)
    if len(legs) != count:
        ends = ", ".join(skeleton.bodies[leg.foot] for leg in found)
        seen = (
            f"{len(found)} chains of joints that reach the ground: {ends}"
            if found
            else "no leg that reaches the ground"
        )
        other = f", or to {_TASKS[len(found)]}" if len(found) in _TASKS else ""
        solids = "" if skeleton.solids else "; it has no collision shapes, which feet need"
        raise ArgumentError(
            f"{what} has {seen}{solids}; give {_KINDS[count]}, upright and facing along x{other and ', or give it'}"
            f"{other.removeprefix(', or')}"
        )
    feet = [skeleton.frames(skeleton.neutral[None])[0][0, leg.foot] for leg in legs]
    ranks = sorted(range(count), key=lambda leg: feet[leg][0], reverse=True)
    pairs = [ranks[:2], ranks[2:]] if count == 4 else [ranks]
    order = [leg for pair in pairs for leg in sorted(pair, key=lambda leg: feet[leg][1], reverse=True)]
    if any(feet[left][1] <= feet[right][1] for left, right in zip(order[::2], order[1::2], strict=True)):
        raise ArgumentError(f"{what}: its legs are not left and right of one another; let it face along x, with z up")
    return [legs[leg] for leg in order]


def _feet(count: int) -> tuple[str, ...]:
    return ("FL", "FR", "RL", "RR") if count == 4 else ("left", "right")


def _place(skeleton: Skeleton, foot: Sole, q: Array, radius: float) -> tuple[float, float, float]:
    """Place of a site in its body, ``radius`` above the ground."""
    turn = skeleton.frames(q[None])[1][0, foot.body]
    place = foot.place - (foot.radius - radius) * turn.T[:, 2]
    return float(place[0]), float(place[1]), float(place[2])


def _chosen(what: str, names: Sequence[str], found: Sequence[Drive], options: RobotOptions) -> dict[str, Drive]:
    """The drives of the action's joints, with those gains that the user gave."""
    stiffness = values(f"{what}: stiffness", options.stiffness, names, [drive.stiffness for drive in found])
    damping = values(f"{what}: damping", options.damping, names, [drive.damping for drive in found])
    return {
        name: Drive(ke, kd, drive.armature)
        for name, ke, kd, drive in zip(names, stiffness, damping, found, strict=True)
    }
