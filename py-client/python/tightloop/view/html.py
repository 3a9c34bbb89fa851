"""A run as one HTML file that shows it from all sides, in any browser and without a server."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import viser

from tightloop.view.cameras import Camera, camera
from tightloop.view.display_options import Kind, Looks
from tightloop.view.overlay import Overlay
from tightloop.view.parts import Parts
from tightloop.view.source import CONTACT_FIELDS
from tightloop.view.stage import Stage

# Of the browser's window, which is not known yet.
_ASPECT = 1.6


class Html:
    """Takes what the page in the browser would show, and writes it with the page itself.

    Args:
        path: The file.
        parts: What a world looks like.
        bodies: How many bodies a world has.
        fps: Frames a second.
        view: Where the camera is at first: a preset, or a `Camera`. ``"follow"`` stands still.
        kind: Whether robots are shown as they look, or as the shapes that touch.
        contacts: Whether contacts are shown.
    """

    def __init__(
        self,
        path: Path,
        parts: Parts,
        bodies: int,
        *,
        fps: float,
        view: str | Camera = "three-quarter",
        kind: Kind = "visual",
        contacts: bool = True,
    ) -> None:
        self._path, self._parts, self._bodies = path, parts, bodies
        self._fps, self._view = fps, view
        self._looks = Looks(kind=kind, contacts="all worlds" if contacts else "off")
        with contextlib.redirect_stdout(io.StringIO()):  # viser greets
            self._server = viser.ViserServer("127.0.0.1", 0, verbose=False)
        self._stage: Stage | None = None
        self._overlay: Overlay | None = None
        self._serializer: Any = None

    def add(self, shown: Any, chosen: Sequence[int]) -> None:
        """Add a frame, of these worlds."""
        there = [name for name in ("body_q", "status", *CONTACT_FIELDS) if hasattr(shown, name)]
        own = SimpleNamespace(**{name: np.asarray(getattr(shown, name))[list(chosen)] for name in there})
        if self._stage is None:
            self._begin(own.body_q)
        assert self._stage is not None and self._overlay is not None
        self._stage.show(own.body_q, getattr(own, "status", np.zeros(len(own.body_q), int)))
        if all(hasattr(own, name) for name in CONTACT_FIELDS):
            self._overlay.show_contacts(own, range(len(own.body_q)))
        if self._serializer is None:
            self._serializer = self._server.get_scene_serializer()
        self._serializer.insert_sleep(1 / self._fps)

    def close(self) -> None:
        """Write the file."""
        if self._serializer is not None:
            self._path.write_text(self._serializer.as_html(), encoding="utf-8")
        with contextlib.redirect_stdout(io.StringIO()):
            self._server.stop()

    def _begin(self, body_q: Any) -> None:
        scene = self._server.scene
        self._stage = Stage(self._server, self._parts, len(body_q), self._looks, body_q[0])
        box, offsets = self._stage.box, self._stage.offsets
        self._overlay = Overlay(self._server, self._parts, self._looks, self._stage, bodies=self._bodies)
        scene.set_up_direction("+z")
        scene.add_grid(
            "/ground", infinite_grid=True, cell_size=0.1, section_size=1.0, fade_distance=40.0, shadow_opacity=0.2
        )
        seen = np.stack([box[0] + offsets.min(axis=0), box[1] + offsets.max(axis=0)])
        chosen = self._view if isinstance(self._view, Camera) else camera(self._view, seen, aspect=_ASPECT)
        first = self._server.initial_camera
        first.position, first.look_at, first.up, first.fov = chosen.position, chosen.target, chosen.up, chosen.fov
