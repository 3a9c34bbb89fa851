"""The parts of a scene by their names: which are taken, which are free, and which an argument means."""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Collection, Container
from typing import Any, Protocol, cast

from tightloop.checks.attributes import nearest
from tightloop.errors import SceneError
from tightloop.mujoco.model import MujocoModel
from tightloop.scene.body import Body
from tightloop.scene.cameras.camera import Camera
from tightloop.scene.robot import Link, Robot
from tightloop.scene.sensors import ContactSensor, HeightScan, Site
from tightloop.scene.shapes import Shape

Collidable = Shape | Robot | Body | Link | str


class Parts(Protocol):
    """What a scene has, by name; `tightloop.Scene` has these attributes, and nothing else of it is needed here."""

    robots: dict[str, Robot]
    models: dict[str, MujocoModel]
    bodies: dict[str, Body]
    shapes: dict[str, Shape]
    filters: list[tuple[str, str]]
    sites: dict[str, Site]
    contact_sensors: dict[str, ContactSensor]
    height_scans: dict[str, HeightScan]
    cameras: dict[str, Camera]


def part_names(scene: Parts) -> Collection[str]:
    """Return the names of shapes, bodies, models and robots, which must differ."""
    # no copy: a scene asks for a name at every body
    return cast("Collection[str]", ChainMap[str, Any](scene.shapes, scene.bodies, scene.models, scene.robots))


def summary(scene: Parts) -> list[tuple[str, str, str]]:
    """Return kind, name and one property of each part, for people."""
    rows = [("robot", name, f"{robot.dofs} dofs") for name, robot in scene.robots.items()]
    rows += [("MuJoCo model", name, f"{len(model.dof_names)} dofs") for name, model in scene.models.items()]
    rows += [("body", name, "fixed" if body.fixed else "free") for name, body in scene.bodies.items()]
    rows += [("shape", shape.full_name, shape.type) for shape in scene.shapes.values()]
    return rows


def carrier_name(scene: Parts, what: str, body: Body | Link | str) -> str:
    """Return the name of a body of this scene, or ``robot/link``."""
    if isinstance(body, Body) and scene.bodies.get(body.name) is not body:
        raise SceneError(f"{what}: body `{body.name}` is of another scene; give one of this scene's")
    if isinstance(body, Link) and scene.robots.get(body.robot.name) is not body.robot:
        raise SceneError(f"{what}: link `{body}` is of another scene; give one of this scene's")
    if not isinstance(body, (Body, Link, str)):
        raise SceneError(f"{what}: body is {body!r}; give a body, robot.link(…), or the name of either")
    carrier = body.name if isinstance(body, (Body, Link)) else body
    robot, slash, link = carrier.partition("/")
    if slash and robot in scene.robots:
        try:
            scene.robots[robot].link(link)
        except SceneError as problem:
            raise SceneError(f"{what}: body is {carrier!r}: {problem}") from None
    elif carrier in scene.robots:
        raise SceneError(f"{what}: body is the robot {carrier!r}; give one of its links, as in robot.link(…)")
    elif carrier not in scene.bodies:
        known = ", ".join(f"`{body}`" for body in scene.bodies) or "none yet; add_body makes one"
        links = f". A link of a robot is named with it, as in `{next(iter(scene.robots))}/…`" if scene.robots else ""
        raise SceneError(f"{what}: body is {carrier!r}, which is no body of this scene; there are: {known}{links}")
    return carrier


def bearer_name(scene: Parts, what: str, body: Body | Link | str) -> str:
    """Return the name of what carries a sensor: also a body of a MuJoCo model, ``model/body``."""
    if isinstance(body, str):
        model, slash, link = body.partition("/")
        if slash and model in scene.models:
            known = scene.models[model].body_names
            if body not in known and link not in known:
                raise SceneError(f"{what}: model `{model}` has no body `{link}`; its bodies are: {', '.join(known)}")
            return body
    return carrier_name(scene, what, body)


def frame_name(scene: Parts, what: str, frame: Site | Body | Link | str) -> str:
    """Return the name of a reference frame."""
    if isinstance(frame, Site):
        if scene.sites.get(frame.name) is not frame:
            raise SceneError(f"{what}: site `{frame.name}` is of another scene; give one of this scene's")
        return frame.name
    if isinstance(frame, str) and frame in scene.sites:
        return frame
    if isinstance(frame, str) and "/" not in frame and frame not in scene.bodies:
        known = ", ".join(f"`{name}`" for name in (*scene.sites, *scene.bodies)) or "none yet"
        raise SceneError(
            f"{what}: relative_to is {frame!r}, which is no site or body of this scene; there are: {known}, "
            "and the robots' links (robot.link(…))"
        )
    return carrier_name(scene, f"{what}: relative_to", frame)


def collidable_name(scene: Parts, what: str, thing: Collidable) -> str:
    """Return the name of a shape, robot, body or link; `what` is for messages."""
    if isinstance(thing, Shape):
        if scene.shapes.get(thing.name) is not thing:
            raise SceneError(f"{what}: shape `{thing.name}` is of another scene; give one of this scene's")
        return thing.full_name
    if isinstance(thing, Robot):
        if scene.robots.get(thing.name) is not thing:
            raise SceneError(f"{what}: robot `{thing.name}` is of another scene; give one of this scene's")
        return thing.name
    if isinstance(thing, (Body, Link)):
        return carrier_name(scene, what, thing)
    shapes = [shape.full_name for shape in scene.shapes.values()]
    names = [*shapes, *scene.robots, *scene.bodies]
    for robot in scene.robots.values():
        names += (f"{robot.name}/{part}" for part in (*robot.link_names, *robot.shape_names))
    if thing not in names:
        known = ", ".join(f"`{name}`" for name in (*shapes, *scene.robots, *scene.bodies)) or "none yet"
        if near := nearest(str(thing), names):
            known = f"{known} (did you mean `{near[0]}`?)"
        raise SceneError(
            f"{what} is {thing!r}, which is no shape, robot, body or link; there are: {known}, and the "
            "robots' links and shapes (robot.link_names, robot.shape_names)"
        )
    return thing


class FreeNames:
    """Names for parts that get none: ``box``, ``box_2``, … ."""

    def __init__(self) -> None:
        self._next: dict[str, int] = {}

    def take(self, kind: str, taken: Container[str]) -> str:
        """Return the first name that is not taken, searched from the number of the last one of this kind on."""
        name, self._next[kind] = _numbered(kind, taken, self._next.get(kind, 1))
        return name


def free_name(kind: str, taken: Container[str]) -> str:
    """Return the first name of ``kind``, ``kind_2``, … that is not taken."""
    return _numbered(kind, taken, 1)[0]


def _numbered(kind: str, taken: Container[str], first: int) -> tuple[str, int]:
    """Return the first name that is not taken, from a number on, and its number."""
    count = first
    while (name := kind if count == 1 else f"{kind}_{count}") in taken:
        count += 1
    return name, count
