"""COLLADA: what the visual scene shows, where its nodes put it, with the diffuse colours of its materials.

``<unit meter>`` and ``<up_axis>`` are applied as the specification has them (absent: 1 m, y up), and as they are where
a collision mesh is read. RViz leaves the axes as they are, so a turn is noted.
"""

from __future__ import annotations

from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from tightloop.view import dependencies as needs
from tightloop.view import paint
from tightloop.view.surface import Surface, Unreadable, joined

# To z up: (x, y, z) to (x, -z, y), and to (-y, -z, x).
_TURNS = {
    "Z_UP": np.eye(3),
    "Y_UP": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "X_UP": np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]]),
}


def read(path: Path) -> Surface:
    """Read a file.

    Raises:
        Unreadable: Why it cannot be shown; other exceptions are of broken files, and the library's.
    """
    needs.check("collada")
    content = path.read_bytes()
    if b"<!DOCTYPE" in content or b"<!ENTITY" in content:
        # entities can stand for more text than any memory holds
        raise Unreadable("it has a document type; delete <!DOCTYPE …>")
    file, notes = _loaded(content, path.parent)
    asset: Any = file.assetInfo
    meter = 1.0 if asset is None or asset.unitmeter is None else float(asset.unitmeter)
    if not 0 < meter < np.inf:
        raise Unreadable("<unit meter> is no positive number; write how many metres a unit has")
    axis = "Y_UP" if asset is None else str(asset.upaxis)
    if axis != "Z_UP":
        notes.append(f"is turned from {axis} to z up, as its file says; RViz leaves such files unturned")
    frame = meter * _TURNS[axis]
    pieces = [piece for bound in _bound(file) for piece in _pieces(bound, frame)]
    return joined(pieces, notes)


def _loaded(content: bytes, folder: Path) -> tuple[Any, list[str]]:
    """The file as the library has it, and what there is to say of it."""
    from collada import Collada
    from collada.common import DaeBrokenRefError, DaeError

    def image(name: str) -> bytes:
        try:
            return (folder / name).read_bytes()
        except OSError as error:
            raise DaeBrokenRefError(str(error)) from error

    def load(content: bytes) -> Any:
        return Collada(BytesIO(content), ignore=[DaeError], aux_file_loader=image)

    file = load(content)
    if not file.errors:
        return file, []
    known = {f"#{material.id}" for material in file.materials}
    root, lost = ElementTree.fromstring(content), 0
    for parent in root.iter():
        for child in list(parent):
            if str(child.tag).endswith("}instance_material") and child.get("target") not in known:
                parent.remove(child)
                lost += 1
    if not lost:
        return file, []
    # the library leaves out what is of a material that is broken, such as one whose image is not named
    return load(ElementTree.tostring(root)), ["names materials that are broken or not there, and is shown without them"]


def _bound(file: Any) -> Iterator[Any]:
    """Geometries where the scene puts them; without a scene, each where it is."""
    if file.scene is None:
        for geometry in file.geometries:
            yield geometry.bind(np.eye(4, dtype=np.float32), {})
        return
    yield from file.scene.objects("geometry")
    for controller in file.scene.objects("controller"):
        # a skin as it lies in the file; a morph has no geometry of its own
        if hasattr(controller, "geometry"):
            yield controller.geometry


def _pieces(bound: Any, frame: Any) -> Iterator[Surface]:
    from collada.polylist import BoundPolylist
    from collada.triangleset import BoundTriangleSet

    mirrored = np.linalg.det(bound.matrix[:3, :3]) < 0
    for given in bound.primitives():
        primitive = given.triangleset() if isinstance(given, BoundPolylist) else given
        if not isinstance(primitive, BoundTriangleSet):
            continue  # lines and points are no surface
        if primitive.vertex is None or primitive.vertex_index is None or not len(primitive.vertex_index):
            continue
        corners = np.asarray(primitive.vertex_index).reshape(-1, 3)
        found = _colors(primitive, len(corners))
        colors = np.zeros((len(corners), 4), np.uint8)
        if found is not None:
            colors[:] = found
        if mirrored:
            corners = corners[:, ::-1]
        yield Surface(np.asarray(primitive.vertex) @ frame.T, corners, colors, np.full(len(corners), found is not None))


def _colors(primitive: Any, faces: int) -> Any:
    """Colours of the faces, one for all or one each; `None` where the file gives none."""
    from collada.material import Map

    material = primitive.material
    effect = getattr(material, "effect", None)
    if effect is None:
        return _vertex_colors(primitive.original, faces)
    diffuse = effect.diffuse
    if isinstance(diffuse, Map):
        image = diffuse.sampler.surface.image.pilimage
        if image is None:
            return None
        if not primitive.texcoordset:
            return paint.image_mean(image)
        places = np.asarray(primitive.texcoordset[0])[:, :2]
        return paint.from_texture(image, places, np.asarray(primitive.texcoord_indexset[0]).reshape(-1, 3))
    if diffuse is None:
        return None
    return paint.of_floats([*diffuse[:3], _opacity(effect)])


def _vertex_colors(triangles: Any, faces: int) -> Any:
    """Means of the colours of the corners."""
    sources = triangles.sources.get("COLOR") or []
    if not sources:
        return None
    offset, source = sources[0][0], sources[0][4]
    corners = np.asarray(source.data)[triangles.index.reshape(faces, 3, -1)[:, :, offset]]
    means = corners.mean(axis=1)
    colors = np.full((faces, 4), 255.0)
    colors[:, : means.shape[1]] = 255 * np.clip(means, 0, 1)
    return np.round(colors).astype(np.uint8)


def _opacity(effect: Any) -> float:
    """What ``<transparent>`` and ``<transparency>`` leave; what would be invisible is an exporter's slip."""
    from collada.material import OPAQUE_MODE, Map

    color, share = effect.transparent, effect.transparency
    share = 1.0 if share is None or isinstance(share, Map) else float(share)
    if color is None or isinstance(color, Map):
        return 1.0
    if effect.opaque_mode == OPAQUE_MODE.RGB_ZERO:
        opacity = 1 - share * float(np.mean(color[:3]))
    else:
        opacity = share * float(color[3] if len(color) > 3 else 1)
    return opacity if 0 < opacity <= 1 else 1.0
