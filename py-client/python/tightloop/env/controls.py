"""What a policy's numbers do: torques, joint targets, steps of joints or of the hand, a gripper.

Each control takes some of an action's numbers, in [-1, 1] but where it says otherwise, scales them, and writes columns
of the commands.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tightloop import _core, checks
from tightloop.env.commands import Commands
from tightloop.env.names import Names
from tightloop.errors import ArgumentError


class Control(Protocol):
    """Some of an action's numbers and what they do."""

    #: How many numbers of the action it takes.
    size: int
    #: How large they may be.
    limit: float
    #: Fields of the frame that it reads.
    fields: tuple[str, ...]

    def bind(self, names: Names, commands: Commands) -> None:
        """Look up names, and take the commands that it writes."""
        ...

    def apply(self, action: NDArray[np.float32], frame: Any) -> None:
        """Write commands: ``action`` is of shape ``(worlds, size)``, within the limit; the frame is the last one."""
        ...


class _Joints:
    """A control of some dofs, one number each."""

    fields: tuple[str, ...] = ()
    limit = 1.0
    _field = "joint_target_q"

    def __init__(self, dofs: Sequence[str], scale: ArrayLike) -> None:
        """A control of some dofs.

        Args:
            dofs: Their names, ``robot/joint``.
            scale: What an action of 1 means, for all or each of them.
        """
        if isinstance(dofs, str) or not dofs:
            raise ArgumentError(f"{type(self).__name__}: dofs is {dofs!r}; give a list of names, robot/joint")
        self._dofs = list(dofs)
        self.size = self._count = len(dofs)
        try:
            self._scale = np.ascontiguousarray(np.broadcast_to(np.asarray(scale, np.float32), (self.size,)))
        except ValueError:
            raise ArgumentError(f"{type(self).__name__}: scale must be a number, or {self.size} of them") from None

    def bind(self, names: Names, commands: Commands) -> None:
        """Look up the dofs."""
        places = [names.dof(name) for name in self._dofs]
        if places != list(range(places[0], places[0] + self._count)):
            raise ArgumentError(f"{type(self).__name__}: dofs must stand side by side, in the order of the robot's")
        self._array, self._first = commands.array(self._field, places), places[0]
        self._start = np.ascontiguousarray(commands.start[places])
        self._low, self._high = (np.ascontiguousarray(end) for end in commands.range[places].T)

    def _drive(self, action: NDArray[np.float32], start: NDArray[np.float32] | None) -> None:
        """Write ``start + scale * action``, or without it what stands there moved on, within the dofs' range."""
        _core.drive(self._array, self._first, action, self._scale, start, self._low, self._high)


class JointTorque(_Joints):
    """Torques: ``joint_f = scale * action`` [N·m or N], and on request what holds the joints against gravity."""

    _field = "joint_f"

    def __init__(self, dofs: Sequence[str], scale: ArrayLike, *, hold: bool = False) -> None:
        """Torques of some dofs.

        Args:
            dofs: Their names, ``robot/joint``.
            scale: What an action of 1 means [N·m or N], for all or each of them.
            hold: Whether ``bias_force`` at the beginning of the step is added, as a Franka's own controller does.
        """
        super().__init__(dofs, scale)
        self._hold = hold
        self.fields: tuple[str, ...] = ("bias_force",) if hold else ()

    def bind(self, names: Names, commands: Commands) -> None:
        """Look up the dofs."""
        super().bind(names, commands)
        self._start = np.zeros_like(self._start)
        self._low, self._high = np.full_like(self._start, -np.inf), np.full_like(self._start, np.inf)

    def apply(self, action: NDArray[np.float32], frame: Any) -> None:
        """Write the torques."""
        if self._hold:
            dofs = slice(self._first, self._first + self._count)
            np.copyto(self._array[:, dofs], frame.bias_force[:, dofs], casting="same_kind")
        self._drive(action, None if self._hold else self._start)


class JointTarget(_Joints):
    """Drive targets about the scene's: ``start + scale * action`` [rad or m], within the joints' ranges."""

    def __init__(self, dofs: Sequence[str], scale: ArrayLike, *, limit: float = 1.0) -> None:
        """Drive targets of some dofs.

        Args:
            dofs: Their names, ``robot/joint``.
            scale: What an action of 1 means [rad or m], for all or each of them.
            limit: How large an action may be.
        """
        super().__init__(dofs, scale)
        self.limit = checks.number("JointTarget: limit", limit, above=0.0, error=ArgumentError)

    def apply(self, action: NDArray[np.float32], frame: Any) -> None:
        """Write the targets."""
        self._drive(action, self._start)


class JointDelta(_Joints):
    """Steps of the drive targets: ``target + scale * action`` [rad or m], within the joints' ranges.

    A step is from the last target, not from where the joint is, so that a load does not make it drift.
    """

    def apply(self, action: NDArray[np.float32], frame: Any) -> None:
        """Move the targets on."""
        self._drive(action, None)


class Gripper(_Joints):
    """One number for all fingers: their target is ``low`` at -1, ``high`` at 1, evenly in between."""

    def __init__(self, dofs: Sequence[str], low: float, high: float, *, binary: bool = False) -> None:
        """A gripper.

        Args:
            dofs: Names of the fingers' dofs, ``robot/joint``.
            low: Closed [m or rad]; below the fingers' range it presses harder.
            high: Open.
            binary: Whether there is nothing in between: below 0 it closes.
        """
        super().__init__(dofs, 0.5 * (high - low))
        self.size, self._middle, self._binary = 1, 0.5 * (high + low), binary

    def bind(self, names: Names, commands: Commands) -> None:
        """Look up the fingers."""
        super().bind(names, commands)
        self._start = np.full_like(self._start, self._middle)
        self._low, self._high = np.full_like(self._start, -np.inf), np.full_like(self._start, np.inf)
        self._fingers = np.empty((len(self._array), self._count), np.float32)

    def apply(self, action: NDArray[np.float32], frame: Any) -> None:
        """Write the targets."""
        if self._binary:
            # the sum keeps NaN, which is to fail
            action = np.where(action < 0.0, -1.0, 1.0) + 0.0 * action
        np.copyto(self._fingers, action)
        self._drive(self._fingers, self._start)


class EndEffectorDelta(_Joints):
    """Steps of a site: the drive targets move by the damped least squares of a displacement in world axes.

    ``target + J⁺ (pos_scale * action[:3], rot_scale * action[3:])``, with the field ``site_inverse_jacobian`` as J⁺.
    Without ``rot_scale`` it takes three numbers, and the site keeps its orientation.
    """

    fields = ("site_inverse_jacobian",)

    def __init__(self, site: str, dofs: Sequence[str], pos_scale: float, rot_scale: float | None = None) -> None:
        """A control of a site.

        Args:
            site: Its name.
            dofs: Names of the dofs that move it, ``robot/joint``.
            pos_scale: What an action of 1 moves it a step [m].
            rot_scale: What an action of 1 turns it a step, about world axes [rad].
        """
        super().__init__(dofs, 1.0)
        self._site_name = site
        self.size = 3 if rot_scale is None else 6
        self._step = np.array([pos_scale] * 3 + [rot_scale or 0.0] * 3, np.float32)[: self.size]

    def bind(self, names: Names, commands: Commands) -> None:
        """Look up the site and the dofs."""
        super().bind(names, commands)
        self._site = names.site(self._site_name)
        worlds = len(self._array)
        self._displacement = np.empty((worlds, self.size), np.float32)
        self._turn = np.empty((worlds, self._count), np.float32)

    def apply(self, action: NDArray[np.float32], frame: Any) -> None:
        """Move the targets on."""
        dofs = slice(self._first, self._first + self._count)
        inverse = frame.site_inverse_jacobian[:, self._site, dofs, : self.size]
        np.multiply(action, self._step, out=self._displacement)
        np.einsum("wdk,wk->wd", inverse, self._displacement, out=self._turn, casting="same_kind")
        self._drive(self._turn, None)
