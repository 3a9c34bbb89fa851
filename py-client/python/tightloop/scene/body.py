"""A rigid body of a scene: free in the world or fixed in it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tightloop.checks import arguments as checks
from tightloop.checks.arguments import Triple, Vector
from tightloop.errors import SceneError
from tightloop.scene.entity import Entity


class Body(Entity):
    """A rigid body of a scene, made by `Scene.add_body`. ``scene.add_box(body=…)`` and the like give it shapes.

    ``sim.bodies[name]`` is its slice of ``body_q``, ``sim.dofs[name]`` that of ``joint_qd``.
    """

    __slots__ = ("_com", "_fixed", "_inertia", "_mass")

    kind = "body"

    def __init__(
        self,
        name: str,
        *,
        pos: Vector,
        quat: Vector,
        mass: float | None,
        com: Vector | None,
        inertia: ArrayLike | None,
        fixed: bool,
    ) -> None:
        super().__init__(name, pos, quat)
        self._inertia: list[Sequence[float]] | None = None
        self.fixed = fixed
        self.mass = mass
        self.com = com
        self.inertia = inertia

    @property
    def fixed(self) -> bool:
        """Whether the body does not move. Otherwise it has the six dofs ``name/free.vx`` … ``name/free.wz``."""
        return self._fixed

    @fixed.setter
    def fixed(self, fixed: bool) -> None:
        self._fixed = checks.flag(f"{self._subject()}: fixed", fixed)

    @property
    def mass(self) -> float | None:
        """Mass [kg]; None takes it from the shapes."""
        return self._mass

    @mass.setter
    def mass(self, mass: float | None) -> None:
        if mass is None and self._inertia is not None:
            raise SceneError(f"{self._subject()} has an inertia but no mass; give a mass, or set inertia to None first")
        self._mass = None if mass is None else checks.number(f"{self._subject()}: mass", mass, above=0.0)

    @property
    def com(self) -> Triple | None:
        """Centre of mass in the body's frame [m]; None takes it from the shapes."""
        return self._com

    @com.setter
    def com(self, com: Vector | None) -> None:
        self._com = None if com is None else checks.triple(f"{self._subject()}: com", com)

    @property
    def inertia(self) -> list[Sequence[float]] | None:
        """Inertia about the centre of mass, in body axes [kg·m²], 3 rows; None takes it from the shapes."""
        return self._inertia

    @inertia.setter
    def inertia(self, inertia: ArrayLike | None) -> None:
        if inertia is not None and self._mass is None:
            raise SceneError(f"{self._subject()} has an inertia but no mass; give mass= too")
        self._inertia = None if inertia is None else _tensor(f"{self._subject()}: inertia", inertia)

    def table(self) -> dict[str, Any]:
        """Return the body in the form of a scene file."""
        return {
            "name": self.name,
            "pos": self.pos,
            "quat": self.quat,
            "fixed": self.fixed,
            "mass": self.mass,
            "com": self.com,
            "inertia": self.inertia,
        }

    def __repr__(self) -> str:
        return f"Body({self.name!r}, fixed={self.fixed}, mass={self.mass})"


def _tensor(what: str, values: ArrayLike) -> list[Sequence[float]]:
    """Check a symmetric tensor, given by 3 rows or by its diagonal."""
    try:
        given = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise SceneError(f"{what} is {values!r:.80}; give 3 principal moments or a (3, 3) tensor") from None
    if given.shape == (3,):
        given = np.diag(given)
    if given.shape != (3, 3):
        raise SceneError(f"{what} has shape {given.shape}; give 3 principal moments or a (3, 3) tensor")
    if not np.isfinite(given).all():
        raise SceneError(f"{what} is not finite; give finite numbers")
    if not np.allclose(given, given.T, rtol=1e-9, atol=0.0):
        raise SceneError(f"{what} is not symmetric; give a symmetric tensor")
    return given.tolist()
