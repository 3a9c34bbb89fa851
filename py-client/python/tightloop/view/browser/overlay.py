"""The overlay of a page: contact points and forces, the robot at its targets, the axes of its bodies."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from tightloop.view.browser.display_options import DisplayOptions
from tightloop.view.meshes.batched import batched_meshes
from tightloop.view.meshes.contact_marks import contact_marks
from tightloop.view.meshes.worlds import WorldMeshes
from tightloop.view.parts import Part
from tightloop.view.poses import Array, wxyz

_POINT_COLOR = (250, 190, 30)
_FORCE_COLOR = (230, 60, 40)
_GHOST_COLOR = (60, 170, 240)
# Sizes of marks as fractions of a link: a point, and an arrow's shaft and head.
_POINT_PART, _SHAFT_PART, _HEAD_PART = 0.025, 0.008, 0.02
# Length of body axes as a fraction of the size of a world.
_AXES_PART = 0.05


class Overlay:
    """The scene handles of the overlay.

    Args:
        server: Server of the page.
        parts: Parts of one world.
        options: Display options of the page.
        world_meshes: Meshes of the worlds, which know where each world stands.
        bodies: Number of bodies of a world.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        parts: Iterable[Part],
        options: DisplayOptions,
        world_meshes: WorldMeshes,
        *,
        bodies: int,
    ) -> None:
        self._options = options
        self._offsets = world_meshes.offsets
        box = world_meshes.box
        link = self._link = world_meshes.framing.link
        scene = server.scene
        self._points = scene.add_point_cloud(
            "/contacts/points",
            np.zeros((0, 3), np.float32),
            _POINT_COLOR,
            point_size=_POINT_PART * link,
            point_shape="circle",
            precision="float32",
            visible=False,
        )
        self._forces = scene.add_arrows(
            "/contacts/forces",
            np.zeros((0, 2, 3), np.float32),
            _FORCE_COLOR,
            shaft_radius=_SHAFT_PART * link,
            head_radius=_HEAD_PART * link,
            head_length=2 * _HEAD_PART * link,
            visible=False,
        )
        # a dragged body is connected to the pointer by a line
        self._drag_line = scene.add_line_segments(
            "/drag", np.zeros((0, 2, 3), np.float32), np.array(_FORCE_COLOR), thickness=3.0, visible=False
        )
        length = float(np.linalg.norm(box[1] - box[0])) * _AXES_PART
        self._axes = scene.add_batched_axes(
            "/axes",
            np.tile([1.0, 0, 0, 0], (max(bodies, 1), 1)),
            np.zeros((max(bodies, 1), 3)),
            axes_length=length,
            axes_radius=length / 20,
            visible=False,
        )
        moving = [part for part in parts if part.kind == "visual" and part.body >= 0]
        self._ghosts = [
            (
                mesh.bodies,
                scene.add_batched_meshes_simple(
                    f"/ghost/{number}",
                    mesh.vertices,
                    mesh.faces,
                    np.tile([1.0, 0, 0, 0], (len(mesh.bodies), 1)),
                    np.zeros((len(mesh.bodies), 3)),
                    batched_colors=_GHOST_COLOR,
                    opacity=0.35,
                    lod="off",
                    cast_shadow=False,
                    receive_shadow=False,
                    visible=False,
                ),
            )
            for number, mesh in enumerate(batched_meshes(moving))
        ]

    def show_contacts(self, shown: Any, worlds: Iterable[int]) -> None:
        """Show contact points and forces, if the options ask for them.

        Args:
            shown: Frame with ``contact_count``, ``contact_pos`` and ``contact_force``.
            worlds: Visible worlds.
        """
        wanted = self._options.contacts != "off"
        self._points.visible = self._forces.visible = wanted
        if not wanted:
            return
        chosen = [self._options.world] if self._options.contacts == "followed world" else list(worlds)
        marks = contact_marks(shown, chosen, self._offsets[chosen], scale=self._options.force_scale, longest=self._link)
        self._points.points = marks.points.astype(np.float32)
        self._forces.points = np.stack([marks.points, marks.points + marks.arrows], axis=1).astype(np.float32)

    def show_axes(self, body_q: Array) -> None:
        """Show the body axes of the followed world, if the options ask for them; ``body_q`` is of all worlds."""
        wanted = self._options.frames and body_q.shape[1] > 0
        self._axes.visible = wanted
        if wanted:
            poses = body_q[self._options.world]
            self._axes.batched_positions = (poses[:, :3] + self._offsets[self._options.world]).astype(np.float32)
            self._axes.batched_wxyzs = wxyz(poses[:, 3:]).astype(np.float32)

    def show_ghost(self, body_q: Array | None) -> None:
        """Show the followed world at its joint targets, poses ``(bodies, 7)``; None hides it."""
        for bodies, handle in self._ghosts:
            handle.visible = body_q is not None
            if body_q is not None:
                poses = body_q[list(bodies)]
                handle.batched_positions = (poses[:, :3] + self._offsets[self._options.world]).astype(np.float32)
                handle.batched_wxyzs = wxyz(poses[:, 3:]).astype(np.float32)

    def show_drag(self, ends: NDArray[np.float64] | None, world: int) -> None:
        """Show the line from the grabbed point to the pointer [m], shape ``(2, 3)``; None hides it."""
        self._drag_line.visible = ends is not None
        if ends is not None:
            self._drag_line.points = (ends + self._offsets[world])[None].astype(np.float32)
