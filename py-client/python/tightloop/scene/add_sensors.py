"""The sensors of a scene: methods that add sites and contact sensors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from tightloop.checks import arguments as checks
from tightloop.checks.arguments import Vector
from tightloop.checks.attributes import ByName
from tightloop.checks.signatures import checked_calls
from tightloop.errors import SceneError
from tightloop.scene.add_shapes import Collidable, SceneShapes, free_name
from tightloop.scene.body import Body
from tightloop.scene.robot import Link
from tightloop.scene.sensors import ContactSensor, HeightScan, Site
from tightloop.scene.shapes import ORIGIN, UPRIGHT

#: Rays of a height scan along each axis, at most.
RAYS_MAX = 1000


@checked_calls
class SceneSensors(SceneShapes):
    """Mixin of `Scene` with its sensors."""

    __slots__ = ("contact_sensors", "height_scans", "sites")

    def __init__(self) -> None:
        super().__init__()
        self.sites: dict[str, Site] = ByName("site")
        self.contact_sensors: dict[str, ContactSensor] = ByName("contact sensor")
        self.height_scans: dict[str, HeightScan] = ByName("height scan")

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

    def add_height_scan(
        self,
        *,
        body: Body | Link | str | None = None,
        pos: Vector = ORIGIN,
        size: Vector = (1.6, 1.0),
        shape: tuple[int, int] = (17, 11),
        reach: float = 10.0,
        name: str | None = None,
    ) -> HeightScan:
        """Add a height scan: how far the ground is below a frame, at the points of a grid that turns with its yaw.

        The ground is the static planes and height fields of the scene; other shapes are not seen. The field
        ``height_scan``, shape ``(worlds, rays)``, has all scans one after another; ``launch(fields=...)`` asks for it.
        A value is the height of the frame above the ground [m], negative where the ground is higher.

        Args:
            body: Body that carries the grid, a robot's link (``robot.link("trunk")``), or the name of either; links of
                a MuJoCo model as ``"model/body"``. None for a grid that is fixed in the world.
            pos: Middle of the grid in the frame of the body [m].
            size: Lengths of the grid along x and y of the frame [m].
            shape: Rays along x and y.
            reach: The value where the ground is farther away, or where there is none [m].
            name: Unique name; ``scan``, ``scan_2``, … if left out.

        Returns:
            The scan; ``frame.height_scan[:, scan.rays]`` are its values, x innermost.

        Raises:
            SceneError: A value is out of range, or the body does not exist; the message names it.
        """
        taken = self.height_scans
        name = checks.name("height scan", free_name("scan", taken) if name is None else name, [*taken])
        what = f"height scan `{name}`"
        lengths = checks.pair(f"{what}: size", size)
        is_pair = isinstance(shape, Sequence) and not isinstance(shape, str) and len(shape) == 2
        if not is_pair:
            raise SceneError(f"{what}: shape is {shape!r:.80}; give the numbers of rays along x and y")
        counts = tuple(checks.integer(f"{what}: shape", count) for count in shape)
        if max(counts) > RAYS_MAX:
            raise SceneError(f"{what}: shape is {shape!r}; give at most {RAYS_MAX} rays along each axis")
        scan = HeightScan(
            name=name,
            body=None if body is None else self._bearer(what, body),
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
        self.height_scans[name] = scan
        return scan

    def _load_height_scan(self, table: dict[str, Any]) -> None:
        """Add the scan of a table of a scene file."""
        counts, spacing = table.pop("counts"), table.pop("spacing")
        size = [max(1, count - 1) * step for count, step in zip(counts, spacing, strict=True)]
        self.add_height_scan(size=size, shape=tuple(counts), **table)

    def _bearer(self, what: str, body: Body | Link | str) -> str:
        """Return the name of what carries a sensor: also a body of a MuJoCo model, ``model/body``."""
        if isinstance(body, str):
            model, slash, link = body.partition("/")
            if slash and model in self.models:
                known = self.models[model].body_names
                if body not in known and link not in known:
                    raise SceneError(
                        f"{what}: model `{model}` has no body `{link}`; its bodies are: {', '.join(known)}"
                    )
                return body
        return self._carrier(what, body)

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

        def table(thing: Site | ContactSensor | HeightScan) -> dict[str, Any]:
            return {name: value for name, value in vars(thing).items() if value is not None}

        return {
            "site": [table(site) for site in self.sites.values()],
            "contact_sensor": [table(sensor) for sensor in self.contact_sensors.values()],
            "height_scan": [
                {name: value for name, value in table(scan).items() if name != "first"}
                for scan in self.height_scans.values()
            ],
        }
