"""The worlds in the browser: one batched mesh for each distinct mesh, whose instances move in place."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from tightloop.arrays.frames import FAULTED
from tightloop.view.browser.display_options import DisplayOptions
from tightloop.view.framing import Framing
from tightloop.view.meshes import grid, ground
from tightloop.view.meshes.batched import BatchedMesh, batched_meshes
from tightloop.view.meshes.floor import is_floor
from tightloop.view.parts import Part, Parts
from tightloop.view.poses import IDENTITY, Array, wxyz

_RED = np.array([200, 0, 0])
_TINT = 0.9
# With more worlds, shadows and full-detail meshes are too slow in the browser.
_FINE_WORLDS = 16

#: Called while a body is dragged: world, body, ``"start"``, ``"update"`` or ``"end"``, then the grabbed point and the
#: pointer [m], both shape ``(3,)``, in the world's own axes.
OnDrag = Callable[[int, int, str, NDArray[np.float64], NDArray[np.float64]], None]


@dataclass
class _Batch:
    """A mesh in every visible world, and the last state sent to the browser."""

    mesh: BatchedMesh
    handle: viser.BatchedMeshHandle
    poses: Array | None = None
    worlds: tuple[int, ...] = ()
    frozen: tuple[int, ...] = ()


class WorldMeshes:
    """The batched meshes of all worlds in the browser.

    Attributes:
        box: Bounding box of one world at the start [m], shape ``(2, 3)``.
        offsets: Position of each world on the grid [m], shape ``(worlds, 3)``.
        framing: The outlines of a world's robots and free bodies.

    Args:
        server: Server of the page.
        parts: Parts of one world.
        worlds: Largest number of worlds.
        options: Display options of the page.
        first: Body poses of one world at the start, shape ``(bodies, 7)``; they set the size of the grid's cells.
    """

    def __init__(
        self, server: viser.ViserServer, parts: Parts, worlds: int, options: DisplayOptions, first: Array
    ) -> None:
        self._server = server
        self._options = options
        self.framing = Framing(parts.of("visual") or parts.of("collision"), parts.subject)
        self.box = grid.extent(parts, first)
        #: Bounding box of the height field that all worlds share [m], shape ``(2, 3)``, or None.
        self.ground = ground.extent(parts)
        self.offsets = grid.offsets(worlds, self.box, in_place=self.ground is not None)
        seen: dict[str, list[Part]] = {"visual": [], "collision": [], "field": []}
        for part in parts:
            if not is_floor(part):
                seen[part.kind].append(part)
        # a large field looks as it touches, mostly: browsers then get it once
        for part in [part for part in seen["visual"] if ground.is_ground(part)]:
            twins = [other for other in seen["collision"] if other.mesh is part.mesh and other.name == part.name]
            if twins:
                seen["visual"].remove(part)
                seen["collision"].remove(twins[0])
                seen["field"].append(part)
        self._batches = {kind: self._batches_of(kind, own) for kind, own in seen.items()}

    def points(self, body_q: Array, world: int | None = None) -> NDArray[np.float64]:
        """Return points around the robots and free bodies on the grid [m], shape ``(n, 3)``.

        Args:
            body_q: Body poses, shape ``(worlds, bodies, 7)``.
            world: The only world whose robot counts, or None for all visible worlds.
        """
        shown = list(self.shown(len(body_q))) if world is None else [world]
        found = self.framing.points(body_q[shown], self.offsets[shown], robot=world is not None)
        return found if len(found) else self.box + self.offsets[shown].mean(axis=0)

    def _batches_of(self, kind: str, parts: Sequence[Part]) -> list[_Batch]:
        fine = len(self.offsets) <= _FINE_WORLDS
        return [
            _Batch(
                mesh,
                self._server.scene.add_batched_meshes_simple(
                    f"/{kind}/{number}",
                    mesh.vertices,
                    mesh.faces,
                    np.array([[1.0, 0, 0, 0]]),
                    np.zeros((1, 3)),
                    batched_colors=_light(np.array([mesh.color[:3]])),
                    opacity=None if mesh.color[3] == 255 else mesh.color[3] / 255,
                    lod="off" if fine or mesh.flat else "auto",
                    flat_shading=mesh.flat,
                    # the browser compares shadows with the faces that are seen from behind where there are any, so that
                    # a closed mesh does not shadow itself; a floor would
                    side="front" if mesh.closed else "double",
                    cast_shadow=fine and (mesh.closed or mesh.bodies != (-1,)),
                    receive_shadow=fine,
                    visible=False,
                ),
            )
            for number, mesh in enumerate(batched_meshes(parts))
        ]

    def on_click(self, click: Callable[[int, int], None]) -> None:
        """Register a callback for clicks, which gets the world and the body (-1 for the world itself)."""
        for batch in self._all():

            @batch.handle.on_click
            def _(event: Any, batch: _Batch = batch) -> None:
                found = _found(batch, event.instance_index)
                # ground that all worlds share belongs to none of them
                if found and (found[1] >= 0 or self.ground is None):
                    click(*found)

    def on_drag(self, callback: OnDrag) -> None:
        """Register a callback for drags of a body with Shift held down."""
        for batch in self._all():
            if -1 in batch.mesh.bodies:
                continue

            # a coroutine: viser calls plain functions in threads, where an update may come after the end
            @batch.handle.on_drag("left", modifier="shift")
            async def _(event: Any, batch: _Batch = batch) -> None:
                if found := _found(batch, event.instance_index):
                    offset = self.offsets[found[0]]
                    held, to = (np.array(end, float) - offset for end in (event.start_position, event.end_position))
                    callback(*found, event.phase, held, to)

    def show(self, body_q: Array, status: Array) -> None:
        """Move all meshes to the given poses, and tint faulted worlds.

        Args:
            body_q: Body poses, shape ``(worlds, bodies, 7)``.
            status: Status bits of each world, shape ``(worlds,)``.
        """
        shown = self.shown(len(body_q))
        frozen = tuple(world for world in shown if status[world] & FAULTED)
        for kind, batches in self._batches.items():
            for batch in batches:
                visible = batch.handle.visible = kind in (self._options.kind, "field")
                if not visible:
                    continue
                if self.ground is not None and -1 in batch.mesh.bodies:
                    _move(batch, body_q, (0,), self.offsets)
                    _tint(batch, (0,), ())
                else:
                    _move(batch, body_q, shown, self.offsets)
                    _tint(batch, shown, frozen)

    def shown(self, worlds: int) -> tuple[int, ...]:
        """Return the visible ones of ``worlds`` worlds."""
        return (min(self._options.world, worlds - 1),) if self._options.alone else tuple(range(worlds))

    def _all(self) -> list[_Batch]:
        return [batch for batches in self._batches.values() for batch in batches]


def _found(batch: _Batch, instance: int | None) -> tuple[int, int] | None:
    """Return world and body of an instance of a batch, or None if it is gone."""
    row, column = divmod(instance or 0, len(batch.mesh.bodies))
    return (batch.worlds[row], batch.mesh.bodies[column]) if row < len(batch.worlds) else None


def _move(batch: _Batch, body_q: Array, shown: tuple[int, ...], offsets: Array) -> None:
    if -1 in batch.mesh.bodies:
        if batch.worlds == shown:
            return
        poses = np.broadcast_to(IDENTITY, (len(shown), 1, 7))
    else:
        poses = body_q[:, batch.mesh.bodies][list(shown)]
        # poses of resting bodies are equal bit for bit
        if batch.worlds == shown and batch.poses is not None and np.array_equal(poses, batch.poses):
            return
    places = poses[..., :3] + offsets[list(shown), None]
    batch.handle.batched_positions = places.reshape(-1, 3).astype(np.float32)
    batch.handle.batched_wxyzs = wxyz(poses[..., 3:]).reshape(-1, 4).astype(np.float32)
    batch.poses, batch.worlds = poses, shown


def _tint(batch: _Batch, shown: tuple[int, ...], frozen: tuple[int, ...]) -> None:
    instances = len(shown) * len(batch.mesh.bodies)
    if batch.frozen == frozen and len(batch.handle.batched_colors) == instances:
        return
    color = np.array(batch.mesh.color[:3])
    red = np.repeat(np.isin(shown, frozen), len(batch.mesh.bodies))[:, None]
    batch.handle.batched_colors = _light(np.where(red, color + (_RED - color) * _TINT, color))
    batch.frozen = frozen


def _light(colors: Array) -> NDArray[np.uint8]:
    """Return colours as amounts of light, which viser takes for batches: a byte of a picture is the square root."""
    return np.rint(255.0 * (np.asarray(colors) / 255.0) ** 2).astype(np.uint8)
