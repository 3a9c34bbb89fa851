"""Sample mesh files with one or two boxes in each format, written by hand so that every number is known.

The box reaches from 0 to (1, 2, 3) in the file's own frame and units.
"""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np

SIZE = (1.0, 2.0, 3.0)
# Corner k is on the high side of axis i where bit i of k is set; sides counter-clockwise from outside
CORNERS = np.array([[(k >> axis & 1) * SIZE[axis] for axis in range(3)] for k in range(8)])
_SIDES = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
FACES = np.array([face for a, b, c, d in _SIDES for face in ((a, b, c), (a, c, d))])


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    """What triangles enclose; negative if they are inside out."""
    a, b, c = np.asarray(vertices, np.float64)[np.asarray(faces)].transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def stl(path: Path) -> Path:
    """Binary, without colours."""
    facets = b"".join(struct.pack("<12fH", 0, 0, 0, *CORNERS[face].ravel(), 0x7FFF) for face in FACES)
    path.write_bytes(b"\0" * 80 + struct.pack("<I", len(FACES)) + facets)
    return path


def obj(path: Path, *, mtl: str | None, used: tuple[str, str] = ("red", "green")) -> Path:
    """The lower and upper side of one material, the others of another; ``mtl`` is the material file's text."""
    lines = [f"mtllib {path.stem}.mtl"] if mtl is not None else []
    if mtl is not None:
        path.with_suffix(".mtl").write_text(mtl)
    lines += [f"v {x} {y} {z}" for x, y, z in CORNERS]
    lines += ["vt 0.25 0.25", "vt 0.75 0.75"]
    for material, faces, place in ((used[0], FACES[:4], 1), (used[1], FACES[4:], 2)):
        lines += [f"usemtl {material}"] if material else []
        lines += ["f " + " ".join(f"{corner + 1}/{place}" for corner in face) for face in faces]
    path.write_text("\n".join(lines) + "\n")
    return path


def collada(
    path: Path,
    *,
    asset: str = '<unit meter="1"/><up_axis>Z_UP</up_axis>',
    transform: str = "",
    diffuse: str = "<color>1 0 0 1</color>",
    more: str = "",
    images: str = "",
    bind: bool = True,
    skin: str = "",
) -> Path:
    """One box of one material in a node with this transformation; ``more`` goes into the effect.

    With ``skin``, the matrix of its bind shape, it is the skin of a joint.
    """
    positions = " ".join(str(part) for part in CORNERS.ravel())
    corners = " ".join(f"{corner} 0" for corner in FACES.ravel())
    bound = (
        '<bind_material><technique_common><instance_material symbol="skin" target="#m"/></technique_common>'
        "</bind_material>"
        if bind
        else ""
    )
    shown = f'<instance_geometry url="#g">{bound}</instance_geometry>'
    if skin:
        shown = f'<instance_controller url="#c"><skeleton>#n</skeleton>{bound}</instance_controller>'
    path.write_text(f"""<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
  <asset><created>2026-01-01T00:00:00</created><modified>2026-01-01T00:00:00</modified>{asset}</asset>
  {images}
  <library_effects><effect id="e"><profile_COMMON>{_params(images)}<technique sid="t"><lambert>
    <diffuse>{diffuse}</diffuse>{more}</lambert></technique></profile_COMMON></effect></library_effects>
  <library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
  <library_geometries><geometry id="g"><mesh>
    <source id="p"><float_array id="pa" count="24">{positions}</float_array><technique_common>
      <accessor source="#pa" count="8" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
        <param name="Z" type="float"/></accessor></technique_common></source>
    <source id="t"><float_array id="ta" count="2">0.25 0.25</float_array><technique_common>
      <accessor source="#ta" count="1" stride="2"><param name="S" type="float"/>
        <param name="T" type="float"/></accessor></technique_common></source>
    <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
    <triangles count="{len(FACES)}" material="skin"><input semantic="VERTEX" source="#v" offset="0"/>
      <input semantic="TEXCOORD" source="#t" offset="1" set="0"/><p>{corners}</p></triangles>
  </mesh></geometry></library_geometries>
  {_controller(skin) if skin else ""}
  <library_visual_scenes><visual_scene id="s"><node id="n">{transform}
    {shown}</node></visual_scene></library_visual_scenes>
  <scene><instance_visual_scene url="#s"/></scene>
</COLLADA>""")
    return path


def _controller(matrix: str) -> str:
    """A skin that hangs on one joint."""
    source = '<technique_common><accessor source="#{}" count="1" stride="{}"><param name="{}" type="{}"/></accessor>'
    source += "</technique_common></source>"
    unit = "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"
    return f"""<library_controllers><controller id="c"><skin source="#g">
    <bind_shape_matrix>{matrix}</bind_shape_matrix>
    <source id="j"><Name_array id="ja" count="1">n</Name_array>{source.format("ja", 1, "JOINT", "name")}
    <source id="b"><float_array id="ba" count="16">{unit}</float_array>
      {source.format("ba", 16, "TRANSFORM", "float4x4")}
    <source id="w"><float_array id="wa" count="1">1</float_array>{source.format("wa", 1, "WEIGHT", "float")}
    <joints><input semantic="JOINT" source="#j"/><input semantic="INV_BIND_MATRIX" source="#b"/></joints>
    <vertex_weights count="8"><input semantic="JOINT" source="#j" offset="0"/>
      <input semantic="WEIGHT" source="#w" offset="1"/><vcount>{"1 " * 8}</vcount><v>{"0 0 " * 8}</v></vertex_weights>
  </skin></controller></library_controllers>"""


def _params(images: str) -> str:
    if not images:
        return ""
    return (
        '<newparam sid="surface"><surface type="2D"><init_from>i</init_from></surface></newparam>'
        '<newparam sid="sampler"><sampler2D><source>surface</source></sampler2D></newparam>'
    )


def glb(
    path: Path, *, nodes: list[dict] | None = None, material: dict | None = None, image: bytes | None = None
) -> Path:
    """One box, shown by these nodes (mesh 0), of a material as glTF writes it; the image is texture 0."""
    parts = [CORNERS.astype("<f4").tobytes(), FACES.astype("<u2").tobytes(), np.full((8, 2), 0.25, "<f4").tobytes()]
    parts += [image] if image is not None else []
    views, blob = [], b""
    for part in parts:
        views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": len(part)})
        blob += part + b"\0" * (-len(part) % 4)
    primitive: dict = {"attributes": {"POSITION": 0, "TEXCOORD_0": 2}, "indices": 1}
    nodes = nodes or [{"mesh": 0}]
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "meshes": [{"primitives": [primitive]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3", "min": [0, 0, 0], "max": list(SIZE)},
            {"bufferView": 1, "componentType": 5123, "count": FACES.size, "type": "SCALAR"},
            {"bufferView": 2, "componentType": 5126, "count": 8, "type": "VEC2"},
        ],
        "bufferViews": views,
        "buffers": [{"byteLength": len(blob)}],
    }
    if material is not None:
        primitive["material"] = 0
        document["materials"] = [material]
    if image is not None:
        document |= {"images": [{"bufferView": 3, "mimeType": "image/png"}], "textures": [{"source": 0}]}
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(blob), b"BIN\0") + blob
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
    return path
