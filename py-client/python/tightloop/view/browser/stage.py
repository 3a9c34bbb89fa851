"""Light, ground and background of the page, as pictures and films have them (`sim-daemon/picture/src/shade.rs`)."""

from __future__ import annotations

import math

import numpy as np
import viser

from tightloop.view.meshes.floor import spacing
from tightloop.view.poses import Array

# What is behind everything: the floor's tone and the horizon's are 1 % to either side of it.
_BACKGROUND = (223, 227, 233)
_LINE = (176, 183, 195)
# Where the key light comes from, and how strong lights are.
_KEY = (0.33, -0.52, 0.79)
_KEY_PART, _FLOOR_PART, _SKY_PART = 0.66, 0.25, 0.27
# The browser's tone mapping takes about this much from light colours; a diffuse surface reflects 1/π of the light.
_BRIGHTER = 0.95 * math.pi
# Bytes of an image are the square root of light.
_SHADOW = 1.0 - math.sqrt(0.52)
# Where the floor is gone, in sizes of the scene.
_FADE = 4.0


def add_stage(scene: viser.SceneApi, box: Array, offsets: Array, height: float) -> None:
    """Add lights, a floor that fades into the background, and the background.

    Args:
        scene: The scene of the page.
        box: Bounding box of one world [m], shape ``(2, 3)``.
        offsets: Position of each world on the grid [m], shape ``(worlds, 3)``.
        height: Height of the floor [m].
    """
    scene.set_background_image(np.full((2, 2, 3), _BACKGROUND, np.uint8), format="png")
    scene.configure_environment_map(None)
    scene.configure_default_lights(False)
    scene.add_light_directional("/light/key", intensity=_KEY_PART * _BRIGHTER, cast_shadow=True, position=_KEY)
    ground = round(255 * math.sqrt(_FLOOR_PART / (_FLOOR_PART + _SKY_PART)))
    scene.add_light_hemisphere(
        "/light/sky",
        ground_color=(ground, ground, ground),
        intensity=(_FLOOR_PART + _SKY_PART) * _BRIGHTER,
        position=(0.0, 0.0, 1.0),
    )
    low, high = box[0] + offsets.min(axis=0), box[1] + offsets.max(axis=0)
    reach = 0.8 * float(np.linalg.norm(high - low))
    step = spacing(reach)
    scene.add_grid(
        "/ground",
        infinite_grid=True,
        cell_size=step,
        section_size=step,
        cell_color=_LINE,
        section_color=_LINE,
        cell_thickness=0.6,
        section_thickness=0.6,
        fade_distance=float(np.linalg.norm(0.5 * (low + high))) + _FADE * reach,
        fade_from="origin",
        fade_strength=1.5,
        shadow_opacity=_SHADOW,
        position=(0.0, 0.0, height),
    )
