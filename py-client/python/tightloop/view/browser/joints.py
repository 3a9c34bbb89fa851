"""The driven joints of a scene: their limits, and the pose of a robot at its joint targets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.scene.scene import Scene
from tightloop.view.poses import Array

# Range of a slider for a joint without limits [rad or m].
_UNLIMITED = np.pi


@dataclass(frozen=True)
class Joint:
    """A dof with a drive.

    Attributes:
        dof: Index in ``dof_names``.
        name: ``robot/joint``, or ``robot/joint.part`` where a joint has several.
        lower: Smallest target that a slider sets [rad or m].
        upper: Largest target [rad or m].
        follows: Leader of a mimic joint, or None.
    """

    dof: int
    name: str
    lower: float
    upper: float
    follows: str | None = None


def joints(info: dict[str, Any]) -> list[Joint]:
    """Return the dofs whose targets have an effect, from a daemon's description of itself.

    Raises:
        SceneError: A robot's file cannot be read here.
    """
    found = []
    for name, robot in _scene(info).robots.items():
        first = next(entry["dofs"][0] for entry in info["robots"] if entry["name"] == name)
        leaders = robot.joint_leaders
        for index, (own, (lower, upper)) in enumerate(zip(robot.dof_names, robot.joint_range, strict=True)):
            if robot.joint_target_ke[index] <= 0:
                continue
            low = max(float(lower), -_UNLIMITED) if np.isfinite(lower) else -_UNLIMITED
            high = float(upper) if np.isfinite(upper) else _UNLIMITED
            found.append(Joint(first + index, f"{name}/{own}", low, high, leaders.get(own)))
    return found


def at_targets(info: dict[str, Any], driven: Sequence[Joint], joint_q: Array, targets: Array) -> NDArray[np.float64]:
    """Return the joint positions of a world with its driven joints at their targets.

    Args:
        info: A daemon's description of itself, ``sim.info``.
        driven: The driven joints.
        joint_q: Current positions, shape ``(coords,)``.
        targets: ``joint_target_q`` of the world, shape ``(dofs,)``.
    """
    place = {name: index for index, name in enumerate(info["coord_names"])}
    reached = np.array(joint_q, np.float64)
    balls: dict[str, list[int]] = {}
    for joint in driven:
        if joint.name in place:
            reached[place[joint.name]] = targets[joint.dof]
        else:
            balls.setdefault(joint.name.rpartition(".")[0], []).append(joint.dof)
    # the target of a ball joint is a rotation vector, its coordinates are a quaternion
    for ball, dofs in balls.items():
        first = place.get(f"{ball}.qx")
        if first is not None and len(dofs) == 3:
            vector = np.asarray(targets[dofs], np.float64)
            angle = np.linalg.norm(vector)
            reached[first : first + 3] = vector * np.sinc(angle / (2 * np.pi)) / 2
            reached[first + 3] = np.cos(angle / 2)
    return reached


def _scene(info: dict[str, Any]) -> Scene:
    return Scene.from_toml(info["scene"], info["scene_folder"])
