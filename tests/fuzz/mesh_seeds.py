"""A tetrahedron in each format of meshes, as bytes."""

import base64
import json
import struct

CORNERS = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
FACES = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)]


def files() -> dict[tuple[str, str], bytes | str]:
    """All files, by the target and the name of the seed."""
    return stl_files() | obj_files() | dae_files() | gltf_files()


def stl_files() -> dict[tuple[str, str], bytes | str]:
    """As text and in binary."""
    facets, records = "", b""
    for face in FACES:
        corners = [CORNERS[corner] for corner in face]
        vertices = "".join("vertex {} {} {}\n".format(*corner) for corner in corners)
        facets += f"facet normal 0 0 1\nouter loop\n{vertices}endloop\nendfacet\n"
        records += struct.pack("<12fH", 0, 0, 1, *(x for corner in corners for x in corner), 0)
    return {
        ("mesh_stl", "text.stl"): f"solid a\n{facets}endsolid a\n",
        ("mesh_stl", "binary.stl"): bytes(80) + struct.pack("<I", len(FACES)) + records,
    }


def obj_files() -> dict[tuple[str, str], bytes | str]:
    """Plain, with materials, and with colours of vertices."""
    vertices = "".join("v {} {} {}\n".format(*corner) for corner in CORNERS)
    faces = "".join("f {} {} {}\n".format(*(corner + 1 for corner in face)) for face in FACES)
    textured = "".join("f {}/1 {}/2/1 {}/-1\n".format(*(corner + 1 for corner in face)) for face in FACES)
    materials = (
        f"mtllib mesh.mtl\n{vertices}vt 0 0\nvt 1 0\nusemtl red\n{faces}usemtl wood\n{textured}\n#mtl\n"
        "newmtl red\nKd 1 0 0\nd 0.5\nnewmtl wood\nTr 0.2\nmap_Kd -s 1 1 1 wood.png\n"
    )
    return {
        ("mesh_obj", "plain.obj"): vertices + faces,
        ("mesh_obj", "materials.obj"): materials,
        ("mesh_obj", "colors.obj"): vertices.replace("\n", " 1 0.5 0\n") + "f 1 2 \\\n3 4\n",
    }


def dae_files() -> dict[tuple[str, str], bytes | str]:
    """Triangles and polygons of one colour; strips, fans and polygons with an image, colours of corners, and a skin."""
    numbers = " ".join(str(x) for corner in CORNERS for x in corner)
    corners = " ".join(str(corner) for face in FACES for corner in face)
    effect = (
        '<effect id="e"><profile_COMMON><technique sid="t"><lambert><diffuse><color>1 0 0 1</color></diffuse></lambert>'
        "</technique></profile_COMMON></effect>"
    )
    columns = "".join(f'<param name="{name}" type="float"/>' for name in "XYZ")
    accessor = f'<accessor source="#p-array" count="4" stride="3">{columns}</accessor>'
    accessor = f"<technique_common>{accessor}</technique_common>"
    vertex = '<input semantic="VERTEX" source="#v" offset="0"/>'
    bound = '<instance_material symbol="m" target="#m"/>'
    bound = f"<bind_material><technique_common>{bound}</technique_common></bind_material>"
    pieces = {
        "triangles": f'<triangles count="4" material="m">{vertex}<p>{corners}</p></triangles>',
        "polylist": f'<polylist count="4" material="m">{vertex}<vcount>3 3 3 3</vcount><p>{corners}</p></polylist>',
    }
    written = {}
    for name, piece in pieces.items():
        written["mesh_dae", name + ".dae"] = f"""<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="0.01" name="centimeter"/><up_axis>Y_UP</up_axis></asset>
<library_effects>{effect}</library_effects>
<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="p-array" count="12">{numbers}</float_array>{accessor}</source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
{piece}
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n"><matrix>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</matrix>
<rotate>0 0 1 90</rotate><translate>1 2 3</translate><scale>1 1 2</scale>
<instance_geometry url="#g">{bound}</instance_geometry>
</node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene>
</COLLADA>
"""
    return written | {("mesh_dae", "looks.dae"): DAE_LOOKS}


def gltf_files() -> dict[tuple[str, str], bytes | str]:
    """In binary, and as JSON with its buffer; with images, colours of vertices, a skin, strips and fans."""
    positions = struct.pack("<12f", *(x for corner in CORNERS for x in corner))
    indices = struct.pack("<12H", *(corner for face in FACES for corner in face))
    buffer = positions + indices
    scene = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [
            {"children": [1], "scale": [1, 1, 2]},
            {"mesh": 0, "translation": [1, 0, 0], "rotation": [0, 0, 0, 1]},
        ],
        "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 0.5]}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0, "mode": 4}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 1]},
            {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": len(positions)},
            {"buffer": 0, "byteOffset": len(positions), "byteLength": len(indices)},
        ],
        "buffers": [{"byteLength": len(buffer)}],
    }
    text = json.dumps(scene).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(buffer), b"BIN\0") + buffer
    glb = struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
    return {
        ("mesh_gltf", "binary.glb"): glb,
        ("mesh_gltf", "embedded.gltf"): json.dumps(with_buffer(scene, buffer)),
        ("mesh_gltf", "looks.gltf"): json.dumps(gltf_looks(), separators=(",", ":")),
    }


def with_buffer(scene: dict, buffer: bytes) -> dict:
    """A scene with its buffer inside."""
    uri = "data:application/octet-stream;base64," + base64.b64encode(buffer).decode()
    return scene | {"buffers": [{"byteLength": len(buffer), "uri": uri}]}


def gltf_looks() -> dict:
    """A scene with what the first one lacks."""
    positions = struct.pack("<12f", *(x for corner in CORNERS for x in corner))
    parts = [positions, bytes((0, 1, 2, 3)), bytes((255, 0, 0, 255)) * 4, struct.pack("<8f", *([0.25] * 8))]
    views, end = [], 0
    for part in parts:
        views.append({"buffer": 0, "byteOffset": end, "byteLength": len(part)})
        end += len(part)
    attributes = {"POSITION": 0, "COLOR_0": 2, "TEXCOORD_0": 3}
    primitives = [{"attributes": attributes, "indices": 1, "material": at, "mode": 5 + at} for at in range(2)]
    primitives.append({"attributes": {"POSITION": 0}, "mode": 4})
    images = [{"bufferView": 1, "mimeType": "image/png"}, {"uri": "data:image/png;base64,aGk="}, {"uri": "a.png"}]
    base = [{"baseColorTexture": {"index": at}, "baseColorFactor": [1, 0.5, 0, 1]} for at in range(2)]
    scene = {
        "asset": {"version": "2.0"},
        "nodes": [{"mesh": 0, "skin": 0}, {"mesh": 0, "matrix": [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 1, 2, 3, 1]}],
        "scenes": [{"nodes": [0, 1]}],
        "skins": [{"joints": [1]}],
        "meshes": [{"primitives": primitives}],
        "materials": [{"pbrMetallicRoughness": each} for each in base],
        "textures": [{"source": at} for at in range(3)],
        "images": images,
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 1]},
            {"bufferView": 1, "componentType": 5121, "count": 4, "type": "SCALAR"},
            {"bufferView": 2, "componentType": 5121, "normalized": True, "count": 4, "type": "VEC4"},
            {"bufferView": 3, "componentType": 5126, "count": 4, "type": "VEC2"},
        ],
        "bufferViews": views,
    }
    return with_buffer(scene, b"".join(parts))


DAE_LOOKS = """<COLLADA><asset><up_axis>X_UP</up_axis></asset>
<library_images><image id="i"><init_from>a.png</init_from></image></library_images>
<library_effects><effect id="e"><profile_COMMON>
<newparam sid="u"><surface type="2D"><init_from>i</init_from></surface></newparam>
<newparam sid="s"><sampler2D><source>u</source></sampler2D></newparam>
<newparam sid="c"><float4>1 0 0 1</float4></newparam>
<technique><phong><diffuse><texture texture="s" texcoord="t"/></diffuse></phong></technique></profile_COMMON></effect>
<effect id="f"><profile_COMMON><technique><blinn><diffuse><param ref="c"/></diffuse>
<transparent opaque="RGB_ZERO"><color>1 1 1 1</color></transparent><transparency><float>0.5</float></transparency>
</blinn></technique></profile_COMMON></effect></library_effects>
<library_materials><material id="m"><instance_effect url="#e"/></material>
<material id="n"><instance_effect url="#f"/></material></library_materials>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a">0 0 0 1 0 0 0 1 0 0 0 1</float_array></source>
<source id="k"><float_array id="b">1 0 0 1 0 1 0 1</float_array><technique_common>
<accessor source="#b" count="2" stride="4" offset="0"/></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/><input semantic="TEXCOORD" source="#p"/></vertices>
<tristrips material="m"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2 3</p><p>0 2 1</p></tristrips>
<trifans material="n"><input semantic="VERTEX" source="#v" offset="1"/><input semantic="COLOR" source="#k" offset="0"/>
<p>0 0 1 1 0 2 1 3</p></trifans>
<polygons><input semantic="VERTEX" source="#v" offset="0"/><ph><p>0 1 2 3</p><h>0 1 2</h></ph></polygons>
</mesh></geometry></library_geometries>
<library_controllers><controller id="l"><skin source="#g"><bind_shape_matrix>2 0 0 0 0 2 0 0 0 0 2 0 0 0 0 1
</bind_shape_matrix></skin></controller></library_controllers>
<library_nodes><node id="o"><instance_geometry url="#g"><bind_material><technique_common>
<instance_material symbol="m" target="#m"/></technique_common></bind_material></instance_geometry></node>
</library_nodes>
<library_visual_scenes><visual_scene><node><instance_node url="#o"/><instance_controller url="#l"><bind_material>
<technique_common><instance_material symbol="n" target="#n"/></technique_common></bind_material></instance_controller>
</node></visual_scene></library_visual_scenes></COLLADA>
"""
