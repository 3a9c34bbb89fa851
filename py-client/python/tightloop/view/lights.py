"""Lights of MuJoCo models, which take the place of the fixed lights of pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.mujoco import saved
from tightloop.view.poses import Array, rotate

#: Arrays of an exported model that say where lights are, and how they shine.
ARRAYS = (
    *("light_type", "light_type.names", "light_mode", "light_mode.names", "light_bodyid", "light_targetbodyid"),
    *("light_pos", "light_dir", "light_pos0", "light_poscom0", "light_dir0", "light_active", "light_castshadow"),
    *("light_attenuation", "light_cutoff", "light_exponent", "light_ambient", "light_diffuse", "light_specular"),
    *("vis.headlight.active", "vis.headlight.ambient", "vis.headlight.diffuse", "vis.headlight.specular"),
    *("body_parentid", "body_mass", "body_ipos"),
)
#: Columns of the numbers of a lamp: see `rows`.
COLUMNS = 22
# Lights that have a place, and the half angle of their cones where that is not the model's [rad].
_PLACED = {"mjLIGHT_SPOT": None, "mjLIGHT_POINT": np.pi}
_COLORS = ("ambient", "diffuse", "specular")
_SHOWN = (*_PLACED, "mjLIGHT_DIRECTIONAL")


@dataclass(frozen=True, eq=False)
class Lamp:
    """A light where it shines.

    Attributes:
        position: Where it is [m], shape ``(3,)``; None where it shines from far off.
        direction: Where it shines to, of length 1, shape ``(3,)``.
        ambient: Red, green and blue, in parts of a surface's colour, from everywhere.
        diffuse: The same on surfaces that face it.
        specular: The same of highlights.
        attenuation: What its light is divided by: a number, per distance [1/m], and per its square [1/m²].
        cutoff: Half the angle of its cone [rad]; π shines everywhere.
        exponent: Power of the cosine of the angle from its direction.
        shadows: Whether it may cast shadows.
    """

    position: NDArray[np.float64] | None
    direction: NDArray[np.float64]
    ambient: NDArray[np.float64]
    diffuse: NDArray[np.float64]
    specular: NDArray[np.float64]
    attenuation: NDArray[np.float64]
    cutoff: float
    exponent: float
    shadows: bool

    def far(self, middle: Array) -> Lamp:
        """Return a light from far off that shines as this one does in the middle of a world."""
        if self.position is None:
            return self
        direction = _unit(np.asarray(middle, float) - self.position)
        return replace(self, position=None, direction=direction, attenuation=np.array([1.0, 0.0, 0.0]))


@dataclass(frozen=True, eq=False)
class _Model:
    """Lights of a model, with the places of its bodies in ``body_q``."""

    found: dict[str, NDArray[Any]]
    bodies: NDArray[np.intp]
    types: list[str]
    modes: list[str]


class Lights:
    """The lights of a scene's models. There are none where no model has an active ``<light>``."""

    def __init__(self) -> None:
        self._models: list[_Model] = []

    def __len__(self) -> int:
        return sum(len(self._active(model)) for model in self._models)

    def add(self, found: dict[str, NDArray[Any]], bodies: Sequence[int]) -> None:
        """Add the lights of a model.

        Args:
            found: Its arrays, `ARRAYS`.
            bodies: Where its bodies are in ``body_q``.
        """
        model = _Model(found, np.array(bodies), saved.kinds(found, "light_type"), saved.kinds(found, "light_mode"))
        if self._active(model):
            self._models.append(model)

    def lamps(self, body_q: Array) -> list[Lamp]:
        """Return the lights in a world, without those at the camera.

        Args:
            body_q: Poses of its bodies, shape ``(bodies, 7)``.
        """
        body_q = np.asarray(body_q, float)
        return [self._lamp(model, light, body_q) for model in self._models for light in self._active(model)]

    def headlight(self, forward: Array) -> list[Lamp]:
        """Return the light at a camera that looks forward, of the first model; none where that is off."""
        if not self._models or not self._models[0].found["vis.headlight.active"].any():
            return []
        found = self._models[0].found
        ambient, diffuse, specular = (found[f"vis.headlight.{part}"].ravel() for part in _COLORS)
        direction, none = _unit(np.asarray(forward, float)), np.array([1.0, 0, 0])
        return [Lamp(None, direction, ambient, diffuse, specular, none, np.pi, 0.0, shadows=False)]

    @staticmethod
    def _active(model: _Model) -> list[int]:
        on = model.found["light_active"].ravel()
        return [light for light, kind in enumerate(model.types) if on[light] and kind in _SHOWN]

    def _lamp(self, model: _Model, light: int, body_q: Array) -> Lamp:
        found, kind = model.found, model.types[light]
        position, direction = _place(model, light, body_q)
        is_placed = kind in _PLACED
        cutoff = _PLACED.get(kind) or np.radians(float(found["light_cutoff"].ravel()[light]))
        ambient, diffuse, specular = (found[f"light_{part}"].reshape(-1, 3)[light] for part in _COLORS)
        return Lamp(
            position if is_placed else None,
            _unit(direction),
            ambient,
            diffuse,
            specular,
            found["light_attenuation"].reshape(-1, 3)[light],
            float(cutoff),
            float(found["light_exponent"].ravel()[light]) if kind == "mjLIGHT_SPOT" else 0.0,
            shadows=bool(found["light_castshadow"].ravel()[light]),
        )


def rows(lamps: Sequence[Lamp]) -> NDArray[np.float64]:
    """Return lamps as the renderer takes them, shape ``(lamps, COLUMNS)``."""
    made = np.zeros((len(lamps), COLUMNS))
    for row, lamp in zip(made, lamps, strict=True):
        row[0] = lamp.position is not None
        row[1:4] = 0.0 if lamp.position is None else lamp.position
        row[4:19] = np.concatenate([lamp.direction, lamp.ambient, lamp.diffuse, lamp.specular, lamp.attenuation])
        row[19:] = lamp.cutoff, lamp.exponent, lamp.shadows
    return made


def _place(model: _Model, light: int, body_q: Array) -> tuple[Array, Array]:
    """Return position and direction of a light (MuJoCo: ``mj_camlight``)."""

    def own(name: str) -> Array:
        return model.found[name].reshape(-1, 3)[light]

    mode, poses = model.modes[light], body_q[model.bodies]
    body, target = (int(model.found[name].ravel()[light]) for name in ("light_bodyid", "light_targetbodyid"))
    # the model may be turned in the scene
    world = poses[0, 3:]
    if mode in ("mjCAMLIGHT_TRACK", "mjCAMLIGHT_TRACKCOM"):
        offset = "light_pos0" if mode == "mjCAMLIGHT_TRACK" else "light_poscom0"
        middle = poses[body, :3] if mode == "mjCAMLIGHT_TRACK" else _center(model, body, poses)
        return middle + rotate(world, own(offset)), rotate(world, own("light_dir0"))
    position = poses[body, :3] + rotate(poses[body, 3:], own("light_pos"))
    if mode in ("mjCAMLIGHT_TARGETBODY", "mjCAMLIGHT_TARGETBODYCOM") and target >= 0:
        middle = poses[target, :3] if mode == "mjCAMLIGHT_TARGETBODY" else _center(model, target, poses)
        return position, middle - position
    return position, rotate(poses[body, 3:], own("light_dir"))


def _center(model: _Model, root: int, poses: Array) -> Array:
    """Return the centre of mass of a body and of what it carries [m]."""
    parents, masses = model.found["body_parentid"].ravel(), model.found["body_mass"].ravel()
    carried = np.zeros(len(parents), bool)
    carried[root] = True
    for body in range(root + 1, len(parents)):
        carried[body] = carried[parents[body]]
    centers = poses[carried, :3] + rotate(poses[carried, 3:], model.found["body_ipos"].reshape(-1, 3)[carried])
    whole = masses[carried].sum()
    return masses[carried] @ centers / whole if whole > 0 else poses[root, :3]


def _unit(vector: Array) -> NDArray[np.float64]:
    length = float(np.linalg.norm(vector))
    return np.asarray(vector, float) / length if length > 0 else np.array([0.0, 0.0, -1.0])
