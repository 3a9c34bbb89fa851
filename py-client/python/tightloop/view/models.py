"""MuJoCo models of a scene in pictures: what is drawn of them beside the parts that their bodies carry."""

from __future__ import annotations

import json
from collections.abc import Sequence
from os import PathLike, fspath
from pathlib import Path

import numpy as np

from tightloop import _core
from tightloop.mujoco import saved
from tightloop.view import lights
from tightloop.view.lights import Lights
from tightloop.view.tendons import paths
from tightloop.view.tendons.paths import Tendons

# Counts of bodies and activations.
_COUNTS = ("body_parentid", "actuator_actnum")


def extras(scene_toml: str, folder: str | PathLike[str], body_names: Sequence[str]) -> tuple[Tendons, Lights]:
    """Read the tendons and lights of a scene's models; files of older versions have none.

    Args:
        scene_toml: The scene, such as ``sim.info["scene"]``.
        folder: What its paths are relative to, such as ``sim.info["scene_folder"]``.
        body_names: The bodies in the order of ``body_q``, such as ``sim.body_names``.

    Raises:
        SceneError: A model's file cannot be read.
    """
    tendons, lamps, activations = Tendons(), Lights(), 0
    for model in json.loads(_core.parse_scene(scene_toml)).get("mujoco", []):
        found = saved.read(Path(fspath(folder)) / model["model"], (*_COUNTS, *paths.ARRAYS, *lights.ARRAYS))
        bodies = [k for k, name in enumerate(body_names) if name.startswith(f"{model['name']}/")]
        if len(bodies) == len(found["body_parentid"]):
            if "tendon_width" in found:
                tendons.add(found, bodies, activations)
            if "light_type" in found:
                lamps.add(found, bodies)
        activations += int(np.sum(found["actuator_actnum"]))
    return tendons, lamps
