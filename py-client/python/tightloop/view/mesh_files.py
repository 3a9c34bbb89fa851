"""Files of visuals: COLLADA, OBJ, STL and glTF to triangles with the colours of their materials, in metres and z up.

Units, axes and scenes mean what they mean where collision meshes are read: COLLADA has its unit and its ``up_axis``,
glTF is in metres and y up, STL and OBJ are taken as they are.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from tightloop.errors import MissingLibrary
from tightloop.view import dependencies as needs
from tightloop.view import paint
from tightloop.view.surface import Surface, Unreadable, joined

# Largest file [bytes], as of collision meshes.
_FILE_MAX = 256 << 20
# From y up to z up: (x, y, z) to (x, -z, y).
_Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])


def read(path: str | Path) -> Surface:
    """Read a file.

    Args:
        path: A file with the ending dae, obj, stl, glb or gltf.

    Raises:
        Unreadable: Why it cannot be shown.
    """
    path = Path(path)
    ending = path.suffix.lower()
    if ending not in (".dae", ".obj", ".stl", ".glb", ".gltf"):
        raise Unreadable(f"its ending is `{ending}`; it must be dae, obj, stl, glb or gltf")
    try:
        size = path.stat().st_size
        if size > _FILE_MAX:
            raise Unreadable(f"it has {size >> 20} MiB, the limit is {_FILE_MAX >> 20}; simplify it")
        if ending == ".dae":
            from tightloop.view import collada_file

            return collada_file.read(path)
        return _read(path, ending)
    except (Unreadable, MissingLibrary):
        raise
    except OSError as error:
        raise Unreadable(f"it cannot be read: {error.strerror or error}") from error
    except MemoryError:
        raise Unreadable("it needs more memory than there is") from None
    except Exception as error:
        # the libraries let pass whatever a broken file leads them to
        reason = str(error).strip().split("\n")[0][:200]
        raise Unreadable(f"{reason or type(error).__name__}; export it again") from error


def _read(path: Path, ending: str) -> Surface:
    needs.check("trimesh")
    import trimesh

    options: dict[str, Any] = {"merge_primitives": False} if ending in (".glb", ".gltf") else {}
    scene = trimesh.load_scene(path, process=False, **options)
    turn = _Y_UP if ending in (".glb", ".gltf") else np.eye(4)
    pieces = []
    for node in scene.graph.nodes_geometry:
        frame, name = scene.graph[node]
        mesh = scene.geometry[name]
        if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces):
            pieces.append(_piece(mesh, turn @ frame, ending))
    return joined(pieces)


def _piece(mesh: Any, frame: Any, ending: str) -> Surface:
    vertices = np.asarray(mesh.vertices) @ frame[:3, :3].T + frame[:3, 3]
    faces = np.asarray(mesh.faces)
    if np.linalg.det(frame[:3, :3]) < 0:
        faces = faces[:, ::-1]
    colors = np.zeros((len(faces), 4), np.uint8)
    found = _colors(mesh, ending)
    if found is not None:
        colors[:] = found
    return Surface(vertices, faces, colors, np.full(len(faces), found is not None))


def _colors(mesh: Any, ending: str) -> Any:
    """Colours of a mesh's faces, one for all or one each; `None` where its file gives none."""
    visual = mesh.visual
    is_gltf = ending in (".glb", ".gltf")
    if visual.kind in ("vertex", "face"):
        if ending == ".stl":
            return None  # two bytes of each facet, which mean a colour to one program and another to the next
        # glTF's numbers are proportional to light
        return paint.to_screen(visual.face_colors) if is_gltf else visual.face_colors
    if visual.kind != "texture":
        return None
    if is_gltf:
        return _colors_of_gltf(mesh, visual)
    material = visual.material
    image = getattr(material, "image", None)
    if image is not None and "file_path" not in image.info:
        image = None  # what trimesh puts where there is no material
    if image is None and "kd" not in material.kwargs:
        return None
    color = np.array(material.diffuse, np.float64)
    color = np.append(color, 255)[:4] if image is None else _sampled(image, visual.uv, mesh.faces)
    return np.round(color * [1, 1, 1, _opacity(material)]).astype(np.uint8)


def _opacity(material: Any) -> float:
    """MTL's ``d``, or what ``Tr`` leaves; what would be invisible is taken as a slip."""
    for key, opacity in (("d", lambda value: value), ("tr", lambda value: 1 - value)):
        try:
            value = opacity(float(material.kwargs[key][-1]))
        except (KeyError, IndexError, TypeError, ValueError):
            continue
        if 0 < value <= 1:
            return value
    return 1.0


def _colors_of_gltf(mesh: Any, visual: Any) -> Any:
    """Factor times texture times vertex colour, as the format has it."""
    material = visual.material
    factor = np.full(4, 255.0) if material.baseColorFactor is None else np.asarray(material.baseColorFactor, np.float64)
    shares = visual.vertex_attributes.get("color") if visual.vertex_attributes else None
    if shares is not None:
        shares = np.asarray(shares)
        top = np.iinfo(shares.dtype).max if shares.dtype.kind == "u" else 1.0
        shares = np.concatenate([shares / top, np.ones((len(shares), 1))], axis=1)[:, :4]
        factor = factor * shares[mesh.faces].mean(axis=1)
    color = paint.to_screen(factor)
    if material.baseColorTexture is None:
        return color
    # both as a screen has them: right where one of them is white, which is nearly always
    return np.round(_sampled(material.baseColorTexture, visual.uv, mesh.faces) * (color / 255.0)).astype(np.uint8)


def _sampled(image: Any, uv: Any, faces: Any) -> Any:
    if uv is None or len(uv) <= np.max(faces):
        return np.array(paint.image_mean(image), np.float64)
    return paint.from_texture(image, uv, faces)
