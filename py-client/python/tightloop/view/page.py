"""A page in the browser that shows one feed: its worlds, what is laid over them, its controls and cameras."""

from __future__ import annotations

from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from tightloop.dynamics import Dynamics
from tightloop.errors import TightloopError
from tightloop.view.cameras import camera
from tightloop.view.display_options import Looks
from tightloop.view.feed import Feed
from tightloop.view.grip import Grip, grip
from tightloop.view.joints import Joint, at_targets, joints
from tightloop.view.overlay import Overlay
from tightloop.view.panel import Panel
from tightloop.view.parts import parts
from tightloop.view.pilot import Pilot
from tightloop.view.poses import Array
from tightloop.view.source import CONTACT_FIELDS
from tightloop.view.stage import Stage

# A camera that goes along closes a tenth of its distance to where it should be in a frame: no jerks.
_FOLLOW_PART = 0.1
# Less than that it stays where it is [m].
_FOLLOW_LEAST = 1e-5
# The panel covers the right of the page.
_PANEL_PART = 0.25


class Page:
    """What a browser shows of a feed.

    Args:
        server: Whose page; nothing of another feed is on it.
        feed: What it shows.
        first: The frame that it begins with.
    """

    def __init__(self, server: viser.ViserServer, feed: Feed, first: Any) -> None:
        info = feed.info
        self.looks = Looks()
        self._server = server
        self._feed = feed
        self._shown = first
        self._grip: Grip | None = None
        self._centre: NDArray[np.float64] | None = None
        looked = parts(info["scene"], info["scene_folder"], info["body_names"])
        notes = [str(note) for note in (*feed.told, *info.get("notes", ()), *looked.notes)]
        self._dynamics, self._driven = _dynamics(info, notes)
        body_q = np.asarray(first.body_q)
        self._stage = Stage(server, looked.parts, feed.worlds, self.looks, body_q[0])
        self._overlay = Overlay(server, looked.parts, self.looks, self._stage, bodies=len(info["body_names"]))
        self._panel = Panel(server, feed, self.looks, driven=self._driven, aim=self.aim, notes=notes)
        self._stage.on_click(lambda world, _: self._panel.follow(world))
        if isinstance(feed.driver, Pilot) and feed.driver.can_push and self._dynamics is not None:
            self._stage.on_grab(self._pull)
        self._preset = "three-quarter"
        server.scene.set_up_direction("+z")
        # at viser's own brightness colours are pale
        server.scene.configure_environment_map(environment_intensity=0.4)
        server.scene.add_grid(
            "/ground", infinite_grid=True, cell_size=0.1, section_size=1.0, fade_distance=40.0, shadow_opacity=0.2
        )
        self.show(first, new=True)

    def update(self, timeout: float) -> float | None:
        """Show what is new, or was chosen; when the new frame came, None if there was none in that time [s].

        Raises:
            DaemonLost: The daemon that is shown went away.
        """
        shown = self._feed.poll(timeout)
        changed = self.looks.take_changes()
        wanted = self._panel.fields | (set(CONTACT_FIELDS) if self.looks.contacts != "off" else set())
        self._feed.want(wanted)
        if shown is not None:
            self._shown = shown
        if shown is not None or changed:
            self.show(self._shown, new=shown is not None)
        else:
            self.tell()
        return None if shown is None else self._feed.came

    def tell(self) -> None:
        """Keep the panel's text up to date, though there is no new frame."""
        self._panel.tell(self._shown, new=False)

    def show(self, shown: Any, *, new: bool) -> None:
        """Send a frame to the browsers."""
        body_q, world = np.asarray(shown.body_q), self.looks.world
        with self._server.atomic():
            self._stage.show(body_q, np.asarray(shown.status))
            self._overlay.show_axes(body_q)
            self._overlay.show_ghost(self._ghost(shown, world))
            if all(hasattr(shown, field) for field in CONTACT_FIELDS):
                self._overlay.show_contacts(shown, self._stage.shown(len(body_q)))
            held = self._grip
            self._overlay.show_pull(None if held is None else held.ends, world if held is None else held.world)
            self._panel.tell(shown, new=new)
        if self.looks.follow:
            self._go_along(body_q[world])

    def aim(self, preset: str) -> None:
        """Point the cameras of all browsers."""
        self._preset, self._centre = preset, None
        for client in self._server.get_clients().values():
            self.aim_client(client)

    def aim_client(self, client: viser.ClientHandle) -> None:
        """Point the cameras of one browser, as when it comes."""
        box = self._stage.box
        offsets = self._stage.offsets
        if self.looks.alone or self._preset == "follow":
            offsets = offsets[[self.looks.world]]
        seen = np.stack([box[0] + offsets.min(axis=0), box[1] + offsets.max(axis=0)])
        bodies = np.asarray(self._shown.body_q)[self.looks.world, :, :3]
        bodies = bodies[np.isfinite(bodies).all(axis=-1)]
        if self._preset == "follow" and len(bodies):
            # they may be far from where the world began
            seen = seen + 0.5 * (bodies.min(axis=0) + bodies.max(axis=0)) - box.mean(axis=0)
        with client.atomic():
            chosen = camera(self._preset, seen, aspect=client.camera.aspect * (1 - _PANEL_PART), fov=client.camera.fov)
            client.camera.up_direction = chosen.up
            client.camera.position = chosen.position
            client.camera.look_at = chosen.target

    def _go_along(self, body_q: Array) -> None:
        """Move the cameras with the middle of the followed world's bodies."""
        if not len(body_q):
            return
        centre = body_q[:, :3].mean(axis=0, dtype=np.float64) + self._stage.offsets[self.looks.world]
        if self._centre is None:
            self._centre = centre
        moved = _FOLLOW_PART * (centre - self._centre)
        if np.linalg.norm(moved) < _FOLLOW_LEAST:
            return
        self._centre = self._centre + moved
        for client in self._server.get_clients().values():
            with client.atomic():
                client.camera.position = client.camera.position + moved
                client.camera.look_at = client.camera.look_at + moved

    def _ghost(self, shown: Any, world: int) -> Array | None:
        if not self.looks.ghosts or self._dynamics is None or not self._driven:
            return None
        reached = at_targets(
            self._feed.info, self._driven, np.asarray(shown.joint_q)[world], np.asarray(shown.joint_target_q)[world]
        )
        return self._dynamics.forward_kinematics(reached)

    def _pull(self, world: int, body: int, phase: str, held: NDArray[np.float64], to: NDArray[np.float64]) -> None:
        driver = self._feed.driver
        assert isinstance(driver, Pilot) and self._dynamics is not None
        ends = np.stack([held, to])
        try:
            if phase == "end":
                self._grip = None
            elif self._grip is None or (self._grip.world, self._grip.body) != (world, body):
                joint_q = np.asarray(self._shown.joint_q)[world]
                self._grip = grip(self._dynamics, (world, body), ends, joint_q, self._panel.strength)
            else:
                self._grip = self._grip.towards(ends)
            driver.hold(self._grip)
        except TightloopError as problem:
            driver.problem = str(problem)


def _dynamics(info: dict[str, Any], notes: list[str]) -> tuple[Dynamics | None, list[Joint]]:
    """The scene's dynamics and driven joints; without the robots' files, a note and nothing."""
    try:
        return Dynamics.of_daemon(info), joints(info)
    except (TightloopError, OSError) as problem:
        notes.append(f"no ghosts, sliders and pushes: {problem}")
        return None, []
