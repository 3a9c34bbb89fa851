"""Making cameras of a scene, checked against what the scene has."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import get_args

import numpy as np

from tightloop.checks import arguments as checks
from tightloop.checks.arguments import Vector
from tightloop.errors import SceneError
from tightloop.scene.body import Body
from tightloop.scene.cameras.camera import Camera, Sees
from tightloop.scene.cameras.look_at import towards
from tightloop.scene.cameras.of_mujoco import of_mujoco
from tightloop.scene.parts import Parts, bearer_name, free_name
from tightloop.scene.robot import Link
from tightloop.scene.shapes import ORIGIN

#: Vertical field of view where none is given: 45°, as in MuJoCo [rad].
FOV = math.pi / 4
#: Most pixels along an axis.
PIXELS_MAX = 4096
_NEAR_MIN, _FAR_MAX = 1e-6, 1e6  # [m]
_FOCAL_MIN, _FOCAL_MAX = 1e-2, 1e7  # [pixels]
_EVERY_MAX, _WORLDS_MAX, _NOISE_MAX = 1_000_000, 1_000_000, 1000.0
#: Longest name [bytes].
NAME_MAX = 19


def add_camera(
    scene: Parts,
    *,
    name: str | None,
    mujoco: str | None,
    body: Body | Link | str | None,
    pos: Vector,
    quat: Vector | None,
    target: Vector | None,
    width: int | None,
    height: int | None,
    fov: float | None,
    focal: Vector | None,
    center: Vector | None,
    near: float,
    far: float,
    every: int,
    worlds: Sequence[int] | None,
    sees: Sees,
    depth_noise: Vector,
) -> Camera:
    """Add a camera to a scene; the other arguments are those of `Scene.add_camera`.

    Raises:
        SceneError: A value is out of range, or the body does not exist.
    """
    taken = scene.cameras
    name = checks.name("camera", free_name("camera", taken) if name is None else name, [*taken])
    if not (name.isascii() and name.isidentifier() and len(name) <= NAME_MAX):
        raise SceneError(
            f"camera name is {name!r:.80}; fields are named after it: give letters, digits and _, {NAME_MAX} at most"
        )
    what = f"camera `{name}`"
    if mujoco is not None:
        if (body, quat, target, fov, focal, center) != (None,) * 6 or tuple(pos) != ORIGIN:
            raise SceneError(
                f"{what}: mujoco gives place and lens; give no body, pos, quat, target, fov, focal or center"
            )
        like = of_mujoco(scene, what, mujoco, width, height)
        body, pos, quat, width, height = like.body, like.pos, like.quat, like.width, like.height
        fov, focal, center = like.fov, like.focal, like.center
    if width is None or height is None:
        raise SceneError(f"{what}: give width and height, the pixels of its image")
    pixels = [checks.integer(f"{what}: {side}", count) for side, count in (("width", width), ("height", height))]
    if max(pixels) > PIXELS_MAX:
        raise SceneError(f"{what}: it has {pixels[0]} × {pixels[1]} pixels; give at most {PIXELS_MAX} along each axis")
    place = checks.triple(f"{what}: pos", pos)
    if quat is not None and target is not None:
        raise SceneError(f"{what}: both quat and target are given; give one of them")
    if target is not None:
        point = checks.triple(f"{what}: target", target)
        if point == place:
            raise SceneError(f"{what}: target is where the camera is; give another point")
        turned = towards(place, point)
    else:
        turned = checks.quaternion(f"{what}: quat", (0.0, 0.0, 0.0, 1.0) if quat is None else quat)
    checks.choice(f"{what}: sees", sees, get_args(Sees))
    noise = checks.pair(f"{what}: depth_noise", depth_noise)
    if min(noise) < 0.0:
        raise SceneError(f"{what}: depth_noise is {noise}; give no negative numbers")
    if max(noise) > _NOISE_MAX:
        raise SceneError(f"{what}: depth_noise is {noise}; give at most {_NOISE_MAX:g}")
    nearest = _within(f"{what}: near", checks.number(f"{what}: near", near, above=0.0))
    added = taken[name] = Camera(
        name=name,
        body=None if body is None else bearer_name(scene, what, body),
        pos=place,
        quat=turned,
        width=pixels[0],
        height=pixels[1],
        **_lens(what, fov, focal, center, pixels),
        near=nearest,
        far=_within(f"{what}: far", checks.number(f"{what}: far", far, above=nearest)),
        every=_frames(f"{what}: every", every),
        worlds=None if worlds is None else _worlds(f"{what}: worlds", worlds),
        sees=sees,
        depth_noise=noise,
    )
    return added


def _within(what: str, depth: float) -> float:
    if not _NEAR_MIN <= depth <= _FAR_MAX:
        raise SceneError(f"{what} is {depth!r}; give {_NEAR_MIN:g} to {_FAR_MAX:g} m")
    return depth


def _worlds(what: str, worlds: Sequence[int]) -> tuple[int, ...]:
    if isinstance(worlds, str | bytes) or not isinstance(worlds, Sequence | np.ndarray):
        raise SceneError(f"{what} is {worlds!r:.80}; give numbers of worlds, such as range(4)")
    if not 0 < len(worlds) <= _WORLDS_MAX:
        expected = f"give 1 to {_WORLDS_MAX} numbers of worlds, such as range(4), or leave it out for all"
        raise SceneError(f"{what} has {len(worlds)} entries; {expected}")
    numbers = {checks.integer(what, number, least=0) for number in worlds}
    if any(isinstance(number, bool | np.bool_) for number in worlds):
        raise SceneError(f"{what} is a mask; give numbers of worlds, as np.flatnonzero makes them of a mask")
    if max(numbers) >= 1 << 31:
        raise SceneError(f"{what} is {max(numbers)}; no launch has so many worlds")
    return tuple(sorted(numbers))


def _frames(what: str, every: int) -> int:
    count = checks.integer(what, every)
    if count > _EVERY_MAX:
        raise SceneError(f"{what} is {count}; give at most {_EVERY_MAX} frames")
    return count


def _lens(
    what: str, fov: float | None, focal: Vector | None, center: Vector | None, pixels: list[int]
) -> dict[str, tuple[float, float]]:
    """Return focal lengths and the principal point."""
    middle = (0.5 * pixels[0], 0.5 * pixels[1])
    if focal is None:
        if center is not None:
            raise SceneError(f"{what}: center is given without focal; give both")
        angle = FOV if fov is None else checks.number(f"{what}: fov", fov, above=0.0)
        if not 1e-3 <= angle <= 3.1:
            raise SceneError(f"{what}: fov is {angle!r}; give 0.001 to 3.1 rad")
        length = middle[1] / math.tan(0.5 * angle)
        return {"focal": (length, length), "center": middle}
    if fov is not None:
        raise SceneError(f"{what}: both fov and focal are given; give one of them")
    lengths = checks.pair(f"{what}: focal", focal)
    for length in lengths:
        if not _FOCAL_MIN <= length <= _FOCAL_MAX:
            raise SceneError(f"{what}: focal is {length!r}; give {_FOCAL_MIN:g} to {_FOCAL_MAX:g} pixels")
    return {"focal": lengths, "center": middle if center is None else checks.pair(f"{what}: center", center)}
