"""What a file is, by its first element or its ending: the message for a wrong one names the call that takes it."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

from tightloop.files import named as named_files

# The first element of a robot file begins within so many bytes.
_HEAD_BYTES = 1 << 16
_BEFORE_ELEMENTS = re.compile(r"\s+|<\?.*?\?>|<!--.*?-->|<!DOCTYPE[^>]*>", re.DOTALL)
_ELEMENT = re.compile(r"<([A-Za-z_][\w.\-]*)[\s>/]")
_OF_ELEMENT = {"robot": "robot", "mujoco": "mujoco", "mujocoinclude": "mujoco", "sdf": "sdf"}
_OF_ENDING = {
    **dict.fromkeys((".dae", ".glb", ".gltf", ".msh", ".obj", ".off", ".ply", ".stl"), "mesh"),
    **dict.fromkeys((".usd", ".usda", ".usdc", ".usdz"), "usd"),
    ".safetensors": "saved model",
    ".tlrec": "recording",
    ".toml": "scene",
}
#: What each kind is, and what takes it.
_KINDS = {
    "robot": ("a URDF file", "scene.add_urdf(path) reads it"),
    "mujoco": ("MuJoCo's MJCF", "Scene.from_mujoco(path) or scene.add_mujoco(path) reads it"),
    "sdf": ("SDFormat", "convert it to URDF or MJCF first"),
    "mesh": ("a mesh", "scene.add_mesh(path=…, body=…) adds one as a shape, and a robot's file names its own"),
    "usd": ("USD", "export the robot as URDF or MJCF first"),
    "saved model": ("a saved model", "Scene.load reads the scene file beside it"),
    "recording": ("a recording", "tightloop.view.film and `tightloop view` play it"),
    "scene": ("a scene file", "Scene.load(path) reads it"),
}

#: Endings of formats that a scene is not saved in, and what to do for each.
_NOT_SAVED = {
    **dict.fromkeys((".json", ".yaml", ".yml", ".ini", ".cfg"), ""),
    **dict.fromkeys((".npy", ".npz", ".pkl", ".pickle", ".pt", ".h5", ".tlrec"), ""),
    **dict.fromkeys((".xml", ".mjcf"), ", or write the text of scene.to_mujoco() for MuJoCo"),
    **dict.fromkeys((".urdf", ".xacro", ".sdf", ".usd", ".usda", ".usdc", ".usdz"), ""),
    **dict.fromkeys((".obj", ".stl", ".dae", ".glb", ".gltf", ".ply"), ""),
}


def root_element(text: str) -> str | None:
    """Return the name of the first element of XML, or None."""
    at = 0
    while skipped := _BEFORE_ELEMENTS.match(text, at):
        at = skipped.end()
    found = _ELEMENT.match(text, at)
    return None if found is None else found[1]


def element_of(path: Path) -> str | None:
    """Return the name of a file's first element; None for what is no file or no XML."""
    try:
        with named_files.opened("a file", path, ValueError, limit=sys.maxsize) as file:
            return root_element(file.read(_HEAD_BYTES).decode("utf-8-sig", errors="replace"))
    except (OSError, ValueError):  # an option's value that is too long for a path, or a file that Rust reports
        return None


def kind_of_file(path: Path) -> str | None:
    """Return what a file is, a key of the table of kinds; None if nobody knows."""
    element = element_of(path)
    if element is not None:
        # meshes of COLLADA are XML, too
        return _OF_ELEMENT.get(element) or _OF_ENDING.get(path.suffix.lower())
    return _OF_ENDING.get(path.suffix.lower())


def instead(call: str, given: Any, wanted: str) -> str | None:
    """Return what is wrong with a file and what takes it; None for one of the kind that the call reads.

    Args:
        call: The call and its argument, for the message.
        given: The path, or what was given as one.
        wanted: Kind that the call reads.
    """
    if isinstance(given, str) and given.lstrip().startswith("<") and not _is_there(given):
        return f"{call} is XML text; {_of_text(root_element(given))}"
    try:
        path = Path(given).expanduser()
    except (TypeError, RuntimeError):
        return None
    kind = kind_of_file(path)
    # a missing file has its own message
    if kind is None or kind == wanted or not path.is_file():
        return None
    what, cure = _KINDS[kind]
    return f"{call}: {path.name} is {what}: {cure}"


def not_a_scene_ending(path: Path) -> str | None:
    """Return why a scene is not saved under a path, and the cure; None if its ending is that of no other format."""
    more = _NOT_SAVED.get(path.suffix.lower())
    if more is None:
        return None
    return f"path ends with {path.suffix}, and scene files are TOML; give {path.with_suffix('.toml').name!r}{more}"


def _is_there(given: str) -> bool:
    try:
        return Path(given).exists()
    except (OSError, ValueError):  # a text that is too long for a path
        return False


def _of_text(element: str | None) -> str:
    if element is not None and _OF_ELEMENT.get(element) == "mujoco":
        return (
            "give the path of an MJCF file, or Scene.from_mujoco the model mujoco.MjSpec.from_string(text), "
            "mujoco.MjModel.from_xml_string(text)"
        )
    return "write it to a file, and give its path"
