"""Points around the subject of a scene, to which cameras are fitted."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from tightloop.view.meshes import grid, ground
from tightloop.view.meshes.outlines import outline
from tightloop.view.parts import Part
from tightloop.view.poses import Array, place, rotate
from tightloop.view.subject import Subject

# Among many worlds, a body this far from its usual place is lost and not framed, in sizes of a world.
_STRAY = 4.0


class Framing:
    """The outlines of a scene's bodies.

    Attributes:
        link: Usual size of a body of the main robot [m], the median; 0.5 if nothing is seen of it.

    Args:
        parts: Parts of one world, of one kind; sites do not count.
        subject: The bodies that count.
    """

    def __init__(self, parts: Iterable[Part], subject: Subject) -> None:
        self._parts = [part for part in parts if not part.is_site]
        self._ground = ground.extent(self._parts)
        self._subject = subject
        own: dict[int, list[NDArray[np.float64]]] = {body: [] for body in subject.bodies.tolist()}
        for part in self._parts:
            if part.body in own:
                own[part.body].append(place(part.pose, outline(part.mesh)))
        self._outlines = {body: np.concatenate(points) for body, points in own.items() if points}
        robot = [self._outlines[body] for body in subject.robot.tolist() if body in self._outlines]
        self.link = float(np.median([np.ptp(points, axis=0).max() for points in robot])) if robot else 0.5

    def points(self, body_q: Array, offsets: Array, *, robot: bool = False) -> NDArray[np.float64]:
        """Return points around the subject in some worlds [m], shape ``(n, 3)``.

        They are corners of a box around a world if no body of the subject is seen, and none if no pose is finite.

        Args:
            body_q: Body poses of these worlds, shape ``(worlds, bodies, 7)``.
            offsets: Position of each of these worlds on the grid [m], shape ``(worlds, 3)``.
            robot: Whether only the main robot counts.
        """
        body_q, offsets = np.asarray(body_q, float), np.asarray(offsets, float)
        box = grid.extent(self._parts, body_q[0])
        if not self._outlines:
            corners = np.stack(np.meshgrid(*box.T), axis=-1).reshape(-1, 3)
            return (corners + offsets[:, None]).reshape(-1, 3)
        wanted = self._outlines.keys() & set((self._subject.robot if robot else self._subject.bodies).tolist())
        found = [np.zeros((0, 3))]
        for body in sorted(wanted or self._outlines):
            poses = body_q[:, body]
            kept = np.flatnonzero(np.isfinite(poses).all(axis=-1))
            kept = kept[self._is_there(poses[kept, :3], box)]
            turned = rotate(poses[kept, None, 3:], self._outlines[body])
            found.append((turned + (poses[kept, :3] + offsets[kept])[:, None]).reshape(-1, 3))
        return np.concatenate(found)

    def _is_there(self, places: NDArray[np.float64], box: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which places of a body in several worlds are to be framed; ``box`` is that of one world."""
        if self._ground is not None:
            # worlds start at places of their own on the ground they share
            on = ground.inside(self._ground, places)
            return on if on.any() else np.ones_like(on)
        usual = np.median(places, axis=0) if len(places) else np.zeros(3)
        return np.linalg.norm(places - usual, axis=-1) <= _STRAY * np.linalg.norm(box[1] - box[0])

    def middle(self, body_q: Array) -> NDArray[np.float64] | None:
        """Return the mean position of the main robot's bodies in a world [m], or None if it is not finite.

        Args:
            body_q: Body poses of the world, shape ``(bodies, 7)``.
        """
        middle = np.asarray(body_q, float)[self._subject.robot, :3].mean(axis=0) if len(self._subject.robot) else None
        return middle if middle is not None and np.isfinite(middle).all() else None
