"""Mesh files as they look: triangles of the compiled reader, in the colours of their materials and images."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from os import PathLike, fspath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop import _core
from tightloop.view import dependencies
from tightloop.view.meshes import paint
from tightloop.view.meshes.paint import Colors


@dataclass(frozen=True, eq=False)
class VisualMesh:
    """Triangles, counter-clockwise from outside, in metres and z up.

    Attributes:
        vertices: Shape ``(vertices, 3)`` [m].
        faces: Corners of each face, shape ``(faces, 3)``.
        colors: Red, green, blue and opacity of each face, 0 to 255, shape ``(faces, 4)``.
        painted: Which faces have a colour in the file; the others' colours mean nothing. Shape ``(faces,)``.
        notes: What was done to it that its author may not expect, a sentence each without a subject.
        ignored_up_axis: The axis that a COLLADA file says is up, where that is not z and was not applied.
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]
    colors: Colors
    painted: NDArray[np.bool_]
    notes: list[str]
    ignored_up_axis: str | None = None

    def scaled(self, scale: Sequence[float]) -> VisualMesh:
        """The same with each axis multiplied; a mirror keeps the outside outside."""
        faces = self.faces[:, ::-1] if np.prod(scale) < 0 else self.faces
        vertices = (self.vertices * np.asarray(scale)).astype(np.float32)
        return replace(self, vertices=vertices, faces=np.ascontiguousarray(faces))

    @property
    def is_plain(self) -> bool:
        """Whether the faces that have a colour in the file have the same one."""
        own = self.colors[self.painted]
        return not len(own) or bool((own == own[0]).all())

    def filled(self, color: tuple[int, int, int, int], *, whole: bool = False) -> Colors:
        """The colours, with this one where there is none, or everywhere."""
        colors = self.colors.copy()
        colors[... if whole else ~self.painted] = color
        return colors


def read(path: str | PathLike[str], *, collada_up_axis: bool = True) -> VisualMesh:
    """Read a COLLADA, OBJ, STL or glTF file.

    A face with an image has the colour that the image shows where the face lies. One whose image cannot be read has the
    colour of its material.

    Args:
        path: The file.
        collada_up_axis: Whether a COLLADA file is turned from its ``<up_axis>`` to z up.

    Raises:
        SceneError: The file cannot be read; the message says why.
        MissingLibrary: The file has images, and pillow is not installed.
    """
    found = _core.visual_mesh(fspath(path), collada_up_axis)
    colors, painted, notes = found["colors"], found["painted"], found["notes"]
    if found["textures"]:
        dependencies.check("PIL")
    for texture in found["textures"]:
        faces = texture["faces"]
        try:
            sampled = _sampled(texture["image"], texture["uv"])
        except Exception as error:  # pillow's, of whatever is broken in it
            name = "inside it" if isinstance(texture["image"], bytes) else texture["image"]
            notes.append(f"has an image that cannot be read, {name}: {error}")
            continue
        colors[faces] = np.round(sampled * (texture["tints"] / 255.0)).astype(np.uint8)
        painted[faces] = True
    return VisualMesh(found["vertices"], found["faces"], colors, painted, notes, found["ignored_up_axis"])


def _sampled(image: str | bytes, uv: NDArray[np.float32] | None) -> NDArray[Any]:
    from PIL import Image

    with Image.open(BytesIO(image)) if isinstance(image, bytes) else paint.open_image(image) as opened:
        return np.array(paint.image_mean(opened)) if uv is None else paint.from_texture(opened, uv)
