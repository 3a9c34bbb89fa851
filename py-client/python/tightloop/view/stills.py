"""Single pictures for notebooks: of a simulation, of a scene before its launch, of a robot."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.errors import UnknownField
from tightloop.planning.dynamics import Dynamics
from tightloop.scene.robot import Robot
from tightloop.scene.scene import Scene
from tightloop.view import dependencies
from tightloop.view.arguments import check_size, check_worlds
from tightloop.view.cameras import Camera
from tightloop.view.kept_picture import kept_picture
from tightloop.view.parts import parts
from tightloop.view.picture import Picture

_SIZE = (480, 360)
_POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")


class _Start:
    """The state of a scene at its start, as a picture takes it."""

    def __init__(self, body_q: NDArray[np.float64]) -> None:
        self.body_q = body_q


def of_simulation(
    sim: Any, *, worlds: int | Sequence[int], camera: str | Camera, size: tuple[int, int], frame: Any
) -> Any:
    """Return a picture of worlds of a simulation; see `Sim.picture`."""
    check_worlds("picture", worlds)
    size = check_size("picture", size)
    picture = kept_picture(sim).anew(*size)
    shown = sim.forward() if frame is None else frame
    if not hasattr(shown, "body_q") and hasattr(shown, "fields"):
        whose = f"simulation `{sim.name}`, whose frames lack it" if frame is None else "frame, which lacks it"
        fields = ", ".join(map(repr, ("body_q", *sim.fields[:2])))
        raise UnknownField(
            f"picture: the poses of bodies are drawn from `body_q` of the {whose}; launch with fields=({fields}, …)"
        )
    return image(picture.render(shown, worlds=worlds, camera=camera))


def of_robot(robot: Robot) -> str:
    """Return a picture of a robot at its start as HTML."""
    alone = Scene()
    alone.robots[robot.name] = robot
    return of_scene(alone)


def of_scene(scene: Scene) -> str:
    """Return a picture of a scene at its start as HTML; MuJoCo models stand where their joints are 0."""
    dynamics = Dynamics(scene)
    start = {
        f"{robot.name}/{name}": q
        for robot in scene.robots.values()
        for name, q in zip(robot.coord_names, robot.joint_q, strict=True)
    }
    for body in scene.bodies.values():
        start |= {f"{body.name}/free.{name}": q for name, q in zip(_POSE, (*body.pos, *body.quat), strict=True)}
    upright = {name: 1.0 for name in dynamics.coord_names if name.endswith((".qw", ".w"))}
    q = np.array([start.get(name, upright.get(name, 0.0)) for name in dynamics.coord_names])
    picture = Picture(parts(scene.to_toml(), "/", dynamics.body_names), *_SIZE)
    pixels = picture.render(_Start(dynamics.forward_kinematics(q)[None]), worlds=1)
    data = io.BytesIO()
    image(pixels).save(data, "PNG")
    encoded = base64.b64encode(data.getvalue()).decode()
    return f'<img alt="the start" width="{_SIZE[0]}" src="data:image/png;base64,{encoded}">'


def image(pixels: NDArray[np.uint8]) -> Any:
    """Return pixels, shape ``(height, width, 3)``, as a `PIL.Image.Image`, which notebooks show.

    Raises:
        MissingLibrary: The extra ``view`` is not installed.
    """
    dependencies.check("PIL")
    from PIL import Image

    return Image.fromarray(pixels)
