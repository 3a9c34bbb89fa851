"""A rigid body of a scene: free in the world or fixed in it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tightloop import checks
from tightloop.checks import Triple, Vector
from tightloop.entity import Entity
from tightloop.errors import SceneError


class Body(Entity):
    """A rigid body of a scene, made by `Scene.add_body`. ``scene.add_box(body=…)`` and the like give it shapes.

    Attributes:
        name: Name in the scene. ``sim.bodies[name]`` is its slice of ``body_q``, ``sim.dofs[name]`` that of
            ``joint_qd``.
        fixed: Whether the body does not move. Otherwise it has the six dofs ``name/free.vx`` … ``name/free.wz``.
        mass: Mass [kg]; None takes it from the shapes.
        com: Centre of mass in the body's frame [m]; None takes it from the shapes.
        inertia: Inertia about the centre of mass, in body axes [kg·m²], 3 rows; None takes it from the shapes.
    """

    # a misspelt property is an error
    __slots__ = ("com", "fixed", "inertia", "mass")

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
        what = f"body `{name}`"
        super().__init__(name, pos, quat)
        self.fixed = bool(fixed)
        self.mass = None if mass is None else checks.number(f"{what}: mass", mass, above=0.0)
        self.com: Triple | None = None if com is None else checks.triple(f"{what}: com", com)
        self.inertia = None if inertia is None else _tensor(f"{what}: inertia", inertia)
        if inertia is not None and mass is None:
            raise SceneError(f"{what} has an inertia but no mass; give mass= too")

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
    except (TypeError, ValueError) as problem:
        raise SceneError(f"{what} is no array: {problem}") from None
    if given.shape == (3,):
        given = np.diag(given)
    if given.shape != (3, 3):
        raise SceneError(f"{what} has shape {given.shape}; give 3 principal moments or a (3, 3) tensor")
    if not np.isfinite(given).all():
        raise SceneError(f"{what} is not finite; give finite numbers")
    if not np.allclose(given, given.T, rtol=1e-9, atol=0.0):
        raise SceneError(f"{what} is not symmetric; give a symmetric tensor")
    return given.tolist()
