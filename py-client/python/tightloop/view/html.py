"""A run as one HTML file, which any browser shows from all sides and without a server."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from tightloop.view.browser import guarded_server
from tightloop.view.browser.display_options import DisplayOptions, Kind
from tightloop.view.browser.gate import Gate
from tightloop.view.browser.overlay import Overlay
from tightloop.view.browser.stage import Lamps
from tightloop.view.cameras import Camera, camera
from tightloop.view.meshes.contact_marks import WORLDS_MAX
from tightloop.view.meshes.worlds import WorldMeshes
from tightloop.view.parts import Parts
from tightloop.view.source import CONTACT_FIELDS
from tightloop.view.tendons.batched import TendonMeshes
from tightloop.whole_files import whole_file

# Aspect ratio assumed for the browser's window, which is not known yet.
_ASPECT = 1.6


class Html:
    """Records what the viewer's page would show, and writes it into one HTML file.

    Args:
        path: The file.
        parts: Parts of one world.
        bodies: Number of bodies of a world.
        fps: Frames per second.
        view: First camera: a preset, or a `Camera`; ``"three-quarter"`` if left out. ``"follow"`` does not move.
        kind: ``"visual"`` for visual meshes, ``"collision"`` for collision shapes.
        contacts: Whether contacts are shown; if left out, those of up to four worlds.
    """

    def __init__(
        self,
        path: Path,
        parts: Parts,
        bodies: int,
        *,
        fps: float,
        view: str | Camera | None = None,
        kind: Kind = "visual",
        contacts: bool | None = None,
    ) -> None:
        self._path, self._parts, self._bodies = path, parts, bodies
        self._fps, self._view, self._contacts = fps, view or "three-quarter", contacts
        self._options = DisplayOptions(kind=kind)
        # viser records only what a server shows; nobody gets the token of this one
        self._server = guarded_server.start(Gate("127.0.0.1"), "127.0.0.1", 0)
        self._world_meshes: WorldMeshes | None = None
        self._tendons: TendonMeshes | None = None
        self._lamps: Lamps | None = None
        self._overlay: Overlay | None = None
        self._serializer: Any = None

    def add(self, shown: Any, chosen: Sequence[int]) -> None:
        """Add a frame of the chosen worlds."""
        there = [name for name in ("body_q", "act", "status", *CONTACT_FIELDS) if hasattr(shown, name)]
        own = SimpleNamespace(**{name: np.asarray(getattr(shown, name))[list(chosen)] for name in there})
        if self._world_meshes is None:
            self._begin(own.body_q)
        assert self._world_meshes is not None and self._tendons is not None and self._overlay is not None
        self._world_meshes.show(own.body_q, getattr(own, "status", np.zeros(len(own.body_q), int)))
        if self._lamps is not None:
            self._lamps.show(own.body_q[0])
        self._tendons.show(own, range(len(own.body_q)), self._world_meshes.offsets)
        if all(hasattr(own, name) for name in CONTACT_FIELDS):
            self._overlay.show_contacts(own, range(len(own.body_q)))
        if self._serializer is None:
            self._serializer = self._server.get_scene_serializer()
        self._serializer.insert_sleep(1 / self._fps)

    def close(self) -> None:
        """Write the file."""
        try:
            if self._serializer is not None:
                with whole_file(self._path) as part:
                    part.write_text(self._serializer.as_html(), encoding="utf-8")
        finally:
            self.discard()

    def discard(self) -> None:
        """Write nothing, and end the server."""
        with contextlib.redirect_stdout(io.StringIO()):
            self._server.stop()

    def _begin(self, body_q: Any) -> None:
        scene = self._server.scene
        shows = len(body_q) <= WORLDS_MAX if self._contacts is None else self._contacts
        self._options.choose(contacts="all worlds" if shows else "off")
        self._world_meshes = WorldMeshes(self._server, self._parts, len(body_q), self._options, body_q[0])
        self._tendons = TendonMeshes(self._server, self._parts.tendons, self._options)
        self._overlay = Overlay(self._server, self._parts, self._options, self._world_meshes, bodies=self._bodies)
        if len(self._parts.lights):
            scene.configure_environment_map(None)
            scene.configure_default_lights(False)
            middle = self._world_meshes.box.mean(axis=0)
            self._lamps = Lamps(scene, self._parts.lights, middle, far=len(body_q) > 1)
        scene.set_up_direction("+z")
        ground = self._world_meshes.ground
        scene.add_grid(
            "/ground",
            infinite_grid=True,
            cell_size=0.1,
            section_size=1.0,
            fade_distance=40.0,
            shadow_opacity=0.2,
            # no floor cuts through the pits of a height field
            position=(0.0, 0.0, 0.0 if ground is None else float(ground[0, 2])),
        )
        points = self._world_meshes.points(body_q)
        chosen = (
            self._view
            if isinstance(self._view, Camera)
            else camera(self._view, points, aspect=_ASPECT, ground=ground is not None)
        )
        first = self._server.initial_camera
        first.position, first.look_at, first.up, first.fov = chosen.position, chosen.target, chosen.up, chosen.fov
