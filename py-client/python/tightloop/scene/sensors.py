"""Sensors of a scene: sites, sums of contact forces, and height scans."""

from __future__ import annotations

from dataclasses import dataclass

from tightloop.checks.arguments import Quaternion, Triple
from tightloop.checks.attributes import ByName


@dataclass(frozen=True)
class Site:
    """A frame of interest on a body or in the world, made by `Scene.add_site`.

    Attributes:
        name: Name, as in ``sim.site_names``.
        body: Body or ``robot/link`` that carries the site; None for the world.
        pos: Position in the frame of the body [m].
        quat: Orientation in that frame (x, y, z, w).
        relative_to: Site, body or ``robot/link`` that is the reference frame; None for the world.
        damping: Damping of the inverse Jacobian [m or rad].
    """

    name: str
    body: str | None
    pos: Triple
    quat: Quaternion
    relative_to: str | None
    damping: float


@dataclass(frozen=True)
class ContactSensor:
    """A sum of contact forces, made by `Scene.add_contact_sensor`.

    Attributes:
        name: Name, as in ``sim.contact_sensor_names``.
        of: What the forces act on.
        against: What they come from; None for everything.
    """

    name: str
    of: str
    against: str | None


@dataclass(frozen=True)
class HeightScan:
    """A grid of vertical rays under a frame, made by `Scene.add_height_scan`.

    Attributes:
        name: Name.
        body: Body or ``robot/link`` that carries it; None for the world.
        pos: Middle of the grid in the frame of the body [m].
        counts: Rays along x and y.
        spacing: Distances between neighbouring rays along x and y [m].
        reach: The distance where the ground is farther away, or where there is none [m].
        first: Its first ray in ``height_scan``.
    """

    name: str
    body: str | None
    pos: Triple
    counts: tuple[int, int]
    spacing: tuple[float, float]
    reach: float
    first: int

    @property
    def rays(self) -> slice:
        """Its rays in the second axis of ``height_scan``, x innermost."""
        return slice(self.first, self.first + self.counts[0] * self.counts[1])


def slices_by_name(names: list[str], places: list[list[int]]) -> dict[str, slice]:
    """Return the slices of sensors by their names, and by the part after the model's name where it is unique."""
    slices = {name: slice(*place) for name, place in zip(names, places, strict=True)}
    short = [name.split("/", 1)[-1] for name in names]
    alone = {name: slices[whole] for name, whole in zip(short, names, strict=True) if short.count(name) == 1}
    return ByName("sensor", slices | {name: place for name, place in alone.items() if name not in slices})
