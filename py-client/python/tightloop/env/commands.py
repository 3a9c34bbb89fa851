"""Actions of all worlds, and the commands that become of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import ArrayLike, NDArray

from tightloop.env.names import Names
from tightloop.errors import ArgumentError
from tightloop.scene import Scene

if TYPE_CHECKING:
    from tightloop.env.controls import Control


class Commands:
    """The commands of all worlds; controls write into them.

    Attributes:
        start: Drive targets of the scene at the start [rad or m], shape ``(dofs,)``.
        range: Least and largest position of each dof [rad or m], shape ``(dofs, 2)``; infinite without a limit.
    """

    def __init__(self, scene: Scene, names: Names, worlds: int) -> None:
        dofs = len(names.dof_names)
        self.start = np.zeros(dofs, np.float32)
        self.range = np.tile(np.array([-np.inf, np.inf], np.float32), (dofs, 1))
        for name, robot in scene.robots.items():
            self.start[names.dofs[name]] = robot.joint_target_q
            self.range[names.dofs[name]] = robot.joint_range
        self._shape = (worlds, dofs)
        self._names = names.dof_names
        self._arrays: dict[str, NDArray[np.float32]] = {}
        self._taken: set[tuple[str, int]] = set()

    def array(self, field: str, dofs: Sequence[int]) -> NDArray[np.float32]:
        """The command ``joint_f`` or ``joint_target_q``, shape ``(worlds, dofs)``; from now on it is sent.

        Raises:
            ArgumentError: Another control writes one of these dofs already.
        """
        for dof in dofs:
            if (field, dof) in self._taken:
                raise ArgumentError(f"controls: two of them write {field} of {self._names[dof]}; leave one out")
            self._taken.add((field, dof))
        if field not in self._arrays:
            start = self.start if field == "joint_target_q" else np.zeros_like(self.start)
            self._arrays[field] = np.tile(start, (self._shape[0], 1))
        return self._arrays[field]

    def begin(self, mask: NDArray[np.bool_]) -> None:
        """Put the commands of worlds that begin an episode back to those of the start."""
        for field, array in self._arrays.items():
            np.copyto(array, self.start if field == "joint_target_q" else 0, where=mask[:, None])

    @property
    def sent(self) -> dict[str, NDArray[np.float32]]:
        """What a step is given, by argument."""
        return self._arrays


class Actions:
    """What policies ask for.

    Attributes:
        space: Space of one world's action.
        now: The actions taken last, shape ``(worlds, actions)``; 0 in worlds that have just begun.
        before: Those taken before.
    """

    def __init__(self, controls: Sequence[Control], scene: Scene, names: Names, worlds: int) -> None:
        if not controls:
            raise ArgumentError("controls: there is none; list what the action's numbers do")
        self._commands = Commands(scene, names, worlds)
        self._controls: list[tuple[Control, slice]] = []
        place = 0
        for control in controls:
            control.bind(names, self._commands)
            self._controls.append((control, slice(place, place + control.size)))
            place += control.size
        limits = np.concatenate([np.full(control.size, control.limit, np.float32) for control in controls])
        self.space = Box(-limits, limits, dtype=np.float32)
        # one number where it does: NumPy takes long over rows of few
        self._limits = limits[0] if (limits == limits[0]).all() else limits
        self.now, self.before = (np.zeros((worlds, place), np.float32) for _ in range(2))

    def take(self, actions: ArrayLike, frame: Any) -> dict[str, NDArray[np.float32]]:
        """Take actions, those beyond the space as its bounds; returns what a step is given, by argument.

        Raises:
            ArgumentError: The shape is another, or these are no real numbers.
        """
        given = np.asarray(actions)
        if given.shape != self.now.shape or given.dtype.kind not in "fiu":
            expected = f"expected real numbers of shape {self.now.shape}"
            raise ArgumentError(f"actions: {expected}; got {given.dtype} of shape {given.shape}")
        self.now, self.before = self.before, self.now
        np.clip(given, -self._limits, self._limits, out=self.now, casting="same_kind")
        for control, numbers in self._controls:
            control.apply(self.now[:, numbers], frame)
        return self._commands.sent

    def begin(self, mask: NDArray[np.bool_]) -> None:
        """Forget what worlds that begin an episode did before."""
        self._commands.begin(mask)
        self.now[mask] = self.before[mask] = 0.0
