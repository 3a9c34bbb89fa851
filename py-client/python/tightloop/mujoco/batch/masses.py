"""Masses and inertias of bodies that differ between simulations, as one scale per body."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tightloop.errors import ArgumentError
from tightloop.mujoco.batch.library import mujoco

Array = NDArray[Any]

#: Two scales of a body are the same below this difference: float32 rounds to 6e-8 [–].
_SAME = 1e-6


class Masses:
    """Scale of each body: tightloop multiplies mass and inertia with one number.

    Args:
        model: The model.
        mass: Masses, ``(n, nbody)`` [kg].
        inertia: Moments of inertia, ``(n, nbody, 3)`` [kg·m²].
    """

    FIELDS: ClassVar = ("body_mass", "body_inertia")

    def __init__(self, model: Any, mass: Array, inertia: Array) -> None:
        self._model, self._mass, self._inertia = model, mass, inertia

    def scale(self, ids: Array) -> Array:
        """Return the scales, ``(n, nbody)`` [–].

        Raises:
            ArgumentError: The inertia of a body that rotates is scaled by another number than its mass.
        """
        mass, moments = np.asarray(self._model.body_mass), np.asarray(self._model.body_inertia)
        scale = np.ones((len(self._mass), len(mass)))
        np.divide(self._mass, mass, out=scale, where=mass > 0.0)
        asked = ids if len(self._mass) > 1 else np.zeros(1, np.int64)
        rotating = self._rotating()
        expected = moments * scale[asked][..., None]
        given = self._inertia[ids if len(self._inertia) > 1 else np.zeros(1, np.int64)]
        wrong = np.abs(given - expected) > _SAME * np.abs(expected)
        wrong = wrong.any(axis=-1) & rotating
        if wrong.any():
            sim, body = np.argwhere(wrong)[0]
            name = self._model.body(int(body)).name or f"body {body}"
            raise ArgumentError(
                f"sim {ids[sim]}: body_mass of `{name}` is {scale[asked][min(sim, len(asked) - 1), body]:g} times the "
                'model\'s and body_inertia is not; tightloop scales both alike, so write expand("body_inertia") with '
                "the same factor"
            )
        return scale

    def _rotating(self) -> Array:
        """Bodies that may rotate: one without hinge, ball and free joint on its way to the world never does."""
        model = self._model
        turns = np.zeros(model.nbody, bool)
        for body in range(1, model.nbody):
            first, count = model.body_jntadr[body], model.body_jntnum[body]
            own = model.jnt_type[first : first + count] != mujoco.mjtJoint.mjJNT_SLIDE
            turns[body] = turns[model.body_parentid[body]] or bool(own.any())
        return turns
