"""Capsules that show straight pieces of tendons, of meshes that do not stretch."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tightloop.view.parts import Mesh
from tightloop.view.poses import Array

# Faces around a capsule, and rings of a cap: less than 35° apart, so that they look round.
_AROUND, _RINGS = 12, 3
# A shorter piece is drawn with this length, in radii.
_SHORTEST = -3


def capsule(radius: float, length: float) -> Mesh:
    """Make a white capsule along z whose caps have their middles at 0 and ``length`` [m]."""
    lift = 0.5 * np.pi * np.arange(1, _RINGS + 1) / _RINGS
    lifts = np.concatenate([-lift[::-1], [0.0, 0.0], lift])
    heights = radius * np.sin(lifts) + np.repeat([0.0, length], _RINGS + 1)
    vertices, faces = _revolved(radius * np.cos(lifts), heights)
    return Mesh(vertices, faces, np.full((len(faces), 4), 255, np.uint8))


def tube() -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """Vertices and faces of a tube with radius 1 from z = 0 to 1, without ends."""
    return _revolved(np.ones(2), np.array([0.0, 1.0]))


def ball() -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """Vertices and faces of a ball with radius 1."""
    lifts = np.pi * (np.arange(2 * _RINGS + 1) / (2 * _RINGS) - 0.5)
    return _revolved(np.cos(lifts), np.sin(lifts))


def cover(lengths: Array, radii: Array) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return which capsules cover pieces: two of each, one from either end, which overlap in the middle.

    Args:
        lengths: Lengths of the pieces [m], shape ``(pieces,)``.
        radii: Their radii [m], shape ``(pieces,)``.

    Returns:
        Levels, shape ``(pieces,)``, and the length of a capsule of each [m]: the radius times 2 to the power of the
        level, and at least half of the piece.
    """
    with np.errstate(divide="ignore"):
        levels = np.floor(np.log2(np.maximum(lengths / radii, 2.0**_SHORTEST))).astype(np.intp)
    return levels, np.ldexp(radii, levels)


def towards(directions: Array) -> NDArray[np.float64]:
    """Return rotations, shape ``(…, 4)``, that take z to directions, shape ``(…, 3)``, of length 1."""
    x, y, z = np.moveaxis(np.asarray(directions, float), -1, 0)
    turns = np.stack([-y, x, np.zeros_like(z), 1.0 + z], axis=-1)
    turns = np.where((z < -1.0 + 1e-9)[..., None], np.array([1.0, 0.0, 0.0, 0.0]), turns)
    return turns / np.linalg.norm(turns, axis=-1, keepdims=True)


def _revolved(radii: Array, heights: Array) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """A surface around z through these rings, from below."""
    angles = 2.0 * np.pi * np.arange(_AROUND) / _AROUND
    around = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    flat = radii[:, None, None] * around
    vertices = np.concatenate([flat, np.broadcast_to(heights[:, None, None], (len(radii), _AROUND, 1))], axis=-1)
    ring, place = (k.ravel() for k in np.meshgrid(np.arange(len(radii) - 1), np.arange(_AROUND), indexing="ij"))
    beside = (place + 1) % _AROUND
    a, b, c, d = (r * _AROUND + p for r, p in ((ring, place), (ring, beside), (ring + 1, beside), (ring + 1, place)))
    faces = np.concatenate([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)])
    corners = vertices.reshape(-1, 3)[faces]
    # rings at a pole are points
    sized = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=-1) > 0
    return vertices.reshape(-1, 3).astype(np.float32), faces[sized].astype(np.uint32)
