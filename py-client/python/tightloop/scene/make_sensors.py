"""Making sensors of a scene: sites, contact sensors and height scans, checked against what the scene has."""

from __future__ import annotations

from collections.abc import Sequence

from tightloop.checks import arguments as checks
from tightloop.checks.arguments import Vector
from tightloop.errors import SceneError
from tightloop.scene.body import Body
from tightloop.scene.parts import (
    Collidable,
    Parts,
    bearer_name,
    carrier_name,
    collidable_name,
    frame_name,
    free_name,
)
from tightloop.scene.robot import Link
from tightloop.scene.sensors import ContactSensor, HeightScan, Site

#: Rays of a height scan along each axis, at most.
RAYS_MAX = 1000


def add_site(
    scene: Parts,
    *,
    name: str | None,
    body: Body | Link | str | None,
    pos: Vector,
    quat: Vector,
    relative_to: Site | Body | Link | str | None,
    damping: float,
) -> Site:
    """Add a site to a scene; the other arguments are those of `Scene.add_site`.

    Raises:
        SceneError: A value is out of range, or the body, link or site does not exist.
    """
    name = checks.name("site", free_name("site", scene.sites) if name is None else name, [*scene.sites])
    what = f"site `{name}`"
    added = scene.sites[name] = Site(
        name=name,
        body=None if body is None else carrier_name(scene, what, body),
        pos=checks.triple(f"{what}: pos", pos),
        quat=checks.quaternion(f"{what}: quat", quat),
        relative_to=None if relative_to is None else frame_name(scene, what, relative_to),
        damping=checks.number(f"{what}: damping", damping, above=0.0),
    )
    return added


def add_contact_sensor(scene: Parts, name: str | None, of: Collidable, against: Collidable | None) -> ContactSensor:
    """Add a contact sensor to a scene; the other arguments are those of `Scene.add_contact_sensor`.

    Raises:
        SceneError: A shape, robot, body or link does not exist in the scene.
    """
    taken = scene.contact_sensors
    name = checks.name("contact sensor", free_name("contact", taken) if name is None else name, [*taken])
    what = f"contact sensor `{name}`"
    added = scene.contact_sensors[name] = ContactSensor(
        name=name,
        of=collidable_name(scene, f"{what}: of", of),
        against=None if against is None else collidable_name(scene, f"{what}: against", against),
    )
    return added


def add_height_scan(
    scene: Parts,
    *,
    name: str | None,
    body: Body | Link | str | None,
    pos: Vector,
    size: Vector,
    shape: tuple[int, int],
    reach: float,
) -> HeightScan:
    """Add a height scan to a scene; the other arguments are those of `Scene.add_height_scan`.

    Raises:
        SceneError: A value is out of range, or the body does not exist.
    """
    taken = scene.height_scans
    name = checks.name("height scan", free_name("scan", taken) if name is None else name, [*taken])
    what = f"height scan `{name}`"
    lengths = checks.pair(f"{what}: size", size)
    is_pair = isinstance(shape, Sequence) and not isinstance(shape, str) and len(shape) == 2
    if not is_pair:
        raise SceneError(f"{what}: shape is {shape!r:.80}; give the numbers of rays along x and y")
    counts = tuple(checks.integer(f"{what}: shape", count) for count in shape)
    if max(counts) > RAYS_MAX:
        raise SceneError(f"{what}: shape is {shape!r}; give at most {RAYS_MAX} rays along each axis")
    added = scene.height_scans[name] = HeightScan(
        name=name,
        body=None if body is None else bearer_name(scene, what, body),
        pos=checks.triple(f"{what}: pos", pos),
        counts=(counts[0], counts[1]),
        # a line of one ray has no spacing; any number above 0 will do
        spacing=(
            checks.number(f"{what}: size along x", lengths[0], above=0.0) / max(1, counts[0] - 1),
            checks.number(f"{what}: size along y", lengths[1], above=0.0) / max(1, counts[1] - 1),
        ),
        reach=checks.number(f"{what}: reach", reach, above=0.0),
        first=sum(other.counts[0] * other.counts[1] for other in taken.values()),
    )
    return added
