"""Cameras of MuJoCo models."""

from __future__ import annotations

from dataclasses import dataclass

from tightloop.checks.arguments import Quaternion, Triple
from tightloop.errors import SceneError
from tightloop.scene.parts import Parts


@dataclass(frozen=True)
class MujocoCamera:
    """Arguments of `Scene.add_camera` that a camera of a MuJoCo model stands for."""

    body: str
    pos: Triple
    quat: Quaternion
    width: int | None
    height: int | None
    fov: float | None
    focal: tuple[float, float] | None
    center: tuple[float, float] | None


def of_mujoco(scene: Parts, what: str, name: str, width: int | None, height: int | None) -> MujocoCamera:
    """Return a camera of a model, ``model/camera``, for an image of a size, or of its own.

    Raises:
        SceneError: There is no such camera, or it follows a body.
    """
    model, _, camera = name.partition("/") if isinstance(name, str) else ("", "", "")
    if model not in scene.models:
        known = ", ".join(f"{model}/{camera}" for model in scene.models for camera in scene.models[model].cameras)
        raise SceneError(
            f"{what}: mujoco is {name!r}; give 'model/camera'; cameras of the scene's models: {known or '–'}"
        )
    cameras = scene.models[model].cameras
    if camera not in cameras:
        raise SceneError(f"{what}: model `{model}` has no camera {camera!r}; it has {', '.join(cameras) or 'none'}")
    like = cameras[camera]
    if not like["is_fixed"]:
        raise SceneError(
            f"{what}: `{name}` tracks or targets a body; cameras here are fixed to theirs: give body, pos and target"
        )
    resolution = like["resolution"]
    if max(resolution) > 1:
        width = resolution[0] if width is None else width
        height = resolution[1] if height is None else height
    focal, center = like["focal"], like["center"]
    if focal is not None and width is not None and height is not None:
        scale = (width / resolution[0], height / resolution[1])
        focal = (focal[0] * scale[0], focal[1] * scale[1])
        center = (center[0] * scale[0], center[1] * scale[1])
    x, y, z = like["pos"]
    qx, qy, qz, qw = like["quat"]
    return MujocoCamera(
        body=f"{model}/{like['link']}",
        pos=(x, y, z),
        quat=(qx, qy, qz, qw),
        width=width,
        height=height,
        fov=like["fov"],
        focal=focal,
        center=center,
    )
