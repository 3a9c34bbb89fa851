"""Joints of a robot in an order of the user's, such as that of a policy trained elsewhere."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tightloop.arrays.inputs import reals
from tightloop.checks.attributes import suggestion
from tightloop.checks.signatures import checked_calls
from tightloop.errors import ArgumentError, SceneError


@checked_calls
class JointOrder:
    """An order of a robot's dofs, made by `Robot.order`. It converts arrays from and to the robot's own order.

    >>> order = dog.order(["FL_hip_joint", "FR_hip_joint", "RL_hip_joint", ...])
    >>> obs = order.read(frame.joint_q[:, sim.coords["dog"]])              # in that order
    >>> sim.step(joint_target_q={"dog": order.write(policy(obs))})         # in the robot's order

    Attributes:
        names: Names of the dofs, in that order.
    """

    def __init__(self, robot: str, names: Sequence[str], dofs: list[str], base: int) -> None:
        """Make an order.

        Args:
            robot: Name of the robot, for messages.
            names: Names of the dofs in the order.
            dofs: Those of the robot, without those of a floating base.
            base: Number of dofs of the floating base.

        Raises:
            SceneError: A name is unknown, missing or there twice.
        """
        what = f"robot `{robot}`: order"
        if isinstance(names, str) or not isinstance(names, Sequence):
            raise SceneError(f"{what}: names is {names!r}; give a list of dof names")
        for name in names:
            if name not in dofs:
                raise SceneError(f"{what}: names has {name!r}, which is no dof; {suggestion(str(name), dofs)}")
            if names.count(name) > 1:
                raise SceneError(f"{what}: names has {name!r} twice; give each dof once")
        left = [name for name in dofs if name not in names]
        if left:
            raise SceneError(f"{what}: names lacks {', '.join(map(repr, left))}; give each dof once")
        self.names = list(names)
        self._robot = robot
        self._widths = {len(dofs)} | ({len(dofs) + base, len(dofs) + base + 1} if base else set())
        self._read = np.array([dofs.index(name) for name in self.names], np.intp)
        self._write = np.argsort(self._read)

    def read(self, values: ArrayLike) -> NDArray[np.floating]:
        """Return values of the robot in this order.

        Args:
            values: Shape ``(…, dofs)`` or ``(…, coords)``, in the robot's order, with or without the columns of a
                floating base.

        Returns:
            Shape ``(…, len(names))``, a copy.

        Raises:
            ArgumentError: The values are no real numbers, or of another shape.
        """
        given = self._checked("read", values, self._widths)
        return given[..., given.shape[-1] - len(self.names) :][..., self._read]

    def write(self, values: ArrayLike) -> NDArray[np.floating]:
        """Return values in the robot's order, without the columns of a floating base, as commands take them.

        Args:
            values: Shape ``(…, len(names))``, in this order.

        Raises:
            ArgumentError: The values are no real numbers, or of another shape.
        """
        return self._checked("write", values, {len(self.names)})[..., self._write]

    def _checked(self, call: str, values: ArrayLike, widths: set[int]) -> NDArray[np.floating]:
        given = reals(f"{call}: values", values)
        if given.ndim == 0 or given.shape[-1] not in widths:
            known = " or ".join(map(str, sorted(widths)))
            raise ArgumentError(f"{call}: values has shape {given.shape}; give {known} entries in the last axis")
        return given

    def __repr__(self) -> str:
        return f"JointOrder({self._robot!r}, {self.names})"
