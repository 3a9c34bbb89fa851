"""What a scene has of sensors: sites, and sums of contact forces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from tightloop import checks
from tightloop.body import Body
from tightloop.checks import Quaternion, Triple, Vector
from tightloop.errors import SceneError
from tightloop.robot import Link
from tightloop.shaped import Shaped, Touching
from tightloop.shapes import ORIGIN, UPRIGHT


@dataclass(frozen=True)
class Site:
    """A frame of interest; `Scene.add_site` makes it.

    Attributes:
        name: Its name, as in ``sim.site_names``.
        body: The body or ``robot/link`` that carries it; none in the world.
        pos: Position in the frame of what carries it [m].
        quat: Orientation there (x, y, z, w).
        relative_to: The site, body or ``robot/link`` that it is measured from; none for the world.
        damping: Damping of its inverse Jacobian [m and rad alike].
    """

    name: str
    body: str | None
    pos: Triple
    quat: Quaternion
    relative_to: str | None
    damping: float


@dataclass(frozen=True)
class ContactSensor:
    """A sum of contact forces; `Scene.add_contact_sensor` makes it.

    Attributes:
        name: Its name, as in ``sim.contact_sensor_names``.
        of: What the forces are on.
        against: What they come from; none for everything.
    """

    name: str
    of: str
    against: str | None


class Sensed(Shaped):
    """The part of a scene that is about sensors."""

    __slots__ = ("contact_sensors", "sites")

    def __init__(self) -> None:
        super().__init__()
        self.sites: dict[str, Site] = {}
        self.contact_sensors: dict[str, ContactSensor] = {}

    def add_site(
        self,
        *,
        body: Body | Link | str | None = None,
        pos: Vector = ORIGIN,
        quat: Vector = UPRIGHT,
        relative_to: Site | Body | Link | str | None = None,
        damping: float = 0.05,
        name: str | None = None,
    ) -> Site:
        """Add a frame of interest: a tool's tip, a camera, an inertial measurement unit.

        Frames show it in the fields ``site_q``, ``site_qd``, ``gyro``, ``accelerometer`` and ``site_inverse_jacobian``,
        one row a site in the order they were added, where ``launch(fields=...)`` asks for them; `Sim.params` has their
        noise.

        Args:
            body: The body that carries it, a robot's link (``robot.link("hand")``), or the name of either (``"cube"``,
                ``"arm/hand"``); none for a site that stands in the world.
            pos: Its place in the frame of what carries it [m].
            quat: Its orientation there (x, y, z, w).
            relative_to: A site, body or link: ``site_q`` and ``site_qd`` are then measured from that frame, in its
                axes, as MuJoCo's frame sensors with a reference are. None for the world. ``gyro`` and
                ``accelerometer`` are in the site's own axes, whatever this is.
            damping: Damping λ of ``site_inverse_jacobian``, Jᵀ (J Jᵀ + λ² I)⁻¹ [m and rad alike], from 1e-6 to 1e6: a
                direction in which a unit of joint motion moves the site by λ keeps half of what would move it there,
                one of less keeps less. Where the arm is stretched, ``f32`` keeps three digits with 0.01, and fewer
                with less.
            name: Unique name; ``site``, ``site_2``, … if left out.

        Raises:
            SceneError: A value is out of range, or there is no such body, link or site; the message names it.
        """
        name = checks.name("site", self._free_sensor("site", self.sites) if name is None else name, [*self.sites])
        what = f"site `{name}`"
        site = Site(
            name=name,
            body=None if body is None else self._bearer(what, body),
            pos=checks.triple(f"{what}: pos", pos),
            quat=checks.quaternion(f"{what}: quat", quat),
            relative_to=None if relative_to is None else self._frame(what, relative_to),
            damping=checks.number(f"{what}: damping", damping, above=0.0),
        )
        self.sites[name] = site
        return site

    def add_contact_sensor(
        self,
        *,
        of: Touching,
        against: Touching | None = None,
        name: str | None = None,
    ) -> ContactSensor:
        """Add up the contact forces on something, from everything or from something.

        Frames show the sum in the field ``contact_sensor``, one row a sensor, in world axes [N]; ``body_contact_force``
        has that of every link.

        Args:
            of: A shape, a robot, body or link for all its shapes, or a name as in ``sim.shape_names``.
            against: Another; none for everything that touches.
            name: Unique name; ``contact``, ``contact_2``, … if left out.

        Raises:
            SceneError: There is no such thing in the scene; the message names it.
        """
        taken = self.contact_sensors
        name = checks.name("contact sensor", self._free_sensor("contact", taken) if name is None else name, [*taken])
        what = f"contact sensor `{name}`"
        sensor = ContactSensor(
            name=name,
            of=self._touching(what, of),
            against=None if against is None else self._touching(what, against),
        )
        self.contact_sensors[name] = sensor
        return sensor

    def _frame(self, what: str, frame: Site | Body | Link | str) -> str:
        """Name of a frame that others are measured from."""
        if isinstance(frame, Site):
            if self.sites.get(frame.name) is not frame:
                raise SceneError(f"{what}: site `{frame.name}` is of another scene; give one of this scene's")
            return frame.name
        if isinstance(frame, str) and frame in self.sites:
            return frame
        if isinstance(frame, str) and "/" not in frame and frame not in self.bodies:
            known = ", ".join(f"`{name}`" for name in (*self.sites, *self.bodies)) or "none yet"
            raise SceneError(
                f"{what}: relative_to is {frame!r}, which is no site or body of this scene; there are: {known}, "
                "and the robots' links (robot.link(…))"
            )
        return self._bearer(f"{what}: relative_to", frame)

    def _free_sensor(self, kind: str, taken: dict[str, Any]) -> str:
        count = 1
        while (name := kind if count == 1 else f"{kind}_{count}") in taken:
            count += 1
        return name

    def _sensor_tables(self) -> dict[str, Any]:
        """Sites and sensors as a scene file has them."""

        def table(thing: Site | ContactSensor) -> dict[str, Any]:
            return {name: value for name, value in vars(thing).items() if value is not None}

        return {
            "site": [table(site) for site in self.sites.values()],
            "contact_sensor": [table(sensor) for sensor in self.contact_sensors.values()],
        }
