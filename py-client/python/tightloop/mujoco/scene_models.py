"""The MuJoCo models of a scene: reading, checking and saving them."""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Container, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tightloop import _core
from tightloop.checks import arguments as checks
from tightloop.checks.arguments import Vector
from tightloop.errors import SceneError
from tightloop.mujoco import export
from tightloop.mujoco.model import MujocoModel
from tightloop.mujoco.without import checked
from tightloop.scene.shapes import ORIGIN, UPRIGHT
from tightloop.whole_files import whole_file

if TYPE_CHECKING:
    import mujoco

    #: A path to XML, or a model of the package ``mujoco``.
    Model = str | os.PathLike[str] | mujoco.MjSpec | mujoco.MjModel

#: Largest number of vertices of a mesh's convex hull.
HULL_VERTICES = 1024


def read_model(
    model: Model,
    name: str | None,
    taken: Container[str],
    *,
    pos: Vector = ORIGIN,
    quat: Vector = UPRIGHT,
    mesh_max_hull_vertices: int = HULL_VERTICES,
    without: Sequence[str] = (),
) -> MujocoModel:
    """Export a model and read it back, which checks it."""
    vertices = checks.integer("mesh_max_hull_vertices", mesh_max_hull_vertices)
    pos, quat = checks.triple("add_mujoco: pos", pos), checks.quaternion("add_mujoco: quat", quat)
    left_out = checked(without)
    compiled = export.compiled(model)
    own = compiled.names[: compiled.names.index(b"\0")].decode() or "model"
    own = re.sub(r"[^A-Za-z0-9_.\-]", "_", own)
    name = checks.name("MuJoCo model", own if name is None else name, taken)
    return read_file(export.cached(compiled, left_out), name, pos=pos, quat=quat, mesh_max_hull_vertices=vertices)


def read_file(file: Path, name: str, *, pos: Vector, quat: Vector, mesh_max_hull_vertices: int) -> MujocoModel:
    """Read an exported file."""
    try:
        summary = json.loads(_core.read_mujoco(str(file), mesh_max_hull_vertices))
    except SceneError as error:
        raise SceneError(f"MuJoCo model `{name}`: {error}") from None
    return MujocoModel(
        name, file=file, pos=pos, quat=quat, mesh_max_hull_vertices=mesh_max_hull_vertices, summary=summary
    )


def check_options(model: MujocoModel, scene: dict[str, Any], others: Mapping[str, MujocoModel]) -> None:
    """Refuse a model whose options contradict the scene's, or whose integrator is not that of other models.

    Raises:
        SceneError: The option, and both values.
    """
    own = model.options
    pairs = [("dt", own["dt"], scene["dt"]), ("gravity", list(own["gravity"]), list(scene["gravity"]))]
    pairs += [(f"solver {option}", value, scene["solver"][option]) for option, value in own["solver"].items()]
    pairs += [("integrator", own["integrator"], other.options["integrator"]) for other in others.values()]
    for option, value, other in pairs:
        if value != other:
            raise SceneError(
                f"add_mujoco: {option} of model `{model.name}` is {value}, the scene has {other}; "
                "make them equal, or begin with Scene.from_mujoco"
            )


def keep_beside(scene_file: Path, model: MujocoModel) -> Path:
    """Copy the exported file of a model into a folder beside a scene file, and return the copy."""
    folder = scene_file.parent / f"{scene_file.stem}_models"
    kept = folder / f"{model.name}.safetensors"
    try:
        folder.mkdir(exist_ok=True)
        if not (kept.exists() and kept.samefile(model.file)):
            with whole_file(kept) as part:
                shutil.copyfile(model.file, part)
    except OSError as error:
        raise SceneError(f"save: model `{model.name}` cannot be written to {kept}: {error}") from error
    return kept
