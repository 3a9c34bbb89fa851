"""Tendons as capsules of a picture."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.view.parts import Mesh
from tightloop.view.poses import Array
from tightloop.view.tendons.capsules import capsule, cover, towards
from tightloop.view.tendons.paths import Tendons

Layer = tuple[NDArray[np.uint32], NDArray[np.float64], NDArray[np.uint8], NDArray[np.float32]]


class DrawnTendons:
    """Draws tendons with capsules that it adds to a renderer when they are first needed.

    Args:
        tendons: The tendons of a world.
    """

    def __init__(self, tendons: Tendons) -> None:
        self._tendons = tendons
        self._meshes: dict[tuple[float, int], int] = {}

    def layer(
        self, body_q: Array, act: Array | None, offsets: Array, faulted: Array, *, add: Callable[[Mesh], int]
    ) -> Layer:
        """Return meshes, poses, tints and opacities of the capsules in some worlds.

        Args:
            body_q: Poses of bodies, shape ``(worlds, bodies, 7)``.
            act: Activations, shape ``(worlds, activations)``, or None where they are not known.
            offsets: Position of each world on the grid [m], shape ``(worlds, 3)``.
            faulted: Tint of each world: red, green, blue and strength, 0 to 255, shape ``(worlds, 4)``.
            add: Adds a mesh to the renderer, and returns its number.
        """
        segments = self._tendons.segments(body_q)
        ends = segments.ends + np.asarray(offsets)[:, None, None]
        colors = 255 * self._tendons.shown_colors(act, len(body_q))
        strength = np.asarray(faulted, float)[:, None, 3:] / 255
        colors[..., :3] += strength * (np.asarray(faulted, float)[:, None, :3] - colors[..., :3])
        shown_colors = colors[:, segments.tendon].reshape(-1, 4)
        radii = np.tile(self._tendons.radii[segments.tendon], len(body_q))
        first, last = ends.reshape(-1, 2, 3).swapaxes(0, 1)
        lengths = np.linalg.norm(last - first, axis=-1)
        seen = np.isfinite(lengths) & (lengths > 0) & (radii > 0)
        first, last, lengths, radii, shown_colors = (k[seen] for k in (first, last, lengths, radii, shown_colors))
        directions = (last - first) / lengths[:, None]
        levels, own = cover(lengths, radii)
        meshes = self._numbers(radii, levels, own, add)
        poses = np.concatenate([np.hstack([first, towards(directions)]), np.hstack([last, towards(-directions)])])
        tints = np.rint(shown_colors).astype(np.uint8)
        # all of the colour is the tint's
        opacities = (shown_colors[:, 3] / 255).astype(np.float32)
        tints[:, 3] = 255
        return np.tile(meshes, 2), poses, np.tile(tints, (2, 1)), np.tile(opacities, 2)

    def _numbers(self, radii: Array, levels: Array, lengths: Array, add: Callable[[Mesh], int]) -> NDArray[np.uint32]:
        keys: Any = np.stack([radii, levels], axis=-1)
        distinct, first, which = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        numbers = np.zeros(len(distinct), np.uint32)
        for k, (radius, level) in enumerate(distinct):
            key = float(radius), int(level)
            if key not in self._meshes:
                self._meshes[key] = add(capsule(key[0], float(lengths[first[k]])))
            numbers[k] = self._meshes[key]
        return numbers[which.ravel()]
