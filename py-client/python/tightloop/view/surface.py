"""Triangles with colours, as a file gives them: joined, thinned where they are too many, mirrored and scaled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tightloop.view.paint import Colors

#: Most faces of a file that are shown; what has more is thinned.
FACES_MAX = 200_000


class Unreadable(ValueError):
    """A file of a visual that cannot be shown; the message says why."""


@dataclass(eq=False)
class Surface:
    """Triangles, counter-clockwise from outside.

    Attributes:
        vertices: Shape ``(vertices, 3)`` [m].
        faces: Corners of each face, shape ``(faces, 3)``.
        colors: Of each face, shape ``(faces, 4)``.
        painted: Which faces have a colour; those of the others mean nothing. Shape ``(faces,)``.
        notes: What was done to it that its author may not expect, a sentence each without a subject.
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]
    colors: Colors
    painted: NDArray[np.bool_]
    notes: list[str] = field(default_factory=list)

    def scaled(self, scale: Sequence[float]) -> Surface:
        """The same with each axis multiplied; a mirror keeps the outside outside."""
        faces = self.faces[:, ::-1] if np.prod(scale) < 0 else self.faces
        vertices = (self.vertices * np.asarray(scale)).astype(np.float32)
        return Surface(vertices, np.ascontiguousarray(faces), self.colors, self.painted, self.notes)

    def filled(self, color: tuple[int, int, int, int]) -> Colors:
        """The colours, with this one where there is none."""
        colors = self.colors.copy()
        colors[~self.painted] = color
        return colors


def joined(pieces: Sequence[Surface], notes: Sequence[str] = ()) -> Surface:
    """One surface of several, vertices at the same place joined.

    Raises:
        Unreadable: There are no triangles, or numbers that are not finite, or corners that are not there.
    """
    pieces = [piece for piece in pieces if len(piece.faces)]
    if not pieces:
        raise Unreadable("it has no triangles")
    for piece in pieces:
        if not np.isfinite(piece.vertices).all():
            raise Unreadable("it has coordinates that are not finite")
        if piece.faces.min() < 0 or piece.faces.max() >= len(piece.vertices):
            raise Unreadable("it names vertices that are not there")
    firsts = np.cumsum([0, *(len(piece.vertices) for piece in pieces)])
    vertices = np.concatenate([piece.vertices for piece in pieces]).astype(np.float32)
    faces = np.concatenate([piece.faces + first for piece, first in zip(pieces, firsts, strict=False)])
    colors = np.concatenate([piece.colors for piece in pieces])
    painted = np.concatenate([piece.painted for piece in pieces])
    distinct, places = np.unique(np.ascontiguousarray(vertices + 0.0).view("V12"), return_inverse=True)
    vertices = distinct.view(np.float32).reshape(-1, 3)
    whole = _without_slivers(Surface(vertices, places.ravel()[faces].astype(np.uint32), colors, painted, list(notes)))
    if not len(whole.faces):
        raise Unreadable("its triangles have no area")
    return _thinned(_without_strays(whole))


def _without_slivers(surface: Surface) -> Surface:
    """Without triangles of which two corners are one."""
    first, second, third = surface.faces.T
    kept = (first != second) & (second != third) & (third != first)
    return Surface(surface.vertices, surface.faces[kept], surface.colors[kept], surface.painted[kept], surface.notes)


def _without_strays(surface: Surface) -> Surface:
    """Without vertices that no face has."""
    used = np.zeros(len(surface.vertices), bool)
    used[surface.faces] = True
    if used.all():
        return surface
    faces = (np.cumsum(used) - 1)[surface.faces].astype(np.uint32)
    return Surface(surface.vertices[used], faces, surface.colors, surface.painted, surface.notes)


def _thinned(surface: Surface) -> Surface:
    """With vertices in one cell of a grid made one, the grid as fine as the most faces allow."""
    count = len(surface.faces)
    if count <= FACES_MAX:
        return surface
    low = surface.vertices.min(axis=0)
    size = float(np.max(surface.vertices.max(axis=0) - low))
    # faces of a surface grow with the square of the cells along it
    cells = 2048.0
    while True:
        cell = np.floor((surface.vertices - low) * (cells / size)).astype(np.int64)
        keys = (cell[:, 0] * 4096 + cell[:, 1]) * 4096 + cell[:, 2]
        distinct, places = np.unique(keys, return_inverse=True)
        places = places.ravel()
        members = np.bincount(places, minlength=len(distinct))[:, None]
        means = [np.bincount(places, surface.vertices[:, axis], len(distinct)) for axis in range(3)]
        vertices = (np.stack(means, axis=1) / members).astype(np.float32)
        thin = _without_slivers(
            Surface(vertices, places[surface.faces].astype(np.uint32), surface.colors, surface.painted, surface.notes)
        )
        # what two faces have become the same is one
        _, once = np.unique(np.sort(thin.faces, axis=1), axis=0, return_index=True)
        once.sort()
        if len(once) <= FACES_MAX:
            break
        cells *= 0.98 * np.sqrt(FACES_MAX / len(once))
    note = f"has {count:,} triangles and is shown with {len(once):,}, {1000 * size / cells:.2g} mm apart"
    kept = Surface(thin.vertices, thin.faces[once], thin.colors[once], thin.painted[once], [*surface.notes, note])
    return _without_strays(kept)
