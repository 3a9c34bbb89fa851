"""The demo of a file of the user's: a robot, a MuJoCo model or a scene, whose joints follow waves."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import tightloop as tl
from tightloop.demo.scenes import LaunchedScene
from tightloop.files.scenes import scene_of
from tightloop.mujoco.model import MujocoModel

# Part of a joint's range that its target crosses, and of one without limits [rad or m]
_SHARE, _FREE = 0.25, 0.5
# Length of a wave [s], and of a round
_PERIOD, _SECONDS = 4.0, 6.0


class FileScene(LaunchedScene):
    """Worlds of a file; each follows a wave of its own phase."""

    shown = 16

    def __init__(self, path: Path, worlds: int) -> None:
        """Read the file.

        Raises:
            SceneError: It cannot be used.
        """
        super().__init__(worlds)
        self.name, self.title = path.stem, f"worlds of {path.name}, which follow waves"
        self._scene = scene_of(path)
        still = _powerless(self._scene)
        if still:
            self.title = f"worlds of {path.name}{still}"
        self._ranges = {name: _controls(model) for name, model in self._scene.models.items()}
        self.frames = max(round(_SECONDS / (self._scene.dt * self._scene.substeps)), 1)

    def scene(self) -> tl.Scene:
        return self._scene

    def restart(self) -> None:
        self.frame = self.sim.reset()
        self._phases = np.linspace(0.0, 2.0 * np.pi, self.worlds, endpoint=False)[:, None]
        self._faulted = 0

    def step(self, frame: int) -> None:
        time = frame * self.sim.dt * self.sim.substeps
        # waves begin at 0, so that no target jumps
        wave = np.sin(2.0 * np.pi * time / _PERIOD + self._phases) * min(time, 1.0)
        commands = {}
        for name, robot in self._scene.robots.items():
            low, high = robot.joint_range.T
            reach = np.where(np.isfinite(high - low), _SHARE * (high - low) / 2, _FREE) * robot.dof_driven
            target = np.clip(robot.joint_target_q + wave * reach, low, high)
            for own, leader, multiplier, offset in robot._followers:
                place, lead = (robot.dof_names.index(joint) for joint in (own, leader))
                target[:, place] = multiplier * target[:, lead] + offset
            commands[name] = np.ascontiguousarray(target)
        ctrl = {name: middle + wave * reach for name, (middle, reach) in self._ranges.items()}
        given: dict[str, Any] = {"joint_target_q": commands, "ctrl": ctrl}
        self.frame = self.sim.step(**{name: values for name, values in given.items() if values})
        self._faulted = int(np.count_nonzero(self.frame.status & 9))

    def summary(self) -> str:
        return f"{self._faulted} of {self.worlds} worlds faulted"


def _powerless(scene: tl.Scene) -> str:
    """Return which joints cannot follow waves, and the cure; nothing if all can."""
    names, joints = [], 0
    for robot in scene.robots.values():
        joints += int(np.count_nonzero(robot.dof_driven))
        names += [
            name
            for name, driven, limit in zip(robot.dof_names, robot.dof_driven, robot.joint_effort_limit, strict=True)
            if driven and limit == 0.0
        ]
    if not joints and scene.robots and not scene.models:
        return ", which has no joint that could follow waves"
    if not names:
        return ""
    cure = 'has effort="0" in its <limit>, so that no drive may push: give the effort in the file'
    if len(names) == joints:
        return f", which hang: each joint {cure}"
    return f", of which {joints - len(names)} of {joints} joints follow waves: `{names[0]}` and each other {cure}"


def _controls(model: MujocoModel) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the middle of a wave and its reach for each actuator."""
    from safetensors.numpy import load_file

    kept = load_file(model.file)
    low, high = kept["actuator_ctrlrange"].reshape(-1, 2).astype(float).T
    limited = kept["actuator_ctrllimited"].astype(bool)
    return np.where(limited, 0.5 * (low + high), 0.0), np.where(limited, _SHARE * (high - low) / 2, _SHARE)
