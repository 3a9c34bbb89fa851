"""Commands of all worlds, which controls write into."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tightloop.env.names import Names
from tightloop.errors import ArgumentError
from tightloop.scene.scene import Scene


class Commands:
    """The commands of all worlds.

    Attributes:
        start: Drive targets of the scene at the start [rad or m], shape ``(dofs,)``.
        range: Lower and upper limit of each dof [rad or m], shape ``(dofs, 2)``; infinite without a limit.
    """

    def __init__(self, scene: Scene, names: Names, worlds: int) -> None:
        dofs = len(names.dof_names)
        self.start = np.zeros(dofs, np.float32)
        self.range = np.tile(np.array([-np.inf, np.inf], np.float32), (dofs, 1))
        self._followers: list[tuple[int, int, float, float]] = []
        for name, robot in scene.robots.items():
            self.start[names.dofs[name]] = robot.joint_target_q
            self.range[names.dofs[name]] = robot.joint_range
            for own, leader, multiplier, offset in robot._followers:
                follower, place = names.dof(f"{name}/{own}"), names.dof(f"{name}/{leader}")
                self._followers.append((follower, place, multiplier, offset))
        self._worlds = worlds
        self._names, self._actuators = names.dof_names, names.actuator_names
        self._arrays: dict[str, NDArray[np.float32]] = {}
        self._taken: set[tuple[str, int]] = set()

    def array(self, field: str, dofs: Sequence[int]) -> NDArray[np.float32]:
        """Return the array of a command, ``joint_f`` or ``joint_target_q``, shape ``(worlds, dofs)``, or ``ctrl``.

        Every later step sends this array.

        Raises:
            ArgumentError: Another control already writes one of these dofs.
        """
        for dof in dofs:
            if (field, dof) in self._taken:
                name = (self._actuators if field == "ctrl" else self._names)[dof]
                raise ArgumentError(f"controls: two of them write {field} of {name}; leave one out")
            self._taken.add((field, dof))
        if field not in self._arrays:
            start = np.zeros(len(self._actuators if field == "ctrl" else self._names), np.float32)
            if field == "joint_target_q":
                start = self.start
            self._arrays[field] = np.tile(start, (self._worlds, 1))
        return self._arrays[field]

    def followers(self, field: str, dofs: Sequence[int]) -> list[tuple[str, str, float, float]]:
        """Return the mimic joints that follow dofs of a control: name, leader, multiplier and offset."""
        if field != "joint_target_q":
            return []
        return [
            (self._names[own], self._names[leader], multiplier, offset)
            for own, leader, multiplier, offset in self._followers
            if leader in dofs and own not in dofs
        ]

    def begin(self, mask: NDArray[np.bool_]) -> None:
        """Reset the commands of worlds that begin an episode."""
        for field, array in self._arrays.items():
            np.copyto(array, self.start if field == "joint_target_q" else 0, where=mask[:, None])

    @property
    def sent(self) -> dict[str, NDArray[np.float32]]:
        """Arguments of a step, by name. Mimic joints that no control moves follow their leaders."""
        targets = self._arrays.get("joint_target_q")
        if targets is None:
            return self._arrays
        for own, leader, multiplier, offset in self._followers:
            if ("joint_target_q", leader) in self._taken and ("joint_target_q", own) not in self._taken:
                targets[:, own] = multiplier * targets[:, leader] + offset
        return self._arrays
