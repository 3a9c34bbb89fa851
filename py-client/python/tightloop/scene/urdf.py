"""Robots of a scene from URDF files: files are read, and the arguments of `Scene.add_urdf` checked."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Container, Sequence

from tightloop import _core
from tightloop.checks import arguments as checks
from tightloop.checks.arguments import Vector
from tightloop.errors import SceneError, UrdfError
from tightloop.files.kinds import instead
from tightloop.scene.robot import Robot
from tightloop.scene.shapes import Surface, checked_surface


def read_robot(
    path: str | os.PathLike[str],
    name: str | None,
    *,
    taken: Container[str],
    pos: Vector,
    quat: Vector,
    floating: bool,
    self_collisions: bool,
    strict: bool,
    mesh_max_hull_vertices: int,
    convex_decomposition: bool,
    collada_up_axis: bool,
    package_dirs: Sequence[str | os.PathLike[str]],
    surface: Surface,
) -> tuple[Robot, list[str]]:
    """Read a robot; the arguments are those of `Scene.add_urdf`, and the names that are taken.

    Returns:
        The robot, and the warnings of the reader.

    Raises:
        UrdfError: The file is missing, is not URDF, or describes a robot that cannot be simulated.
        SceneError: An argument is not valid.
    """
    if wrong := instead("add_urdf: path", path, "robot"):
        raise UrdfError(wrong)
    urdf = checks.path("add_urdf: path", path)
    touch = checked_surface("add_urdf", surface)
    if isinstance(package_dirs, str) or not isinstance(package_dirs, Sequence):
        raise SceneError(f"add_urdf: package_dirs is {package_dirs!r}; give a list of folders")
    packages = [checks.path("add_urdf: a folder of package_dirs", folder) for folder in package_dirs]
    for folder in packages:
        if not folder.is_dir():
            raise SceneError(f"add_urdf: package_dirs names {folder}, which is no folder; mend or leave out the path")
    folders = [str(folder) for folder in packages]
    vertices = checks.integer("add_urdf: mesh_max_hull_vertices", mesh_max_hull_vertices)
    decompose = checks.flag("add_urdf: convex_decomposition", convex_decomposition)
    turn = checks.flag("add_urdf: collada_up_axis", collada_up_axis)
    floating, strict = checks.flag("add_urdf: floating", floating), checks.flag("add_urdf: strict", strict)
    self_collisions = checks.flag("add_urdf: self_collisions", self_collisions)
    summary = json.loads(_core.read_urdf(str(urdf), folders, floating, strict, vertices, decompose, turn))
    own_name = re.sub(r"[^A-Za-z0-9_.\-]", "_", summary["name"])
    name = checks.name("robot", own_name if name is None else name, taken)
    robot = Robot(
        name,
        urdf=urdf,
        package_dirs=packages,
        pos=pos,
        quat=quat,
        floating=floating,
        self_collisions=self_collisions,
        strict=strict,
        mesh_max_hull_vertices=vertices,
        convex_decomposition=decompose,
        collada_up_axis=turn,
        surface=touch,
        summary=summary,
    )
    return robot, summary["warnings"]
