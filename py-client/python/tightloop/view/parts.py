"""What a scene looks like: the visuals of its robots' files, and the shapes that touch.

A robot is seen as its file's visuals, and a MuJoCo model as the geoms and sites that MuJoCo's viewer shows. Where a
visual cannot be read, the collision shapes of that link stand in for all of its visuals, and a note says why. A robot
whose file has no visuals at all, and what the scene adds, are seen as what touches. Collision meshes touch as convex
hulls, and are then seen as their files have them.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from os import PathLike, fspath
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tightloop import _core
from tightloop.errors import SceneError
from tightloop.view import models
from tightloop.view.lights import Lights
from tightloop.view.meshes import paint, sheets
from tightloop.view.meshes import visual as visual_mesh
from tightloop.view.meshes.visual import VisualMesh
from tightloop.view.subject import Subject, subject
from tightloop.view.tendons.paths import Tendons

# Most files in a note.
_LISTED_MAX = 8

Kind = Literal["visual", "collision"]
Color = tuple[int, int, int, int]


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles, counter-clockwise from outside.

    Attributes:
        vertices: Shape ``(vertices, 3)`` [m].
        faces: Corners of each face, shape ``(faces, 3)``.
        colors: Red, green, blue and opacity of each face, 0 to 255, shape ``(faces, 4)``.
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]
    colors: NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Part:
    """A mesh that a body carries.

    Attributes:
        body: The body, as a place in ``body_names``; -1 is the world.
        kind: ``"visual"``, what it looks like, or ``"collision"``, how it touches.
        name: ``robot/link/visual``, or the shape's name.
        pose: Its frame in the body's: position [m], then quaternion (x, y, z, w), shape ``(7,)``.
        mesh: Its surface; parts that look alike share one.
        shape: What it is: ``"plane"`` (a sheet around its frame's origin stands for it), ``"box"``, ``"sphere"``,
            ``"cylinder"``, ``"capsule"``, ``"ellipsoid"``, ``"hfield"`` or ``"mesh"``.
        is_site: Whether it is a site of a MuJoCo model, to which no camera is fitted.
    """

    body: int
    kind: Kind
    name: str
    pose: NDArray[np.float64]
    mesh: Mesh
    shape: str
    is_site: bool = False


@dataclass(frozen=True, eq=False)
class Parts:
    """What a scene looks like.

    Attributes:
        parts: All parts, the world's first.
        notes: What could not be shown as its file has it, a sentence each.
        subject: The bodies that cameras frame and follow.
        tendons: Spatial tendons of MuJoCo models.
        lights: Lights of MuJoCo models.
    """

    parts: list[Part]
    notes: list[str]
    subject: Subject
    tendons: Tendons = field(default_factory=Tendons)
    lights: Lights = field(default_factory=Lights)

    def __iter__(self) -> Iterator[Part]:
        return iter(self.parts)

    def __len__(self) -> int:
        return len(self.parts)

    def of(self, kind: Kind) -> list[Part]:
        """The parts of one kind: what is seen at a time."""
        return [part for part in self.parts if part.kind == kind]


def parts(scene_toml: str, folder: str | PathLike[str], body_names: Sequence[str]) -> Parts:
    """Read what a scene looks like; reading its meshes may take seconds.

    Args:
        scene_toml: The scene, such as ``sim.info["scene"]``.
        folder: What its paths are relative to, such as ``sim.info["scene_folder"]``.
        body_names: The bodies in the order of ``body_q``, such as ``sim.body_names``.

    Raises:
        SceneError: The scene is not valid, or has other bodies.
        MissingLibrary: What reads images of visuals is not installed.
    """
    text, surfaces = _core.parts(scene_toml, fspath(folder))
    told = json.loads(text)
    assembly = _Assembly(surfaces, body_names)
    made, own_notes = assembly.whole(told["parts"], told["notes"])
    tendons, lights = models.extras(scene_toml, folder, body_names)
    return Parts(made, own_notes, subject(scene_toml, folder, body_names), tendons, lights)


class _Assembly:
    """Turns what Rust tells of parts into parts; keeps what is read, so that it is read once."""

    def __init__(self, surfaces: Sequence[tuple[Any, Any]], body_names: Sequence[str]) -> None:
        self._surfaces = surfaces
        self._places = {name: place for place, name in enumerate(body_names)}
        self._files: dict[tuple[str, bool], VisualMesh | SceneError] = {}
        # of each robot, COLLADA files whose up axis is not applied
        self._unturned: dict[str, dict[str, None]] = {}
        self._images: dict[str, Color | None] = {}
        self._meshes: dict[Any, Mesh] = {}
        self._notes: list[str] = []

    def whole(self, told: Sequence[dict[str, Any]], notes: Sequence[str]) -> tuple[list[Part], list[str]]:
        collisions = [entry for entry in told if entry["kind"] == "collision"]
        touching = {entry["body"] for entry in collisions}
        visuals = [entry for entry in told if entry["kind"] == "visual"]
        self._notes.extend(notes)
        seen: dict[str, list[Part]] = {}
        lost: set[str] = set()
        for entry in visuals:
            try:
                part = self._visual(entry)
            except SceneError as error:
                instead = "the link's collision shapes are" if entry["body"] in touching else "nothing of the link is"
                self._note(f"visual {entry['name']}: {error}; {instead} shown")
                lost.add(entry["body"])
            else:
                seen.setdefault(entry["body"], []).append(part)
        for robot, files in self._unturned.items():
            named = ", ".join([*files][:_LISTED_MAX]) + (", …" if len(files) > _LISTED_MAX else "")
            self._note(
                f"robot `{robot}`: the <up_axis> of COLLADA files is not applied, as in RViz; if their parts lie "
                f"wrong, set collada_up_axis: {named}"
            )
        dressed = {entry["robot"] for entry in visuals}
        made = []
        clad = {entry["robot"] for entry in visuals if entry["body"] in seen and entry["body"] not in lost}
        for entry in told:
            robot = entry["robot"]
            if entry["kind"] == "bone" and robot not in clad:
                self._note(
                    f"robot `{robot}`: nothing in its file can be shown; its joints, and lines between them, are"
                )
                made.append(self._part(entry, "visual", self._of_surface(entry["mesh"], paint.PLAIN)))
        for entry in collisions:
            made.append(self._stand_in(entry, "collision"))
            body = entry["body"]
            if entry["added"] or body in lost or entry["robot"] not in dressed:
                made.append(self._stand_in(entry, "visual"))
        for body, own in seen.items():
            if body not in lost:
                made.extend(own)
        # beside whatever stands for their bodies
        made.extend(self._visual(entry) for entry in told if entry["kind"] == "site")
        made.sort(key=lambda part: part.body)
        return made, self._notes

    def _visual(self, entry: dict[str, Any]) -> Part:
        if "problem" in entry:
            raise SceneError(entry["problem"])
        own = self._material(entry)
        if entry["shape"] == "plane":
            mesh = self._sheet(entry["half_extents"], own or paint.PLAIN)
        elif "file" in entry:
            mesh = self._of_file(entry, own)
        else:
            mesh = self._of_surface(entry["mesh"], own or paint.PLAIN, entry.get("squares"))
        return self._part(entry, "visual", mesh)

    def _material(self, entry: dict[str, Any]) -> Color | None:
        """The colour that a robot's file gives a visual: its texture's mean, else its own."""
        image = entry["texture"]
        if image is not None:
            if image not in self._images:
                try:
                    self._images[image] = paint.file_mean(image)
                except Exception as error:  # pillow's, of whatever is broken in it
                    self._note(f"texture {image} cannot be read: {error}")
                    self._images[image] = None
            if self._images[image] is not None:
                return self._images[image]
        return None if entry["color"] is None else paint.of_floats(entry["color"])

    def _of_file(self, entry: dict[str, Any], own: Color | None) -> Mesh:
        """A mesh file, in the robot's colour where it has one and the mesh has not several of its own."""
        file, scale, turned = entry["file"], tuple(entry["scale"]), entry["collada_up_axis"]
        found = self._files.get((file, turned))
        if found is None:
            try:
                found = visual_mesh.read(file, collada_up_axis=turned)
                for note in found.notes:
                    self._note(f"visual mesh {Path(file).name} {note}")
            except SceneError as error:
                found = error
            self._files[file, turned] = found
        if isinstance(found, SceneError):
            raise found
        if found.ignored_up_axis is not None:
            files = self._unturned.setdefault(entry["robot"], {})
            files.setdefault(f"{Path(file).name} ({found.ignored_up_axis})")
        # most files of one colour have it from an exporter's default
        whole = own is not None and found.is_plain
        key = file, turned, scale, own if whole or not found.painted.all() else None
        if key not in self._meshes:
            scaled = found.scaled(scale)
            self._meshes[key] = Mesh(scaled.vertices, scaled.faces, scaled.filled(own or paint.PLAIN, whole=whole))
        return self._meshes[key]

    def _of_surface(self, place: int, color: Color, squares: Sequence[float] | None = None) -> Mesh:
        """A surface in one colour; that of a height field, which has squares, in tones of it."""
        key = place, color
        if key not in self._meshes:
            vertices, faces = self._surfaces[place]
            if squares is None:
                colors = np.tile(np.array(color, np.uint8), (len(faces), 1))
            else:
                colors = paint.ground(vertices, faces, squares, color)
            self._meshes[key] = Mesh(vertices, faces, colors)
        return self._meshes[key]

    def _sheet(self, half_extents: Sequence[float | None], color: Color | None) -> Mesh:
        key = "plane", *half_extents, color
        if key not in self._meshes:
            self._meshes[key] = Mesh(*sheets.checkers(half_extents, sheets.fields(color)))
        return self._meshes[key]

    def _stand_in(self, entry: dict[str, Any], kind: Kind) -> Part:
        """A collision shape, as what it is or as what is seen."""
        if entry["shape"] == "plane":
            return self._part(entry, kind, self._sheet((None, None), None))
        body = self._body(entry)
        color = paint.STILL if body < 0 else paint.palette(body)
        if kind == "visual" and not entry["added"]:
            color = paint.PLAIN
        place = entry["mesh" if kind == "collision" else "whole"]
        return self._part(entry, kind, self._of_surface(place, color, entry["squares"]))

    def _part(self, entry: dict[str, Any], kind: Kind, mesh: Mesh) -> Part:
        pose = np.array([*entry["pos"], *entry["quat"]])
        return Part(self._body(entry), kind, entry["name"], pose, mesh, entry["shape"], is_site=entry["kind"] == "site")

    def _body(self, entry: dict[str, Any]) -> int:
        name = entry["body"]
        if name is None:
            return -1
        if name not in self._places:
            raise SceneError(f"body `{name}` of the scene is not among the bodies given; give body_names of this scene")
        return self._places[name]

    def _note(self, note: str) -> None:
        if note not in self._notes:
            self._notes.append(note)
