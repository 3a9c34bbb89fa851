"""A page in the browser that shows one frame stream: worlds, overlay, controls and cameras."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from tightloop.errors import ResourceError, TightloopError
from tightloop.planning.dynamics import Dynamics
from tightloop.view.browser.aim import Aim
from tightloop.view.browser.display_options import DisplayOptions
from tightloop.view.browser.drag_spring import DragSpring, drag_spring
from tightloop.view.browser.frame_stream import FEW_WORLDS, FrameStream
from tightloop.view.browser.joints import Joint, at_targets, joints
from tightloop.view.browser.live_driver import LiveDriver
from tightloop.view.browser.loop_link import LoopLink
from tightloop.view.browser.overlay import Overlay
from tightloop.view.browser.panel import Panel
from tightloop.view.browser.stage import add_stage
from tightloop.view.cameras import camera
from tightloop.view.meshes import floor
from tightloop.view.meshes.worlds import WorldMeshes
from tightloop.view.parts import parts
from tightloop.view.poses import Array
from tightloop.view.source import CONTACT_FIELDS
from tightloop.view.tendons.batched import TendonMeshes

# Cameras are re-aimed this often; the points of many worlds take longer to find.
_KEEP_SECONDS, _KEEP_MANY_SECONDS = 0.03, 0.25
# In each frame a following camera moves by a tenth of its distance to the target, which avoids jerks.
_FOLLOW_PART = 0.1
# The camera ignores smaller movements [m].
_FOLLOW_LEAST = 1e-5


class Page:
    """What a browser shows of a stream.

    Args:
        server: Server of the page, without the handles of another stream.
        stream: Frames to show.
        first: First frame.
        link: As of `Panel`.
    """

    def __init__(
        self, server: viser.ViserServer, stream: FrameStream, first: Any, *, link: LoopLink | None = None
    ) -> None:
        info = stream.info
        self.options = DisplayOptions()
        self._server = server
        self._stream = stream
        self._shown = first
        self._spring: DragSpring | None = None
        self._centre: NDArray[np.float64] | None = None
        scene_parts = parts(info["scene"], info["scene_folder"], info["body_names"])
        notes = [str(note) for note in (*stream.notes, *info.get("notes", ()), *scene_parts.notes)]
        self._dynamics, self._driven = _dynamics(info, notes)
        body_q = np.asarray(first.body_q)
        self._world_meshes = WorldMeshes(server, scene_parts, stream.worlds, self.options, body_q[0])
        self._tendons = TendonMeshes(server, scene_parts.tendons, self.options)
        self._overlay = Overlay(
            server, scene_parts.parts, self.options, self._world_meshes, bodies=len(info["body_names"])
        )
        self._floats = scene_parts.subject.floats
        # as films do
        self._preset = "follow" if self._floats and stream.worlds == 1 else "three-quarter"
        self.options.follow = self._preset == "follow"
        self._aims: dict[int, Aim] = {}
        self._kept_at, self._at_rest = 0.0, False
        chosen = {"driven": self._driven, "aim": self.aim, "notes": notes, "preset": self._preset}
        self._panel = Panel(server, stream, self.options, **chosen, link=link)
        self._world_meshes.on_click(lambda world, _: self._panel.follow(world))
        if isinstance(stream.driver, LiveDriver) and stream.driver.can_push and self._dynamics is not None:
            self._world_meshes.on_drag(self._drag)
        # beside the scene, not over it: cameras then aim at what the panel leaves free
        server.gui.main_panel.dock_right()
        server.scene.set_up_direction("+z")
        box = self._world_meshes.box
        ground = self._world_meshes.ground
        height = floor.height(scene_parts, box, ground)
        self._lamps = add_stage(
            server.scene,
            box if ground is None else ground,
            self._world_meshes.offsets,
            height,
            lights=scene_parts.lights,
        )
        self.show(first, new=True)

    def update(self, timeout: float) -> float | None:
        """Show a new frame or changed options.

        Args:
            timeout: How long to wait for a frame [s].

        Returns:
            When the new frame arrived, on the monotonic clock [s]; None without a new frame.

        Raises:
            DaemonLost: The daemon that is shown went away.
        """
        shown = self._stream.poll(timeout)
        changed = self.options.take_changes()
        wanted = self._panel.fields | (set(CONTACT_FIELDS) if self.options.contacts != "off" else set())
        try:
            self._stream.want(wanted)
        except ResourceError as problem:  # such as images of all worlds that exceed memory
            self._stream.driver.problem = str(problem)
            self._panel.drop_image()
        if shown is not None:
            self._shown = shown
        if shown is not None or changed:
            self.show(self._shown, new=shown is not None)
        else:
            self.update_text()
        self._move_cameras(new=shown is not None)
        return None if shown is None else self._stream.came

    def update_text(self) -> None:
        """Update the panel's text without a new frame."""
        self._panel.update(self._shown, new=False)

    def hide_controls(self) -> None:
        """Hide the panel's controls and text, beside the last picture."""
        self._panel.hide()

    def show(self, shown: Any, *, new: bool) -> None:
        """Send a frame to the browsers."""
        body_q, world = np.asarray(shown.body_q), self.options.world
        with self._server.atomic():
            self._world_meshes.show(body_q, np.asarray(shown.status))
            self._tendons.show(shown, self._world_meshes.shown(len(body_q)), self._world_meshes.offsets)
            self._lamps.show(body_q[world])
            self._overlay.show_axes(body_q)
            self._overlay.show_ghost(self._ghost(shown, world))
            if all(hasattr(shown, field) for field in CONTACT_FIELDS):
                self._overlay.show_contacts(shown, self._world_meshes.shown(len(body_q)))
            held = self._spring
            self._overlay.show_drag(None if held is None else held.ends, world if held is None else held.world)
            self._panel.update(shown, new=new)

    def aim(self, preset: str) -> None:
        """Point the cameras of all browsers."""
        self._preset, self._centre = preset, None
        for client in self._server.get_clients().values():
            self.aim_client(client)

    def aim_client(self, client: viser.ClientHandle) -> None:
        """Point the camera of one browser, for example when it connects."""
        world = self.options.world if self._preset == "follow" else None
        points = self._world_meshes.points(np.asarray(self._shown.body_q), world)
        aim, self._at_rest = self._aims.setdefault(client.client_id, Aim(client)), False
        ground = self._world_meshes.ground is not None
        aim.point(camera(self._preset, points, aspect=client.camera.aspect, ground=ground))

    def _move_cameras(self, *, new: bool) -> None:
        """Move the cameras with robots that move, also after their last frame until they are where they belong."""
        body_q = np.asarray(self._shown.body_q)
        self._at_rest = self._at_rest and not new
        if self.options.follow:
            self._follow(body_q[self.options.world])
        elif self._floats and not self._at_rest:
            self._keep(body_q)

    def _keep(self, body_q: Array) -> None:
        """Re-aim the cameras at robots that walk out of the picture, unless users have moved them."""
        now = time.monotonic()
        if now - self._kept_at < (_KEEP_SECONDS if len(body_q) <= FEW_WORLDS else _KEEP_MANY_SECONDS):
            return
        self._kept_at = now
        clients = self._server.get_clients()
        self._aims = {number: aim for number, aim in self._aims.items() if number in clients}
        if self._aims:
            points = self._world_meshes.points(body_q, None)
            self._at_rest = not any([aim.keep(points) for aim in self._aims.values()])

    def _follow(self, body_q: Array) -> None:
        """Move the cameras with the mean position of the followed world's robot."""
        middle = self._world_meshes.framing.middle(body_q)
        if middle is None:
            return
        centre = middle + self._world_meshes.offsets[self.options.world]
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
        if not self.options.ghosts or self._dynamics is None or not self._driven:
            return None
        reached = at_targets(
            self._stream.info, self._driven, np.asarray(shown.joint_q)[world], np.asarray(shown.joint_target_q)[world]
        )
        return self._dynamics.forward_kinematics(reached)

    def _drag(self, world: int, body: int, phase: str, held: NDArray[np.float64], to: NDArray[np.float64]) -> None:
        driver = self._stream.driver
        assert isinstance(driver, LiveDriver) and self._dynamics is not None
        ends = np.stack([held, to])
        try:
            if phase == "end":
                self._spring = None
            elif self._spring is None or (self._spring.world, self._spring.body) != (world, body):
                joint_q = np.asarray(self._shown.joint_q)[world]
                self._spring = drag_spring(self._dynamics, (world, body), ends, joint_q, self._panel.strength)
            else:
                self._spring = self._spring.towards(ends)
            driver.drag(self._spring)
        except TightloopError as problem:
            driver.problem = str(problem)


def _dynamics(info: dict[str, Any], notes: list[str]) -> tuple[Dynamics | None, list[Joint]]:
    """Return the scene's dynamics and driven joints; without the robots' files, add a note and return neither."""
    try:
        return Dynamics.of_daemon(info), joints(info)
    except (TightloopError, OSError) as problem:
        notes.append(f"no ghosts, sliders and pushes: {problem}")
        return None, []
