"""Light, ground and background of the page, as pictures and films have them (`sim-daemon/picture/src/shade.rs`)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import viser

from tightloop.view.lights import Lamp, Lights
from tightloop.view.meshes.floor import spacing
from tightloop.view.poses import Array, wxyz
from tightloop.view.tendons.capsules import towards

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


def add_stage(scene: viser.SceneApi, box: Array, offsets: Array, height: float, *, lights: Lights) -> Lamps:
    """Add lights, a floor that fades into the background, and the background.

    Args:
        scene: The scene of the page.
        box: Bounding box of one world [m], shape ``(2, 3)``.
        offsets: Position of each world on the grid [m], shape ``(worlds, 3)``.
        height: Height of the floor [m].
        lights: Lights of one world; without any, fixed ones shine.

    Returns:
        The lights, which move with bodies.
    """
    scene.set_background_image(np.full((2, 2, 3), _BACKGROUND, np.uint8), format="png")
    scene.configure_environment_map(None)
    scene.configure_default_lights(False)
    lamps = Lamps(scene, lights, box.mean(axis=0), far=len(offsets) > 1)
    if not len(lights):
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
    return lamps


class Lamps:
    """The lights of MuJoCo models in the browser, in place of the fixed ones.

    A browser adds light up where MuJoCo adds up bytes of colours. So the sum over all lights is about MuJoCo's where
    all of them shine. The light at the camera comes from everywhere. The first light that casts shadows shines from far
    off: shadows of others have speckles in browsers.

    Args:
        scene: The scene of the page.
        lights: The lights of one world.
        middle: Middle of the worlds [m], shape ``(3,)``.
        far: Whether lights shine from far off, since there are several worlds.
    """

    def __init__(self, scene: viser.SceneApi, lights: Lights, middle: Array, *, far: bool) -> None:
        self._scene, self._lights, self._middle, self._far = scene, lights, middle, far
        self._handles: list[Any] = []

    def show(self, body_q: Array) -> None:
        """Move the lights to where they are in a world, whose bodies have these poses, shape ``(bodies, 7)``."""
        lamps = self._lights.lamps(body_q) if len(self._lights) else []
        caster = next((number for number, lamp in enumerate(lamps) if lamp.shadows), None)
        lamps = [lamp.far(self._middle) if self._far or number == caster else lamp for number, lamp in enumerate(lamps)]
        if lamps and not self._handles:
            self._add(lamps)
        for handle, lamp in zip(self._handles, lamps, strict=True):
            position = -lamp.direction if lamp.position is None else lamp.position
            turn = wxyz(towards(-lamp.direction))
            if np.isfinite([*position, *turn]).all() and not (
                np.array_equal(handle.position, position) and np.array_equal(handle.wxyz, turn)
            ):
                handle.position, handle.wxyz = position, turn

    def _add(self, lamps: list[Lamp]) -> None:
        head = self._lights.headlight(np.array([0.0, 0.0, -1.0]))
        ambient = np.sum([lamp.ambient for lamp in (*lamps, *head)], axis=0)
        # a surface sees the camera's light from aslant
        ambient = ambient + sum((0.5 * lamp.diffuse for lamp in head), np.zeros(3))
        # the light of a byte is its square: shares of the square of the sum
        whole = min(float(np.max(ambient + np.sum([lamp.diffuse for lamp in lamps], axis=0))), 1.0)
        color, intensity = _shining(ambient * whole)
        self._scene.add_light_ambient("/light/ambient", color=color, intensity=intensity)
        casts = False
        for number, lamp in enumerate(lamps):
            color, intensity = _shining(lamp.diffuse * whole)
            name = f"/light/{number}"
            if lamp.position is None:
                shadows = lamp.shadows and not casts
                casts = casts or shadows
                handle: Any = self._scene.add_light_directional(
                    name, color=color, intensity=intensity, cast_shadow=shadows
                )
            elif lamp.cutoff > 0.5 * math.pi:
                handle = self._scene.add_light_point(name, color=color, intensity=intensity, decay=0.0)
            else:
                handle = self._scene.add_light_spot(
                    name,
                    color=color,
                    intensity=intensity,
                    decay=0.0,
                    angle=lamp.cutoff,
                    penumbra=min(lamp.exponent / 10.0, 1.0),
                )
            self._handles.append(handle)


def _shining(light: Array) -> tuple[tuple[int, int, int], float]:
    """Return colour and intensity of light, as viser takes them."""
    most = float(np.max(light))
    red, green, blue = (round(255 * math.sqrt(max(part, 0.0) / most)) if most > 0 else 0 for part in light)
    return (red, green, blue), most * _BRIGHTER
