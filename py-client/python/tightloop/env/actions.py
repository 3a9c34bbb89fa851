"""Actions of all worlds, from a policy to the commands of a step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import ArrayLike, NDArray

from tightloop.env.commands import Commands
from tightloop.env.controls import Control
from tightloop.env.names import Names
from tightloop.errors import ArgumentError
from tightloop.scene.scene import Scene


class Actions:
    """The actions of all worlds, which controls turn into commands.

    Attributes:
        space: Action space of one world.
        now: Last actions, shape ``(worlds, actions)``; 0 in worlds that have just begun an episode.
        before: Actions of the step before.
    """

    def __init__(self, controls: Sequence[Control], scene: Scene, names: Names, worlds: int) -> None:
        if not controls:
            raise ArgumentError("controls: there is none; list what the action's numbers do")
        self._commands = Commands(scene, names, worlds)
        self._controls: list[tuple[Control, slice]] = []
        first = 0
        for control in controls:
            control.bind(names, self._commands)
            self._controls.append((control, slice(first, first + control.size)))
            first += control.size
        ranges = np.concatenate([_range(control) for control in controls])
        self.space = Box(ranges[:, 0], ranges[:, 1], dtype=np.float32)
        for control, numbers in self._controls:
            if not getattr(control, "clips", True):
                ranges[numbers] = -np.inf, np.inf
        # scalars if all ranges are equal: NumPy is slow on short rows
        self._low, self._high = ranges[0] if (ranges == ranges[0]).all() else np.ascontiguousarray(ranges.T)
        self.now, self.before = (np.zeros((worlds, first), np.float32) for _ in range(2))

    def take(self, actions: ArrayLike, frame: Any) -> dict[str, NDArray[np.float32]]:
        """Apply actions, clipped to the action space where the control asks for it; returns the arguments of a step.

        Raises:
            ArgumentError: The shape is wrong, or the values are no real numbers.
        """
        given = np.asarray(actions)
        if given.shape != self.now.shape or given.dtype.kind not in "fiu":
            expected = f"expected real numbers of shape {self.now.shape}"
            raise ArgumentError(f"actions: {expected}; got {given.dtype} of shape {given.shape}")
        self.now, self.before = self.before, self.now
        np.clip(given, self._low, self._high, out=self.now, casting="same_kind")
        for control, numbers in self._controls:
            control.apply(self.now[:, numbers], frame)
        return self._commands.sent

    def not_finite(self) -> tuple[int, str] | None:
        """Return the first world whose last action is not finite, and which value it is; None without one."""
        wrong = np.argwhere(~np.isfinite(self.now))
        if not len(wrong):
            return None
        world, place = (int(index) for index in wrong[0])
        control = next(control for control, numbers in self._controls if numbers.start <= place < numbers.stop)
        return world, f"action[{place}] ({type(control).__name__}) is {self.now[world, place]}"

    def begin(self, mask: NDArray[np.bool_]) -> None:
        """Clear actions and commands of worlds that begin an episode."""
        self._commands.begin(mask)
        self.now[mask] = self.before[mask] = 0.0


def _range(control: Control) -> NDArray[np.float32]:
    """Return lower and upper bounds of the values that a control takes, shape ``(size, 2)``."""
    own = getattr(control, "ranges", None)
    if own is not None:
        return np.array(own, np.float32)
    return np.tile(np.array([-control.limit, control.limit], np.float32), (control.size, 1))
