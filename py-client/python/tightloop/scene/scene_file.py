"""Scene files: a scene as tables, and the calls that make a scene of them."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Set
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from tightloop import _core
from tightloop.checks import advice
from tightloop.checks import arguments as checks
from tightloop.errors import SceneError
from tightloop.files.kinds import instead, not_a_scene_ending
from tightloop.mujoco import mjcf, scene_models
from tightloop.scene import height_fields, randomization
from tightloop.scene.options import Options
from tightloop.scene.parts import Parts
from tightloop.scene.robot import PER_DOF
from tightloop.scene.sensors import ContactSensor, HeightScan, Site
from tightloop.whole_files import whole_file


def written(
    scene: Parts,
    options: Options,
    distributions: Mapping[str, Any],
    models: Mapping[str, Path] | None = None,
    fields: Mapping[str, Path] | None = None,
) -> str:
    """Return a scene as JSON, with other files of its models and height fields where these are given."""
    files = {name: {"model": str(file)} for name, file in (models or {}).items()}
    paths = {name: {"path": str(file)} for name, file in (fields or {}).items()}
    return json.dumps(
        {
            **asdict(options),
            "contact_filters": scene.filters,
            "randomize": distributions,
            "shape": [shape.table() | paths.get(shape.name, {}) for shape in scene.shapes.values()],
            "robot": [robot.table() for robot in scene.robots.values()],
            "mujoco": [model.table() | files.get(model.name, {}) for model in scene.models.values()],
            "body": [body.table() for body in scene.bodies.values()],
            "site": [_without_none(site) for site in scene.sites.values()],
            "contact_sensor": [_without_none(sensor) for sensor in scene.contact_sensors.values()],
            "height_scan": [
                {name: value for name, value in _without_none(scan).items() if name != "first"}
                for scan in scene.height_scans.values()
            ],
            "camera": [camera.table() for camera in scene.cameras.values()],
        }
    )


def _without_none(sensor: Site | ContactSensor | HeightScan) -> dict[str, Any]:
    return {name: value for name, value in vars(sensor).items() if value is not None}


def save(scene: Parts, file: Path, options: Options, distributions: Mapping[str, Any]) -> None:
    """Write a scene file, with copies of its models and height fields beside it.

    Raises:
        SceneError: The file has the ending of another kind, or cannot be written.
    """
    if problem := not_a_scene_ending(file):
        raise SceneError(f"save: {problem}")
    models, fields = keep_beside(file, scene)
    _core.save_scene(written(scene, options, distributions, models, fields), str(file))


def read(path: str | os.PathLike[str]) -> tuple[str, Path]:
    """Return the tables of a scene file as JSON, and its folder.

    Raises:
        SceneError: The file has the ending of another kind, or cannot be read.
    """
    if wrong := instead("load: path", path, "scene"):
        raise SceneError(wrong)
    file = checks.path("load: path", path)
    return _core.load_scene(str(file)), file.parent


def keep_beside(file: Path, scene: Parts) -> tuple[dict[str, Path], dict[str, Path]]:
    """Copy models and height fields of a scene beside its file; return the copies by name."""
    models = {model.name: scene_models.keep_beside(file, model) for model in scene.models.values()}
    fields = {
        shape.name: height_fields.keep_beside(file, shape.name, shape.path)
        for shape in scene.shapes.values()
        if shape.type == "hfield" and shape.path is not None
    }
    return models, fields


def fill(scene: Any, tables: Mapping[str, Any], folder: Path) -> None:
    """Add to a scene what a scene file has.

    Args:
        scene: A `tightloop.Scene`, which is in a layer above.
        tables: The tables of the file.
        folder: Folder that relative paths begin in.
    """
    scene.solver(**tables["solver"])
    for table in tables.get("robot", ()):
        arguments, joints = robot_arguments(table, folder)
        robot = scene.add_urdf(**arguments)
        for name, values in joints.items():
            setattr(robot, name, values)
    for table in tables.get("mujoco", ()):
        others = {name: value for name, value in table.items() if name != "model"}
        scene.models[table["name"]] = scene_models.read_file(folder / table["model"], **others)
    for method, arguments in calls(tables, folder):
        getattr(scene, method)(**arguments)


def to_mujoco(scene: Parts, toml: str, varying: Set[str], path: str | os.PathLike[str] | None) -> str:
    """Return a scene as MJCF and write it to a file, if one is given; warn of what MJCF lacks.

    Args:
        scene: The scene.
        toml: Its scene file.
        varying: Names of what differs between its worlds.
        path: The file.

    Raises:
        SceneError: The file cannot be written.
    """
    text = mjcf.written(json.loads(_core.compiled_scene(toml)), "scene")
    left = [*scene.contact_sensors, *scene.height_scans, *scene.cameras]
    if left:
        advice.warn(f"to_mujoco: MJCF has no equal of sensor {', '.join(map(repr, left))}; it is left out")
    drawn = sorted(varying & set(_core.param_names()))
    if drawn:
        advice.warn(f"to_mujoco: worlds differ in {', '.join(drawn)}; the text has the values of the scene")
    if path is not None:
        with whole_file(checks.path("to_mujoco: path", path), SceneError) as file:
            file.write_text(text, encoding="utf-8")
    return text


def robot_arguments(table: Mapping[str, Any], folder: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the arguments of `Scene.add_urdf` for a robot of a scene file, and its properties to set."""
    joints = {name: table[name] for name in PER_DOF if name in table}
    properties = {
        name: values if name == "joint_target_mode" else np.array(values, dtype=float)
        for name, values in joints.items()
    }
    arguments = {name: value for name, value in table.items() if name not in joints}
    arguments["path"] = folder / arguments.pop("urdf")
    arguments["package_dirs"] = [folder / package for package in arguments.pop("package_dirs", ())]
    return arguments, properties


def calls(tables: Mapping[str, Any], folder: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the methods of `tightloop.Scene` that add what a scene file has besides robots and models.

    Args:
        tables: The tables of the file.
        folder: Folder that relative paths begin in.
    """
    for body in tables.get("body", ()):
        yield "add_body", body
    for shape in tables.get("shape", ()):
        yield _shape_call(shape, folder)
    for a, b in tables.get("contact_filters", ()):
        yield "filter_contacts", {"a": a, "b": b}
    for site in tables.get("site", ()):
        yield "add_site", site
    for sensor in tables.get("contact_sensor", ()):
        yield "add_contact_sensor", sensor
    for scan in tables.get("height_scan", ()):
        yield "add_height_scan", _scan_arguments(scan)
    for camera in tables.get("camera", ()):
        yield "add_camera", camera
    yield "randomize", randomization.from_tables(tables.get("randomize", {}))


def _shape_call(table: Mapping[str, Any], folder: Path) -> tuple[str, dict[str, Any]]:
    arguments = {name: value for name, value in table.items() if name != "type"}
    if "path" in arguments:
        file = folder / arguments.pop("path")
        arguments["elevation" if table["type"] == "hfield" else "path"] = file
    return f"add_{table['type']}", arguments


def _scan_arguments(table: Mapping[str, Any]) -> dict[str, Any]:
    counts, spacing = table["counts"], table["spacing"]
    size = [max(1, count - 1) * step for count, step in zip(counts, spacing, strict=True)]
    others = {name: value for name, value in table.items() if name not in ("counts", "spacing")}
    return {"size": size, "shape": tuple(counts), **others}
