"""The sensors of a scene: methods that add sites and contact sensors."""

from __future__ import annotations

from typing import Any

from tightloop import checks
from tightloop.attributes import ByName
from tightloop.body import Body
from tightloop.checks import Vector
from tightloop.errors import SceneError
from tightloop.robot import Link
from tightloop.scene_shapes import Collidable, SceneShapes, free_name
from tightloop.sensors import ContactSensor, Site
from tightloop.shapes import ORIGIN, UPRIGHT
from tightloop.signatures import checked_calls


@checked_calls
class SceneSensors(SceneShapes):
    """Mixin of `Scene` with its sensors."""

    __slots__ = ("contact_sensors", "sites")

    def __init__(self) -> None:
        super().__init__()
        self.sites: dict[str, Site] = ByName("site")
        self.contact_sensors: dict[str, ContactSensor] = ByName("contact sensor")

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
        """Add a site, a frame of interest such as a tool tip, a camera or an inertial measurement unit.

        The fields ``site_q``, ``site_qd``, ``gyro``, ``accelerometer`` and ``site_inverse_jacobian`` have one row per
        site, in the order in which sites were added; ``launch(fields=...)`` asks for them. `Sim.params` has their
        noise.

        Args:
            body: Body that carries the site, a robot's link (``robot.link("hand")``), or the name of either
                (``"cube"``, ``"arm/hand"``). None for a site that is fixed in the world.
            pos: Position in the frame of the body [m].
            quat: Orientation in that frame (x, y, z, w).
            relative_to: Site, body or link that is the reference frame: ``site_q`` and ``site_qd`` are relative to it
                and in its axes, as for MuJoCo's frame sensors with a reference. None for the world. ``gyro`` and
                ``accelerometer`` are always in the site's own axes.
            damping: Damping λ of ``site_inverse_jacobian``, Jᵀ (J Jᵀ + λ² I)⁻¹ [m or rad], from 1e-6 to 1e6. It halves
                the joint motion in a direction where a unit of joint motion moves the site by λ, and reduces it more
                where it moves the site less. With a stretched arm, ``f32`` has three correct digits at 0.01, and fewer
                below.
            name: Unique name; ``site``, ``site_2``, … if left out.

        Returns:
            The site.

        Raises:
            SceneError: A value is out of range, or the body, link or site does not exist; the message names it.
        """
        name = checks.name("site", free_name("site", self.sites) if name is None else name, [*self.sites])
        what = f"site `{name}`"
        site = Site(
            name=name,
            body=None if body is None else self._carrier(what, body),
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
        of: Collidable,
        against: Collidable | None = None,
        name: str | None = None,
    ) -> ContactSensor:
        """Add a contact sensor: the sum of the contact forces on shapes, from all others or from some.

        The field ``contact_sensor`` has one row per sensor, in world axes [N]. ``body_contact_force`` has the sum of
        every body.

        Args:
            of: A shape; a robot, body or link for all its shapes; or a name as in ``sim.shape_names``.
            against: Where the forces come from, likewise; None for all contacts.
            name: Unique name; ``contact``, ``contact_2``, … if left out.

        Returns:
            The sensor.

        Raises:
            SceneError: A shape, robot, body or link does not exist in the scene; the message names it.
        """
        taken = self.contact_sensors
        name = checks.name("contact sensor", free_name("contact", taken) if name is None else name, [*taken])
        what = f"contact sensor `{name}`"
        sensor = ContactSensor(
            name=name,
            of=self._collidable(f"{what}: of", of),
            against=None if against is None else self._collidable(f"{what}: against", against),
        )
        self.contact_sensors[name] = sensor
        return sensor

    def _frame(self, what: str, frame: Site | Body | Link | str) -> str:
        """Return the name of a reference frame."""
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
        return self._carrier(f"{what}: relative_to", frame)

    def _sensor_tables(self) -> dict[str, Any]:
        """Return sites and sensors in the form of a scene file."""

        def table(thing: Site | ContactSensor) -> dict[str, Any]:
            return {name: value for name, value in vars(thing).items() if value is not None}

        return {
            "site": [table(site) for site in self.sites.values()],
            "contact_sensor": [table(sensor) for sensor in self.contact_sensors.values()],
        }
