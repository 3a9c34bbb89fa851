"""The worlds in the browser: one batched mesh for what looks alike in all of them, moved in place."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from tightloop.view import grid
from tightloop.view.display_options import Looks
from tightloop.view.parts import Part
from tightloop.view.poses import IDENTITY, Array, wxyz
from tightloop.view.skins import Skin, skins
from tightloop.view.source import FROZEN

_RED = np.array([200, 0, 0])
_TINT = 0.9
# Shadows and fine meshes of more worlds than that cost the browser more than they show.
_FINE_WORLDS = 16

#: Called while a body is dragged: world, body, ``"start"``, ``"update"`` or ``"end"``, where it is held and where to
#: [m], both shape ``(3,)``, in the world's own axes.
Grab = Callable[[int, int, str, NDArray[np.float64], NDArray[np.float64]], None]


@dataclass
class _Batch:
    """A skin in every world shown, and what was sent of it last."""

    skin: Skin
    handle: viser.BatchedMeshHandle
    poses: Array | None = None
    worlds: tuple[int, ...] = ()
    frozen: tuple[int, ...] = ()


class Stage:
    """What of the scene is in the browser, apart from what is laid over it.

    Attributes:
        box: The box around one world at the start [m], shape ``(2, 3)``.
        offsets: Where each world stands [m], shape ``(worlds, 3)``.

    Args:
        server: Where it is shown.
        parts: What a world looks like.
        worlds: How many there may be.
        looks: What the one who looks chose.
        first: Poses of the bodies of one world at the start, shape ``(bodies, 7)``: the grid is made for them.
    """

    def __init__(
        self, server: viser.ViserServer, parts: Iterable[Part], worlds: int, looks: Looks, first: Array
    ) -> None:
        parts = list(parts)
        self._server = server
        self._looks = looks
        self.box = grid.extent(parts, first)
        self.offsets = grid.offsets(worlds, self.box)
        self._batches = {
            kind: self._batches_of(kind, [part for part in parts if part.kind == kind])
            for kind in ("visual", "collision")
        }

    def _batches_of(self, kind: str, parts: Sequence[Part]) -> list[_Batch]:
        fine = len(self.offsets) <= _FINE_WORLDS
        return [
            _Batch(
                skin,
                self._server.scene.add_batched_meshes_simple(
                    f"/{kind}/{number}",
                    skin.vertices,
                    skin.faces,
                    np.array([[1.0, 0, 0, 0]]),
                    np.zeros((1, 3)),
                    batched_colors=np.array([skin.color[:3]], np.uint8),
                    opacity=None if skin.color[3] == 255 else skin.color[3] / 255,
                    lod="off" if fine else "auto",
                    # surfaces of robot files do not agree on their outside
                    side="double",
                    cast_shadow=fine,
                    receive_shadow=fine,
                    visible=False,
                ),
            )
            for number, skin in enumerate(skins(parts))
        ]

    def on_click(self, click: Callable[[int, int], None]) -> None:
        """Call something with the world and the body (-1 for none) that were clicked."""
        for batch in self._all():

            @batch.handle.on_click
            def _(event: Any, batch: _Batch = batch) -> None:
                if found := _found(batch, event.instance_index):
                    click(*found)

    def on_grab(self, grab: Grab) -> None:
        """Call something while a body is dragged with Shift held down."""
        for batch in self._all():
            if -1 in batch.skin.bodies:
                continue

            # a coroutine: viser calls functions in threads, where an update may overtake the end
            @batch.handle.on_drag("left", modifier="shift")
            async def _(event: Any, batch: _Batch = batch) -> None:
                if found := _found(batch, event.instance_index):
                    offset = self.offsets[found[0]]
                    held, to = (np.array(end, float) - offset for end in (event.start_position, event.end_position))
                    grab(*found, event.phase, held, to)

    def show(self, body_q: Array, status: Array) -> None:
        """Put everything where it is now, and tint worlds that are frozen.

        Args:
            body_q: Poses of the bodies, shape ``(worlds, bodies, 7)``.
            status: Trouble of each world, shape ``(worlds,)``.
        """
        shown = self.shown(len(body_q))
        frozen = tuple(world for world in shown if status[world] & FROZEN)
        for kind, batches in self._batches.items():
            for batch in batches:
                batch.handle.visible = kind == self._looks.kind
                if kind == self._looks.kind:
                    _move(batch, body_q, shown, self.offsets)
                    _tint(batch, shown, frozen)

    def shown(self, worlds: int) -> tuple[int, ...]:
        """The worlds that are shown, of the first so many."""
        return (min(self._looks.world, worlds - 1),) if self._looks.alone else tuple(range(worlds))

    def _all(self) -> list[_Batch]:
        return [batch for batches in self._batches.values() for batch in batches]


def _found(batch: _Batch, instance: int | None) -> tuple[int, int] | None:
    """World and body of an instance of a batch, if it is still there."""
    row, column = divmod(instance or 0, len(batch.skin.bodies))
    return (batch.worlds[row], batch.skin.bodies[column]) if row < len(batch.worlds) else None


def _move(batch: _Batch, body_q: Array, shown: tuple[int, ...], offsets: Array) -> None:
    if -1 in batch.skin.bodies:
        if batch.worlds == shown:
            return
        poses = np.broadcast_to(IDENTITY, (len(shown), 1, 7))
    else:
        poses = body_q[:, batch.skin.bodies][list(shown)]
        # frames of what stands still are equal, bit for bit
        if batch.worlds == shown and batch.poses is not None and np.array_equal(poses, batch.poses):
            return
    places = poses[..., :3] + offsets[list(shown), None]
    batch.handle.batched_positions = places.reshape(-1, 3).astype(np.float32)
    batch.handle.batched_wxyzs = wxyz(poses[..., 3:]).reshape(-1, 4).astype(np.float32)
    batch.poses, batch.worlds = poses, shown


def _tint(batch: _Batch, shown: tuple[int, ...], frozen: tuple[int, ...]) -> None:
    instances = len(shown) * len(batch.skin.bodies)
    if batch.frozen == frozen and len(batch.handle.batched_colors) == instances:
        return
    color = np.array(batch.skin.color[:3])
    red = np.repeat(np.isin(shown, frozen), len(batch.skin.bodies))[:, None]
    batch.handle.batched_colors = np.where(red, color + (_RED - color) * _TINT, color).astype(np.uint8)
    batch.frozen = frozen
