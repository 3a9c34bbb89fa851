"""Meshes to draw in batches: all parts of a body with one colour form one mesh, which identical bodies share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.view.parts import Part
from tightloop.view.poses import place

# A mesh with more colours gets them quantized, since each colour is a mesh to send in every frame.
_COLORS_MAX = 6
# Edges with a larger angle stay sharp when shaded.
_CREASE = np.radians(35)


@dataclass(frozen=True)
class BatchedMesh:
    """A mesh of one colour, in the frame of its bodies.

    Attributes:
        vertices: Shape ``(vertices, 3)`` [m].
        faces: Shape ``(faces, 3)``.
        color: Red, green, blue and opacity, 0 to 255.
        bodies: Indices of the bodies in ``body_names``; (-1,) is the world.
        flat: Whether each face is shaded on its own, as those of height fields.
        closed: Whether the meshes of a body enclose it and face outwards, so that no face is seen from behind.
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]
    color: tuple[int, int, int, int]
    bodies: tuple[int, ...]
    closed: bool
    flat: bool


def batched_meshes(parts: Sequence[Part]) -> list[BatchedMesh]:
    """Merge parts of one kind into as few meshes as possible."""
    of_body: dict[tuple[int, bool], list[Part]] = {}
    for part in parts:
        of_body.setdefault((part.body, part.shape == "hfield"), []).append(part)
    # bodies with the same meshes at the same poses, such as two fingers, are identical; the world is not a body
    identical: dict[tuple[Any, ...], list[tuple[int, bool]]] = {}
    for (body, flat), own in of_body.items():
        key = (body < 0, flat, *((id(part.mesh), np.asarray(part.pose).tobytes()) for part in own))
        identical.setdefault(key, []).append((body, flat))
    return [
        mesh
        for same in identical.values()
        for mesh in _meshes_of(of_body[same[0]], tuple(body for body, _ in same), flat=same[0][1])
    ]


def _meshes_of(parts: list[Part], bodies: tuple[int, ...], *, flat: bool) -> list[BatchedMesh]:
    counts = np.cumsum([0, *(len(part.mesh.vertices) for part in parts)])
    vertices = np.concatenate([place(np.asarray(part.pose), part.mesh.vertices) for part in parts])
    faces = np.concatenate([part.mesh.faces + first for part, first in zip(parts, counts, strict=False)])
    colors, which = _few(np.concatenate([part.mesh.colors for part in parts]))
    # height fields are closed, and so large that to look takes long
    closed = flat or all(_is_closed(part.mesh.vertices, part.mesh.faces) for part in parts)
    surface = _used if flat else _creased
    return [
        BatchedMesh(
            *surface(vertices, faces[which == color]),
            (int(red), int(green), int(blue), int(opacity)),
            bodies,
            closed,
            flat,
        )
        for color, (red, green, blue, opacity) in enumerate(colors)
    ]


def _used(vertices: NDArray[Any], faces: NDArray[Any]) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """The same faces without vertices that they do not have."""
    kept, renumbered = np.unique(faces, return_inverse=True)
    return vertices[kept].astype(np.float32), renumbered.reshape(-1, 3).astype(np.uint32)


def _is_closed(vertices: NDArray[Any], faces: NDArray[Any]) -> bool:
    """Whether each edge is run along as often in one direction as in the other, and the inside is behind the faces."""
    places, same = np.unique(vertices.astype(np.float32), axis=0, return_inverse=True)
    faces = same.ravel()[faces].astype(np.int64)
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    forth = np.sort(start * len(places) + end)
    back = np.sort(end * len(places) + start)
    corners = places[faces].astype(np.float64)
    volume = np.sum(corners[:, 0] * np.cross(corners[:, 1], corners[:, 2])) / 6.0
    return bool(np.array_equal(forth, back) and volume > 0.0)


def _few(colors: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], NDArray[np.intp]]:
    """The distinct colours, and which one each face has; near ones are one where there are too many."""
    packed, which = np.unique(np.ascontiguousarray(colors).view(np.uint32).ravel(), return_inverse=True)
    distinct = packed.view(np.uint8).reshape(-1, 4)
    for bits in range(1, 9):
        if len(distinct) <= _COLORS_MAX:
            break
        distinct, which = np.unique(colors >> bits if bits < 8 else colors * 0, axis=0, return_inverse=True)
    means = np.stack([colors[which.ravel() == color].mean(axis=0) for color in range(len(distinct))])
    return means.astype(np.uint8), which.ravel()


def _creased(vertices: NDArray[Any], faces: NDArray[Any]) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """The same surface, where faces share a corner if a smooth edge joins them: browsers average normals over those."""
    places, same = np.unique(vertices.astype(np.float32), axis=0, return_inverse=True)
    faces = same.ravel()[faces]
    sides = places[faces]
    normals = np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0]).astype(np.float64)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)
    # each side of a face, with its corners in the order of their vertices, beside the other face's
    corners = np.arange(faces.size).reshape(-1, 3)
    ends = np.stack([corners, np.roll(corners, -1, axis=1)], axis=-1).reshape(-1, 2)
    at = faces.ravel()[ends]
    ends = np.take_along_axis(ends, at.argsort(axis=1), axis=1)
    at = np.sort(at, axis=1)
    order = np.lexsort(at.T)
    at, ends = at[order], ends[order]
    bent = np.sum(normals[ends[:-1, 0] // 3] * normals[ends[1:, 0] // 3], axis=1) < np.cos(_CREASE)
    joined = np.all(at[:-1] == at[1:], axis=1) & ~bent
    first, second = ends[:-1][joined].ravel(), ends[1:][joined].ravel()
    # a corner belongs to the least one that smooth edges lead to; as many rounds as faces meet in a corner
    label = np.arange(faces.size)
    while True:
        least = np.minimum(label[first], label[second])
        following = label.copy()
        np.minimum.at(following, first, least)
        np.minimum.at(following, second, least)
        if np.array_equal(following, label):
            break
        label = following
    kept, renumbered = np.unique(label, return_inverse=True)
    return places[faces.ravel()[kept]], renumbered.reshape(-1, 3).astype(np.uint32)
