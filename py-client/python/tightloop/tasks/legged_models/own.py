"""Options replace single properties of the robot that a task declares."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tightloop.tasks.legged import ByJoint, LeggedRobot, RobotOptions
from tightloop.tasks.legged_models import legs as chains
from tightloop.tasks.legged_models import urdf
from tightloop.tasks.legged_models.drives import targets
from tightloop.tasks.legged_models.load import warn_of_load
from tightloop.tasks.legged_models.options import values, with_mirror
from tightloop.tasks.legged_models.pose import sole
from tightloop.tasks.legged_models.read import legs_of
from tightloop.tasks.legged_models.skeleton import Skeleton
from tightloop.tasks.legged_models.standing import with_given


def replaced(task: str, own: LeggedRobot, *, count: int, options: RobotOptions) -> LeggedRobot:
    """Return a task's own robot from URDF with other properties, and all else as it is declared.

    Args:
        task: The task, for messages.
        own: Its robot.
        count: Number of legs.
        options: What replaces its properties.

    Raises:
        ArgumentError: An option does not fit the robot.
    """
    what = f"{task}: {own.file.name}"
    scales = np.broadcast_to(np.asarray(own.scale, float), (len(own.joints),)).tolist()
    changed: dict[str, Any] = {}
    if options.stiffness is not None:
        changed["stiffness"] = _gains(f"{what}: stiffness", options.stiffness, own, own.stiffness)
    if options.damping is not None:
        changed["damping"] = _gains(f"{what}: damping", options.damping, own, own.damping)
    if options.scale is not None:
        changed["scale"] = values(f"{what}: scale", options.scale, own.joints, scales)
    robot = replace(own, **changed)
    # an empty one changes nothing
    if options.standing is not None and options.standing != {}:
        robot = _stood(what, robot, count, options.standing)
    alike = [np.broadcast_to(np.asarray(robot.scale, float), (len(own.joints),))]
    alike += [_of_joints(gains, own.joints) for gains in (robot.stiffness, robot.damping)]
    return replace(robot, flip=with_mirror(own.flip, robot.standing, *alike))


def _gains(what: str, given: ByJoint, own: LeggedRobot, declared: ByJoint) -> dict[str, float]:
    """Gains of all joints by name: those of the action's joints may be given."""
    chosen = values(what, given, own.joints, _of_joints(declared, own.joints))
    held = dict(zip(own.held, _of_joints(declared, [*own.held]), strict=True))
    return held | dict(zip(own.joints, chosen, strict=True))


def _of_joints(declared: ByJoint, joints: Sequence[str]) -> list[float]:
    """A property of each joint; 0 where it has none."""
    if not isinstance(declared, Mapping):
        return [float(declared)] * len(joints)
    matched = {joint: value for name, value in declared.items() for joint in joints if re.fullmatch(name, joint)}
    return [float(declared.get(joint, matched.get(joint, 0.0))) for joint in joints]


def _stood(what: str, own: LeggedRobot, count: int, standing: Mapping[str, float]) -> LeggedRobot:
    """The robot in a pose with given joints, targets that hold it, and the heights at which it stands."""
    skeleton = Skeleton(urdf.source(own.file))
    legs = legs_of(what, skeleton, chains.small_joints(skeleton) | chains.wheels(skeleton), count)
    names = [hinge.name for hinge in skeleton.joints]
    before = skeleton.neutral.copy()
    for name, value in (dict(zip(own.joints, own.standing, strict=True)) | dict(own.held)).items():
        if name in names:
            before[names.index(name)] = value
    q = with_given(f"{what}: standing", skeleton, legs, before, standing)
    frames = skeleton.frames(np.stack([before, q]))
    ground = np.min([skeleton.lowest(skeleton.moves[leg.joints[-1]], frames) for leg in legs], axis=0)
    sunk = float(ground[0] - ground[1])
    pose = dict(zip(names, q.tolist(), strict=True))
    action = [names.index(joint) for joint in own.joints]
    warn_of_load(what, skeleton, legs, q)
    soles = [sole(skeleton, leg, q) for leg in legs]
    return replace(
        own,
        standing=tuple(pose[joint] for joint in own.joints),
        targets=tuple(targets(skeleton, soles, action, q, _of_joints(own.stiffness, own.joints)).tolist()),
        held={name: pose.get(name, value) for name, value in own.held.items()},
        height=own.height + sunk,
        hip_height=own.hip_height + sunk,
    )
