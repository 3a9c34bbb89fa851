"""Live views of named elements of a model, as ``MjData`` has them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

from numpy.typing import DTypeLike, NDArray

from tightloop.checks.signatures import checked_calls
from tightloop.mujoco.batch.library import mujoco

Array = NDArray[Any]

#: Positions and velocities of a joint, by its kind.
_WIDTHS = {mujoco.mjtJoint.mjJNT_FREE: (7, 6), mujoco.mjtJoint.mjJNT_BALL: (4, 3)}


@dataclass(frozen=True)
class Joint:
    """A joint: positions ``(num_sims, 1 to 7)`` and velocities ``(num_sims, 1 to 6)`` in MuJoCo's conventions."""

    qpos: Array
    qvel: Array


@dataclass(frozen=True)
class Actuator:
    """An actuator: its control and its force [N or N·m], ``(num_sims,)`` each."""

    ctrl: Array
    force: Array


@dataclass(frozen=True)
class Body:
    """A body: position [m], quaternion (w, x, y, z), and velocity about the centre of its tree as ``cvel``."""

    xpos: Array
    xquat: Array
    cvel: Array


@dataclass(frozen=True)
class Site:
    """A site: position ``(num_sims, 3)`` [m] and rotation matrix ``(num_sims, 9)``."""

    xpos: Array
    xmat: Array


@checked_calls
class NamedViews(ABC):
    """Access by name to the bound fields of a batch. An unknown name is a KeyError that lists the names."""

    model: Any

    @abstractmethod
    def bind(self, name: str, dtype: DTypeLike | None = None) -> Array:
        """Return the live array of a field."""

    def sensor(self, name: str, dtype: DTypeLike | None = None) -> Array:
        """Return the values of a sensor, ``(num_sims, dim)``, a view of ``sensordata``."""
        sensor = self.model.sensor(name)
        first = int(sensor.adr[0])
        return self.bind("sensordata", dtype)[:, first : first + int(sensor.dim[0])]

    def joint(self, name: str, dtype: DTypeLike | None = None) -> Joint:
        """Return the position and velocity of a joint, views of ``qpos`` and ``qvel``."""
        joint = self.model.joint(name)
        positions, velocities = _WIDTHS.get(mujoco.mjtJoint(int(joint.type[0])), (1, 1))
        q, d = int(joint.qposadr[0]), int(joint.dofadr[0])
        return Joint(self.bind("qpos", dtype)[:, q : q + positions], self.bind("qvel", dtype)[:, d : d + velocities])

    def actuator(self, name: str, dtype: DTypeLike | None = None) -> Actuator:
        """Return the control and force of an actuator, views of ``ctrl`` and ``actuator_force``."""
        index = self.model.actuator(name).id
        return Actuator(self.bind("ctrl", dtype)[:, index], self.bind("actuator_force", dtype)[:, index])

    def body(self, name: str, dtype: DTypeLike | None = None) -> Body:
        """Return the pose and velocity of a body, views of ``xpos``, ``xquat`` and ``cvel``."""
        index = self.model.body(name).id
        return Body(*(self.bind(field, dtype)[:, index] for field in ("xpos", "xquat", "cvel")))

    def site(self, name: str, dtype: DTypeLike | None = None) -> Site:
        """Return the pose of a site, views of ``site_xpos`` and ``site_xmat``."""
        index = self.model.site(name).id
        return Site(*(self.bind(field, dtype)[:, index] for field in ("site_xpos", "site_xmat")))
