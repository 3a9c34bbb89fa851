"""The cameras of a page's browsers: aimed at presets, kept on robots that move away."""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import numpy as np
import viser
from numpy.typing import ArrayLike, NDArray

from tightloop.view.cameras import Camera, kept

# A camera that differs from all those that were sent by this part of its distance was moved by the user.
_MOVED = 0.02
# Cameras that the browser may still report, which may be some seconds behind.
_SENT = 512
# In each frame a camera that has to move goes this part of the way, which avoids jerks.
_PART = 0.2
# It ignores smaller movements, as a part of its distance.
_LEAST = 1e-4


class Aim:
    """Where this process pointed the camera of one browser.

    Args:
        client: The browser.
    """

    def __init__(self, client: viser.ClientHandle) -> None:
        self._client = client
        # Cameras that were sent, after the one that the browser had before.
        self._sent: deque[Camera] = deque(maxlen=_SENT)

    def point(self, camera: Camera) -> None:
        """Point the camera anew; it is ours until the user moves it."""
        now = self._client.camera
        self._sent.append(replace(camera, position=_sum(now.position), target=_sum(now.look_at)))
        self._send(camera, whole=True)

    def keep(self, points: NDArray[np.float64]) -> bool:
        """Move the camera as little as shows all points, unless the user has moved it; return whether it moved."""
        if not self._sent or not len(points) or not self._is_ours():
            return False
        now = self._sent[-1]
        aspect = self._client.camera.aspect
        step = np.subtract(kept(now, points, aspect=aspect).position, now.position) * _PART
        target = np.subtract(kept(now, points, aspect=aspect).target, now.target) * _PART
        if np.linalg.norm(step) <= _LEAST * _distance(now):
            return False
        self._send(replace(now, position=_sum(now.position, step), target=_sum(now.target, target)), whole=False)
        return True

    def _is_ours(self) -> bool:
        """Whether the browser shows what was sent, now or shortly before."""
        camera = self._client.camera
        slack = _MOVED * _distance(self._sent[-1])
        # one by one, since a report may arrive between the sending of a position and of its target
        ours = any(
            np.linalg.norm(np.subtract(camera.position, sent.position)) < slack for sent in reversed(self._sent)
        ) and any(np.linalg.norm(np.subtract(camera.look_at, sent.target)) < slack for sent in reversed(self._sent))
        if not ours:
            self._sent.clear()
        return ours

    def _send(self, camera: Camera, *, whole: bool) -> None:
        self._sent.append(camera)
        with self._client.atomic():
            if whole:
                self._client.camera.fov = camera.fov
                self._client.camera.up_direction = camera.up
            self._client.camera.position = camera.position
            self._client.camera.look_at = camera.target


def _distance(camera: Camera) -> float:
    return float(np.linalg.norm(np.subtract(camera.position, camera.target)))


def _sum(point: ArrayLike, step: ArrayLike = 0.0) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in np.add(point, step))
    return x, y, z
