"""What a program needs to know of a task to run its policy elsewhere, for the file of the policy.

Values are texts, and lists are joined by commas, as in the ``metadata_props`` of ONNX. Names that the exporters of
mjlab and Isaac Lab write too have the same meaning: ``joint_names``, ``joint_stiffness``, ``joint_damping``,
``default_joint_pos``, ``observation_names``, ``command_names``, ``action_scale``.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.spaces import Box

import tightloop as tl
from tightloop.env.commands import Commands
from tightloop.env.controls import Control
from tightloop.env.evaluation.observations import ObservationPacker
from tightloop.env.names import Names
from tightloop.env.observed import Observed
from tightloop.env.registry import controls_of, name_of
from tightloop.env.task import Task, observed_parts
from tightloop.env.task_checks import scene_of
from tightloop.env.vector import VectorEnv
from tightloop.errors import ArgumentError
from tightloop.planning.policies import DRIVES, TERMS
from tightloop.planning.policy_terms import to_text


def policy_metadata(envs: VectorEnv) -> dict[str, str]:
    """Return what a program needs to know of a task to run its policy elsewhere, by name.

    Values are texts, and lists are joined by commas; a comma within an entry becomes a semicolon. If there is only one
    robot, names of joints are those of its file, else ``robot/joint``. Joints of several coordinates are left out.
    `Task.policy_metadata` adds entries, or replaces some.

    Args:
        envs: An environment of the task.

    Raises:
        ArgumentError: ``envs`` is no `VectorEnv`, or a value of `Task.policy_metadata` is neither text nor a number nor
            a list of these.
    """
    if not isinstance(getattr(envs, "task", None), Task):
        raise ArgumentError(f"policy_metadata: envs is {envs!r:.80}; give a tightloop.env.VectorEnv")
    # controls are bound below, and those of the environment must stay as they are
    task = copy.deepcopy(envs.task)
    scene, names = scene_of(task), Names(envs.sim.info)
    controls, commands = controls_of(task), Commands(scene, names, 1)
    for control in controls:
        control.bind(names, commands)
    # the robot's name says nothing where there is only one
    robots = [*scene.robots, *scene.models]
    alone = f"{robots[0]}/" if len(robots) == 1 else ""
    parts, space = observed_parts(task), envs.single_action_space
    assert isinstance(space, Box)
    # also where the observations of the environment are dicts
    seen = ObservationPacker(parts, task.dtype).space
    facts: dict[str, Any] = {
        "task": name_of(task),
        "tightloop_version": tl.__version__,
        "dt": scene.dt,
        "substeps": scene.substeps,
        "control_dt": envs.control_dt,
        "observation_names": [part.name for part in parts],
        "observation_sizes": [part.size for part in parts],
        "observation_shapes": ["x".join(map(str, part.shape or (part.size,))) for part in parts],
        "observation_history": [part.history for part in parts],
        "observation_units": [part.unit for part in parts],
        "observation_low": seen.low,
        "observation_high": seen.high,
        "action_names": [name.removeprefix(alone) for name in _joined(controls, "value_names")],
        "action_types": [type(control).__name__ for control in controls for _ in range(control.size)],
        "action_scale": _joined(controls, "scales"),
        "action_offset": _joined(controls, "offsets"),
        "action_lead": [getattr(control, "lead", np.inf) for control in controls for _ in range(control.size)],
        "action_low": space.low,
        "action_high": space.high,
    }
    facts |= _joints(scene, names, alone) | _for_rollouts(parts, controls)
    facts |= task.policy_metadata()
    return {name: _text(f"{type(task).__name__}.policy_metadata: {name}", value) for name, value in facts.items()}


def _for_rollouts(parts: Sequence[Observed], controls: Sequence[Control]) -> dict[str, str]:
    """Return what `Sim.rollout` needs to run the policy in the daemon, as far as the task says it."""
    terms, drives = [part.term for part in parts], [getattr(control, "drive", None) for control in controls]
    known = {TERMS: terms, DRIVES: drives}
    return {key: to_text([part for part in own if part]) for key, own in known.items() if None not in own}


def _joints(scene: tl.Scene, names: Names, alone: str) -> dict[str, Any]:
    """Return the joints with one coordinate, in the order of frames; for robots from URDF with drives and start."""
    found: dict[str, list[Any]] = {"joint_names": [n for n in names.dof_names if names.has_coord(n)]}
    if not scene.models:
        found["robot_files"] = [robot.urdf.name for robot in scene.robots.values()]
        for name in found["joint_names"]:
            robot_name, _, joint = name.partition("/")
            robot = scene.robots[robot_name]
            dof = robot.dof_names.index(joint)
            for key, attribute in _PROPERTIES.items():
                found.setdefault(key, []).append(getattr(robot, attribute)[dof])
            coord = robot.coord_names.index(robot.dof_names[dof])
            found.setdefault("default_joint_pos", []).append(robot.joint_q[coord])
    return found | {"joint_names": [name.removeprefix(alone) for name in found["joint_names"]]}


#: Properties of a robot, by the name that they have in the metadata.
_PROPERTIES = {
    "joint_stiffness": "joint_target_ke",
    "joint_damping": "joint_target_kd",
    "joint_effort_limit": "joint_effort_limit",
    "joint_armature": "joint_armature",
}


def _joined(controls: Sequence[Control], name: str) -> list[Any]:
    """Return an attribute of each value of the action; of a control without it ``unknown``."""
    return [value for control in controls for value in getattr(control, name, ["unknown"] * control.size)]


def _text(what: str, value: object) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, np.ndarray):
        # a value of float32 has no more digits than it needs
        value = value[()] if value.ndim == 0 else [*value]
    if isinstance(value, bool | int | float | np.number | np.bool_):
        return str(value)
    if isinstance(value, list | tuple):
        return ",".join(_text(what, entry).replace(",", ";") for entry in value)
    raise ArgumentError(f"{what} is {value!r:.80}; give a text, a number, or a list of these")
