"""Tendons in the browser: tubes and balls, as two batches of meshes that move and stretch in place."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from tightloop.view.browser.display_options import DisplayOptions
from tightloop.view.poses import Array, wxyz
from tightloop.view.tendons.capsules import ball, towards, tube
from tightloop.view.tendons.paths import Tendons


class TendonMeshes:
    """The tendons of all worlds in the browser.

    Args:
        server: Server of the page.
        tendons: Tendons of one world.
        options: Display options of the page.
    """

    def __init__(self, server: viser.ViserServer, tendons: Tendons, options: DisplayOptions) -> None:
        self._server, self._tendons, self._options = server, tendons, options
        self._handles: dict[str, viser.BatchedMeshHandle] = {}
        self._sent: dict[tuple[str, str], NDArray[Any]] = {}

    def show(self, shown: Any, worlds: Sequence[int], offsets: Array) -> None:
        """Move all tendons to a frame.

        Args:
            shown: A frame with ``body_q``; with ``act``, muscles are coloured.
            worlds: The visible worlds.
            offsets: Position of each world on the grid [m], shape ``(worlds, 3)``.
        """
        if not len(self._tendons):
            return
        visible = self._options.kind == "visual"
        if visible:
            chosen = list(worlds)
            segments = self._tendons.segments(np.asarray(shown.body_q, float)[chosen])
            act = np.asarray(shown.act)[chosen] if hasattr(shown, "act") else None
            colors = self._tendons.shown_colors(act, len(chosen))[:, segments.tendon].reshape(-1, 4)
            radii = np.tile(self._tendons.radii[segments.tendon], len(chosen))
            ends = segments.ends + np.asarray(offsets)[chosen, None, None]
            first, last = ends.reshape(-1, 2, 3).swapaxes(0, 1)
            self._send(first, last, radii, colors)
        for handle in self._handles.values():
            handle.visible = visible

    def _send(self, first: Array, last: Array, radii: Array, colors: Array) -> None:
        lengths = np.linalg.norm(last - first, axis=-1)
        # batches keep their number of instances: what is not there has no size
        there = np.isfinite(lengths) & (lengths > 0)
        lengths = np.where(there, lengths, 0.0)
        first, last = np.where(there[:, None], first, 0.0), np.where(there[:, None], last, 0.0)
        radii = np.where(there, radii, 0.0)
        turns = wxyz(towards((last - first) / np.where(there, lengths, 1.0)[:, None]))
        # as amounts of light, which viser takes for batches
        lit = np.rint(255 * colors[:, :3] ** 2).astype(np.uint8)
        opacities = colors[:, 3].astype(np.float32)
        sizes = np.stack([radii, radii, lengths], axis=-1)
        self._update("tubes", tube(), (first, turns, sizes, lit, opacities))
        upright = np.tile([1.0, 0, 0, 0], (2 * len(first), 1))
        round_sizes = np.repeat(np.tile(radii, 2)[:, None], 3, axis=1)
        centers = np.concatenate([first, last])
        self._update("balls", ball(), (centers, upright, round_sizes, np.tile(lit, (2, 1)), np.tile(opacities, 2)))

    def _update(self, name: str, mesh: tuple[NDArray[Any], NDArray[Any]], values: tuple[Array, ...]) -> None:
        """Send what has changed of a batch: positions, rotations, scales, colours and opacities."""
        positions, turns, sizes, colors, opacities = values
        named = {
            "batched_positions": positions.astype(np.float32),
            "batched_wxyzs": turns.astype(np.float32),
            "batched_scales": sizes.astype(np.float32),
            "batched_colors": colors,
            "batched_opacities": opacities,
        }
        is_clear = bool((opacities < 1).any())
        if name not in self._handles:
            self._handles[name] = self._server.scene.add_batched_meshes_simple(
                f"/tendons/{name}",
                *mesh,
                named["batched_wxyzs"],
                named["batched_positions"],
                batched_scales=named["batched_scales"],
                batched_colors=colors,
                batched_opacities=opacities if is_clear else None,
                lod="off",
            )
        for prop, value in named.items():
            before = self._sent.get((name, prop))
            if before is not None and not np.array_equal(before, value) and (prop != "batched_opacities" or is_clear):
                setattr(self._handles[name], prop, value)
            self._sent[name, prop] = value
