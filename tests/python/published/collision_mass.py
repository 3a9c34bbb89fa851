"""What links without `<inertial>` weigh: their collisions at 1000 kg/m³, each by itself, overlaps twice.

Closed meshes are weighed by the divergence theorem, open ones as the convex hull that MuJoCo makes of them.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
from mujoco_model import Array

DENSITY = 1000.0


class Body(NamedTuple):
    """Mass [kg], centre [m], and inertia about the centre [kg m²]."""

    mass: float
    center: Array
    inertia: Array


class Unweighed(Exception):
    """A mesh that this reader does not support."""


def add_inertial(link: ET.Element, file: Path, package_dirs: tuple[Path, ...]) -> None:
    """Give a link the inertial element that its collisions make."""
    parts = [placed(body_of(part, file, package_dirs), part.find("origin")) for part in link.findall("collision")]
    mass = sum(part.mass for part in parts)
    center = sum(part.mass * part.center for part in parts) / mass
    inertia = sum(part.inertia + part.mass * displaced(part.center - center) for part in parts)
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "origin", xyz=" ".join(repr(float(x)) for x in center))
    ET.SubElement(inertial, "mass", value=repr(float(mass)))
    names = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
    ET.SubElement(inertial, "inertia", {name: repr(float(inertia[at])) for name, at in names.items()})


def displaced(d: Array) -> Array:
    """Inertia of a unit mass at a displacement."""
    return d @ d * np.eye(3) - np.outer(d, d)


def placed(body: Body, origin: ET.Element | None) -> Body:
    """A body in the frame of its collision's origin."""
    xyz, rpy = ("0 0 0" if origin is None else origin.get(name, "0 0 0") for name in ("xyz", "rpy"))
    quat, turn = np.zeros(4), np.zeros(9)
    # URDF's angles are about fixed axes
    mujoco.mju_euler2Quat(quat, np.array(rpy.split(), dtype=float), "XYZ")
    mujoco.mju_quat2Mat(turn, quat)
    turn = turn.reshape(3, 3)
    return Body(body.mass, np.array(xyz.split(), dtype=float) + turn @ body.center, turn @ body.inertia @ turn.T)


def body_of(collision: ET.Element, file: Path, package_dirs: tuple[Path, ...]) -> Body:
    """A collision in its own frame, by the formulas of any handbook."""
    shape = collision.find("geometry/*")
    assert shape is not None, "a collision without shape"
    if shape.tag == "mesh":
        return mesh_of(resolved(shape.get("filename", ""), file, package_dirs), numbers(shape, "scale", "1 1 1"))
    (radius,), (length,) = numbers(shape, "radius"), numbers(shape, "length")
    if shape.tag == "box":
        size = numbers(shape, "size")
        volume, moments = np.prod(size), (size @ size - size**2) / 12
    elif shape.tag == "sphere":
        volume, moments = 4 / 3 * np.pi * radius**3, 2 / 5 * radius**2 * np.ones(3)
    elif shape.tag == "cylinder":
        across = (3 * radius**2 + length**2) / 12
        volume, moments = np.pi * radius**2 * length, np.array([across, across, radius**2 / 2])
    else:
        raise Unweighed(f"<{shape.tag}>")
    return Body(DENSITY * volume, np.zeros(3), np.diag(DENSITY * volume * moments))


def numbers(node: ET.Element, name: str, otherwise: str = "0") -> Array:
    return np.array(node.get(name, otherwise).split(), dtype=float)


def resolved(uri: str, file: Path, package_dirs: tuple[Path, ...]) -> Path:
    """Where a mesh lies; the first of the folders that has it."""
    if not uri.startswith("package://"):
        return file.parent / uri.removeprefix("file://")
    within = uri.removeprefix("package://")
    return next(folder / within for folder in (*package_dirs, *file.parents) if (folder / within).exists())


def mesh_of(path: Path, scale: Array) -> Body:
    """A mesh in its own frame: the solid that it bounds, or its hull if it bounds none."""
    triangles = TRIANGLES.get(path.suffix.lower(), unreadable)(path)
    solid = closed(triangles)
    triangles = (triangles if solid else hull(triangles)) * scale
    # about a point of the mesh, so that nothing is lost far from the origin
    origin = triangles[0, 0].copy()
    a, b, c = (triangles - origin).transpose(1, 0, 2)
    six = np.einsum("ij,ij->i", a, np.cross(b, c))
    sign, volume = np.sign(six.sum()), abs(six.sum()) / 6
    center = sign * (six @ (a + b + c)) / 24 / volume
    corners = (a, b, c, a + b + c)
    second = sign * sum(np.einsum("i,ij,ik->jk", six, corner, corner) for corner in corners) / 120
    second -= volume * np.outer(center, center)
    return Body(DENSITY * volume, origin + center, DENSITY * (np.trace(second) * np.eye(3) - second))


def closed(triangles: Array) -> bool:
    """Whether along every edge as many triangles run forth as back; corners at one place are one."""
    area = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
    _, corner = np.unique(triangles[area > 0].reshape(-1, 3), axis=0, return_inverse=True)
    corner = corner.reshape(-1, 3)
    edges = np.vstack([corner[:, [0, 1]], corner[:, [1, 2]], corner[:, [2, 0]]])
    forth, back = (np.unique(way, axis=0, return_counts=True) for way in (edges, edges[:, ::-1]))
    return all(np.array_equal(one, other) for one, other in zip(forth, back, strict=True))


def hull(triangles: Array) -> Array:
    """Triangles of the convex hull of some others: MuJoCo, which works on float32, tells the corners of its faces."""
    points = np.unique(triangles.reshape(-1, 3), axis=0)
    spec = mujoco.MjSpec()
    spec.add_mesh(name="points", uservert=points.ravel())
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="points")
    model = spec.compile()
    assert model.nmeshvert == len(points), "MuJoCo kept not every point, or not in their order"
    return points[model.mesh_face]


def unreadable(path: Path) -> Array:
    raise Unweighed(f"{path}: this reader knows STL and simple COLLADA only")


def stl(path: Path) -> Array:
    """Corners of a binary STL's triangles, ``(triangles, 3, 3)``."""
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    data = path.read_bytes()
    count = int.from_bytes(data[80:84], "little")
    if len(data) != 84 + record.itemsize * count:
        raise Unweighed(f"{path}: no binary STL")
    return np.frombuffer(data, record, count, 84)["corners"].astype(float)


def dae(path: Path) -> Array:
    """Corners of the triangles of a COLLADA file with one upright mesh in metres, placed by one matrix."""
    root = ET.parse(path).getroot()
    space = {"c": root.tag[1:].split("}")[0]}
    unit, up = root.find("c:asset/c:unit", space), root.find("c:asset/c:up_axis", space)
    matrices = [node.text or "" for node in root.findall(".//c:visual_scene//c:matrix", space)]
    (mesh,) = root.findall(".//c:mesh", space)
    (faces,) = mesh.findall("c:triangles", space)
    if up is None or up.text != "Z_UP" or unit is None or float(unit.get("meter", 1)) != 1 or len(matrices) != 1:
        raise Unweighed(f"{path}: more than one upright mesh in metres")
    names = {source.get("id"): source.find("c:float_array", space) for source in mesh.findall("c:source", space)}
    position = mesh.find("c:vertices/c:input[@semantic='POSITION']", space)
    assert position is not None, f"{path} has no positions"
    array = names[position.get("source", "")[1:]]
    vertices = np.array(array.text.split(), dtype=float).reshape(-1, 3)
    index = faces.find("c:p", space)
    stride = len({entry.get("offset") for entry in faces.findall("c:input", space)})
    corners = np.array(index.text.split(), dtype=int).reshape(-1, 3, stride)[:, :, 0]
    matrix = np.array(matrices[0].split(), dtype=float).reshape(4, 4)
    return (vertices @ matrix[:3, :3].T + matrix[:3, 3])[corners]


TRIANGLES = {".stl": stl, ".dae": dae}
