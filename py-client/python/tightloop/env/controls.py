"""Controls: how the values of an action become torques, joint targets, displacements or gripper targets.

Each control takes some values of the action, in [-1, 1] unless it says otherwise, scales them, and writes columns of
the commands.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tightloop import _core
from tightloop.checks import arguments as checks
from tightloop.checks.signatures import checked_calls
from tightloop.env.commands import Commands
from tightloop.env.names import Names
from tightloop.errors import ArgumentError
from tightloop.planning.policy_terms import Drive


class Control(Protocol):
    """The interface of controls."""

    #: Number of action values that it takes.
    size: int
    #: Largest absolute action value. A control may have ``ranges`` instead, shape ``(size, 2)``, and ``clips``, which
    #: is False if values beyond them are taken as they are.
    limit: float
    #: Frame fields that it reads.
    fields: tuple[str, ...]
    # A control may have `value_names`, `scales` and `offsets`, for the metadata of policies: an entry per value. It may
    # also have `drive`, which a rollout with a policy inside uses: what it does, or None where that takes more.

    def bind(self, names: Names, commands: Commands) -> None:
        """Look up names, and get the commands that it writes."""
        ...

    def apply(self, action: NDArray[np.float32], frame: Any) -> None:
        """Write commands for an action, shape ``(worlds, size)``, within the limit; ``frame`` is the last frame."""
        ...


class _Joints:
    """A control with one action value per dof."""

    fields: tuple[str, ...] = ()
    limit = 1.0
    _field = "joint_target_q"
    _is_absolute = True

    @checked_calls
    def __init__(self, dofs: Sequence[str], scale: ArrayLike) -> None:
        """Make a control of some dofs.

        Args:
            dofs: Names of the dofs, ``robot/joint``, in any order, which is that of the action.
            scale: Effect of an action of 1, for all dofs or for each.
        """
        is_list = isinstance(dofs, Sequence) and not isinstance(dofs, str) and len(dofs) > 0
        if not is_list or not all(isinstance(dof, str) for dof in dofs):
            raise ArgumentError(f"{type(self).__name__}: dofs is {dofs!r}; give a list of names, robot/joint")
        self._dofs = list(dofs)
        self.size = self._count = len(dofs)
        try:
            self._scale = np.ascontiguousarray(np.broadcast_to(np.asarray(scale, np.float32), (self.size,)))
        except (TypeError, ValueError):
            self._scale = np.full(self.size, np.nan, np.float32)
        if not np.isfinite(self._scale).all():
            expected = f"give a finite number, or {self.size} of them"
            raise ArgumentError(f"{type(self).__name__}: scale is {scale!r:.80}; {expected}")

    def bind(self, names: Names, commands: Commands) -> None:
        """Look up the dofs."""
        places = [names.dof(name) for name in self._dofs]
        self._array, self._first = commands.array(self._field, places), places[0]
        # dofs that stand side by side, in the order of the robot's, are written where they are
        self._side_by_side = places == list(range(places[0], places[0] + self._count))
        self._columns: slice | NDArray[np.intp] = np.array(places)
        if self._side_by_side:
            self._columns = slice(places[0], places[0] + self._count)
        self._own = np.empty((0 if self._side_by_side else len(self._array), self._count), np.float32)
        self._start = np.ascontiguousarray(commands.start[places])
        self._low, self._high = (np.ascontiguousarray(end) for end in commands.range[places].T)
        self._followers = commands.followers(self._field, places)

    @property
    def drive(self) -> Drive | None:
        """What the control does, for policies outside an environment; None for changes of a target."""
        if not self._is_absolute or self.size != self._count:
            return None
        drive = Drive(command=self._field, of=self._dofs, scale=self._scale, offset=self._start)
        if np.isfinite(self._low).any() or np.isfinite(self._high).any():
            drive = replace(drive, low=self._low, high=self._high)
        return replace(drive, followers=self._followers) if self._followers else drive

    @property
    def value_names(self) -> list[str]:
        """Names of the action's values, ``robot/joint``."""
        return self._dofs

    @property
    def scales(self) -> NDArray[np.float32]:
        """What an action of 1 means, shape ``(size,)``."""
        return self._scale

    @property
    def offsets(self) -> NDArray[np.float32]:
        """What an action of 0 means, shape ``(size,)``; 0 for changes of a target."""
        return self._start if self._is_absolute else np.zeros(self.size, np.float32)

    def _drive(
        self,
        action: NDArray[np.float32],
        start: NDArray[np.float32] | None,
        joint_q: NDArray[np.float32] | None = None,
        lead: float = np.inf,
    ) -> None:
        """Write ``start + scale * action`` or, without a start, add ``scale * action`` to it, within limits.

        With ``joint_q``, of the shape of the action, it is at most ``lead`` from there, too.
        """
        if self._side_by_side:
            _core.drive(self._array, self._first, action, self._scale, start, self._low, self._high, joint_q, lead)
            return
        if start is None:
            self._own[:] = self._array[:, self._columns]
        _core.drive(self._own, 0, action, self._scale, start, self._low, self._high, joint_q, lead)
        self._array[:, self._columns] = self._own


class JointTorque(_Joints):
    """Joint torques, ``joint_f = scale * action`` [N·m or N], optionally with gravity compensation."""

    _field = "joint_f"

    @checked_calls
    def __init__(self, dofs: Sequence[str], scale: ArrayLike, *, hold: bool = False) -> None:
        """Make a torque control of some dofs.

        Args:
            dofs: Names of the dofs, ``robot/joint``, in any order, which is that of the action.
            scale: Torque of an action of 1 [N·m or N], for all dofs or for each.
            hold: Whether to add ``bias_force`` at the start of the step, as a Franka's own controller does.
        """
        super().__init__(dofs, scale)
        self._hold = checks.flag("JointTorque: hold", hold, error=ArgumentError)
        self.fields: tuple[str, ...] = ("bias_force",) if hold else ()

    def bind(self, names: Names, commands: Commands) -> None:
        """Look up the dofs."""
        super().bind(names, commands)
        self._start = np.zeros_like(self._start)
        self._low, self._high = np.full_like(self._start, -np.inf), np.full_like(self._start, np.inf)

    @property
    def drive(self) -> Drive | None:
        """What the control does; None if it adds the ``bias_force`` of the frame."""
        return None if self._hold else super().drive

    def apply(self, action: NDArray[np.float32], frame: Any) -> None:
        """Write the torques."""
        if self._hold:
            self._array[:, self._columns] = frame.bias_force[:, self._columns]
        self._drive(action, None if self._hold else self._start)


class JointTarget(_Joints):
    """Drive targets relative to the scene's, ``start + scale * action`` [rad or m], clipped to the joint limits."""

    @checked_calls
    def __init__(self, dofs: Sequence[str], scale: ArrayLike, *, limit: float = 1.0) -> None:
        """Make a target control of some dofs.

        Args:
            dofs: Names of the dofs, ``robot/joint``.
            scale: Offset of an action of 1 [rad or m], for all dofs or for each.
            limit: Largest absolute action value.
        """
        super().__init__(dofs, scale)
        self.limit = checks.number("JointTarget: limit", limit, above=0.0, error=ArgumentError)

    def apply(self, action: NDArray[np.float32], frame: Any) -> None:
        """Write the targets."""
        self._drive(action, self._start)


class JointDelta(_Joints):
    """Increments of the drive targets, ``target + scale * action`` [rad or m], clipped to the joint limits.

    An increment starts from the last target, not from the joint position, so that a load causes no drift. A ``lead``
    keeps targets near their joints.
    """

    _is_absolute = False

    @checked_calls
    def __init__(self, dofs: Sequence[str], scale: ArrayLike, *, lead: float | None = None) -> None:
        """Make a control of targets that move.

        Args:
            dofs: Names of the dofs, ``robot/joint``; with ``lead``, of joints with one coordinate.
            scale: Increment of an action of 1 [rad or m], for all dofs or for each.
            lead: How far a target may be from where its joint is [rad or m]; any distance if left out. A joint that is
                stopped then comes back at once. Under a load that pulls it further from its target, it sinks.
        """
        super().__init__(dofs, scale)
        self._lead = None if lead is None else checks.number("JointDelta: lead", lead, above=0.0, error=ArgumentError)
        self.fields: tuple[str, ...] = () if lead is None else ("joint_q",)

    @property
    def lead(self) -> float:
        """How far a target may be from its joint [rad or m]; infinite without a bound."""
        return np.inf if self._lead is None else self._lead

    def bind(self, names: Names, commands: Commands) -> None:
        """Look up the dofs."""
        super().bind(names, commands)
        if self._lead is None:
            return
        places = [names.coord(name) for name in self._dofs]
        is_row = places == list(range(places[0], places[0] + self._count))
        self._coords = slice(places[0], places[0] + self._count) if is_row else np.array(places)

    def apply(self, action: NDArray[np.float32], frame: Any) -> None:
        """Increment the targets."""
        if self._lead is None:
            self._drive(action, None)
            return
        joint_q = np.asarray(frame.joint_q[:, self._coords], np.float32)
        self._drive(action, None, joint_q, self._lead)


class ActuatorControl:
    """Controls of the actuators of the scene's MuJoCo models, ``ctrl = action``, as MuJoCo takes them."""

    fields: tuple[str, ...] = ()
    limit = 1.0

    @checked_calls
    def __init__(self, ranges: ArrayLike, *, clips: bool = True) -> None:
        """Make a control of all actuators of the scene.

        Args:
            ranges: Lower and upper bound of the action of each actuator, shape ``(actuators, 2)``.
            clips: Whether actions are clipped to their ranges. Otherwise the task's functions see them as they are; the
                simulation clamps them to each actuator's ``ctrlrange`` in any case.
        """
        try:
            given = np.asarray(ranges)
        except ValueError:  # rows of several lengths
            given = np.empty(0)
        fits = given.ndim == 2 and given.shape[1:] == (2,) and len(given) > 0 and given.dtype.kind in "fiu"
        if not fits or not (np.isfinite(given).all() and (given[:, 0] < given[:, 1]).all()):
            raise ArgumentError(f"ActuatorControl: ranges is {ranges!r:.80}; give (low, high) of each actuator")
        self.ranges = given.astype(np.float32)
        self.size = len(given)
        self.clips = checks.flag("ActuatorControl: clips", clips, error=ArgumentError)
        self.scales, self.offsets = np.ones(self.size, np.float32), np.zeros(self.size, np.float32)

    def bind(self, names: Names, commands: Commands) -> None:
        """Check the number of actuators."""
        if len(names.actuator_names) != self.size:
            there = len(names.actuator_names)
            raise ArgumentError(
                f"ActuatorControl: ranges has {self.size} rows for {there} actuators; give one for each"
            )
        self._array = commands.array("ctrl", range(self.size))
        self.value_names = names.actuator_names

    @property
    def drive(self) -> Drive:
        """What the control does, for policies outside an environment."""
        return Drive(command="ctrl", of=self.value_names)

    def apply(self, action: NDArray[np.float32], frame: Any) -> None:
        """Write the controls."""
        np.copyto(self._array, action)


class ActuatorTarget:
    """Controls of the actuators of the scene's MuJoCo models, ``ctrl = start + scale * action``.

    The simulation clamps them to each actuator's ``ctrlrange``.
    """

    fields: tuple[str, ...] = ()

    @checked_calls
    def __init__(self, start: ArrayLike, scale: ArrayLike, *, limit: float = 1.0) -> None:
        """Make a target control of all actuators of the scene.

        Args:
            start: Control of each actuator at an action of 0, shape ``(actuators,)``.
            scale: Effect of an action of 1, for all actuators or for each.
            limit: Largest absolute action value.
        """
        self._start = _finite("ActuatorTarget: start", start, None)
        self.size = len(self._start)
        self._scale = _finite("ActuatorTarget: scale", scale, self.size)
        self.scales, self.offsets = self._scale, self._start
        self.limit = checks.number("ActuatorTarget: limit", limit, above=0.0, error=ArgumentError)

    def bind(self, names: Names, commands: Commands) -> None:
        """Check the number of actuators."""
        if len(names.actuator_names) != self.size:
            there = len(names.actuator_names)
            raise ArgumentError(
                f"ActuatorTarget: start has {self.size} values for {there} actuators; give one for each"
            )
        self._array = commands.array("ctrl", range(self.size))
        self.value_names = names.actuator_names

    @property
    def drive(self) -> Drive:
        """What the control does, for policies outside an environment."""
        return Drive(command="ctrl", of=self.value_names, scale=self._scale, offset=self._start)

    def apply(self, action: NDArray[np.float32], frame: Any) -> None:
        """Write the controls."""
        np.multiply(action, self._scale, out=self._array)
        self._array += self._start


def _finite(what: str, given: ArrayLike, size: int | None) -> NDArray[np.float32]:
    """Numbers of all actuators; a single one is for all, if ``size`` says of how many."""
    try:
        values = np.asarray(given, np.float32)
        values = values if size is None else np.broadcast_to(values, (size,))
    except (TypeError, ValueError):
        values = np.empty(0, np.float32)
    if values.ndim != 1 or not len(values) or not np.isfinite(values).all():
        expected = "one for each actuator" if size is None else f"one, or {size} of them"
        raise ArgumentError(f"{what} is {given!r:.80}; give finite numbers, {expected}")
    return np.ascontiguousarray(values)


class Gripper(_Joints):
    """One action value for all fingers: their target is ``low`` at -1, ``high`` at 1, and linear in between."""

    @checked_calls
    def __init__(self, dofs: Sequence[str], low: float, high: float, *, binary: bool = False) -> None:
        """Make a gripper control.

        Args:
            dofs: Names of the fingers' dofs, ``robot/joint``.
            low: Closed target [m or rad]; a target below the fingers' range presses harder.
            high: Open target [m or rad].
            binary: Whether the gripper is only open or closed; it closes below 0.
        """
        low, high = (
            checks.number(f"Gripper: {name}", end, error=ArgumentError) for name, end in (("low", low), ("high", high))
        )
        super().__init__(dofs, 0.5 * (high - low))
        self.size, self._middle = 1, 0.5 * (high + low)
        self._binary = checks.flag("Gripper: binary", binary, error=ArgumentError)

    @property
    def value_names(self) -> list[str]:
        """The first finger stands for all of them."""
        return super().value_names[:1]

    @property
    def scales(self) -> NDArray[np.float32]:
        """Half of the way between closed and open."""
        return self._scale[:1]

    @property
    def offsets(self) -> NDArray[np.float32]:
        """The middle between closed and open."""
        return self._start[:1]

    def bind(self, names: Names, commands: Commands) -> None:
        """Look up the fingers."""
        super().bind(names, commands)
        self._start = np.full_like(self._start, self._middle)
        self._low, self._high = np.full_like(self._start, -np.inf), np.full_like(self._start, np.inf)
        self._fingers = np.empty((len(self._array), self._count), np.float32)

    def apply(self, action: NDArray[np.float32], frame: Any) -> None:
        """Write the targets."""
        if self._binary:
            # the sum keeps NaN, which must fault the world
            action = np.where(action < 0.0, -1.0, 1.0) + 0.0 * action
        np.copyto(self._fingers, action)
        self._drive(self._fingers, self._start)


class EndEffectorDelta(_Joints):
    """Displacements of a site in world axes, which damped least squares turn into increments of the drive targets.

    ``target + J⁺ (pos_scale * action[:3], rot_scale * action[3:])``, with the field ``site_inverse_jacobian`` as J⁺.
    Without ``rot_scale`` it takes three values, and the site keeps its orientation.
    """

    fields = ("site_inverse_jacobian",)
    _is_absolute = False

    @checked_calls
    def __init__(self, site: str, dofs: Sequence[str], pos_scale: float, rot_scale: float | None = None) -> None:
        """Make a control of a site.

        Args:
            site: Name of the site.
            dofs: Names of the dofs that move it, ``robot/joint``.
            pos_scale: Displacement per step of an action of 1 [m].
            rot_scale: Rotation per step of an action of 1, about world axes [rad].
        """
        super().__init__(dofs, 1.0)
        pos_scale = checks.number("EndEffectorDelta: pos_scale", pos_scale, error=ArgumentError)
        if rot_scale is not None:
            rot_scale = checks.number("EndEffectorDelta: rot_scale", rot_scale, error=ArgumentError)
        self._site_name = checks.text("EndEffectorDelta: site", site, error=ArgumentError)
        self.size = 3 if rot_scale is None else 6
        self._step = np.array([pos_scale] * 3 + [rot_scale or 0.0] * 3, np.float32)[: self.size]

    @property
    def value_names(self) -> list[str]:
        """Displacements of the site and its rotations."""
        return [f"{self._site_name}.{axis}" for axis in ("x", "y", "z", "rx", "ry", "rz")[: self.size]]

    @property
    def scales(self) -> NDArray[np.float32]:
        """Displacement and rotation of an action of 1."""
        return self._step

    def bind(self, names: Names, commands: Commands) -> None:
        """Look up the site and the dofs."""
        super().bind(names, commands)
        self._site = names.site(self._site_name)
        worlds = len(self._array)
        self._displacement = np.empty((worlds, self.size), np.float32)
        self._turn = np.empty((worlds, self._count), np.float32)

    def apply(self, action: NDArray[np.float32], frame: Any) -> None:
        """Increment the targets."""
        inverse = frame.site_inverse_jacobian[:, self._site, self._columns, : self.size]
        np.multiply(action, self._step, out=self._displacement)
        np.einsum("wdk,wk->wd", inverse, self._displacement, out=self._turn, casting="same_kind")
        self._drive(self._turn, None)
