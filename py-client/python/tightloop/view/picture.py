"""Pictures of worlds, drawn without a display, a browser or a graphics driver."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tightloop import _core
from tightloop.arrays.frames import FAULTED
from tightloop.checks import arguments as checks
from tightloop.checks.signatures import checked_calls
from tightloop.errors import ArgumentError
from tightloop.view import cameras, lights
from tightloop.view.arguments import check_camera, check_contacts
from tightloop.view.cameras import Camera
from tightloop.view.framing import Framing
from tightloop.view.meshes import floor, grid, ground
from tightloop.view.meshes.contact_marks import WORLDS_MAX, contact_marks
from tightloop.view.meshes.goal_markers import goal_marker
from tightloop.view.parts import Mesh, Part, Parts
from tightloop.view.poses import Array, compose
from tightloop.view.source import CONTACT_FIELDS
from tightloop.view.subject import whole
from tightloop.view.tendons.drawn import DrawnTendons

_RED = (225, 40, 40, 180)
_GHOST = (60, 170, 240, 190)
_GHOST_OPACITY = 0.35
_PLAIN = (0, 0, 0, 0)
_POINT = (250, 190, 30, 255)
_FORCE = (230, 60, 40, 255)
# Length of a force arrow [m/N].
_FORCE_SCALE = 0.01
# Widths of points and arrows as fractions of a link, and their limits [pixels].
_POINT_PART, _FORCE_PART = 0.05, 0.02
_WIDTH_MIN, _WIDTH_MAX = 1.5, 12.0
_FOV = 0.6
# How far shadows on a height field reach around the camera's target, as a fraction of its distance.
_GROUND_PART = 0.7


@checked_calls
class Picture:
    """Draws the worlds of a frame or a `Shown`; the same worlds give the same bytes.

    Robots and free bodies fill the first picture of a preset, which sets the camera. In later pictures it moves only to
    keep robots with a fixed base, and their goals, in the picture.

    Attributes:
        width: Width of pictures [pixels].
        height: Height of pictures [pixels].
        offsets: Position of each world on the grid [m], shape ``(worlds, 3)``; known after the first picture.

    Args:
        parts: Parts of one world, as `tightloop.view.parts.parts` reads them.
        width: Width of pictures [pixels], 16 to 8192.
        height: Height of pictures [pixels], 16 to 8192.
        kind: ``"visual"`` for visual meshes, ``"collision"`` for collision shapes.
        threads: Largest number of threads per picture; all cores if left out.

    Raises:
        ArgumentError: A size is out of range, or ``kind`` does not exist.
    """

    def __init__(
        self,
        parts: Iterable[Part],
        width: int = 640,
        height: int = 480,
        *,
        kind: Literal["visual", "collision"] = "visual",
        threads: int | None = None,
    ) -> None:
        if kind not in ("visual", "collision"):
            raise ArgumentError(f"picture: kind is {kind!r}; give 'visual' or 'collision'")
        self.width, self.height = _checked_size(width, height)
        self._renderer = _core.Renderer(self.width, self.height, threads)
        every = list(parts)
        bodies = 1 + max((part.body for part in every), default=-1)
        self._subject = parts.subject if isinstance(parts, Parts) else whole(bodies)
        self._lights = parts.lights if isinstance(parts, Parts) else lights.Lights()
        # as sites, tendons are no part of what touches
        has_tendons = isinstance(parts, Parts) and kind == "visual" and len(parts.tendons) > 0
        self._tendons = DrawnTendons(parts.tendons) if isinstance(parts, Parts) and has_tendons else None
        own = [part for part in every if part.kind == kind]
        # a floor is drawn as infinite; a slope is drawn as its mesh
        self._floors = [part for part in own if floor.is_floor(part)]
        self._parts = [part for part in own if not floor.is_floor(part)]
        self._ground = ground.extent(self._parts)
        self._framing = Framing(self._parts, self._subject)
        numbers: dict[int, int] = {}
        for part in self._parts:
            if id(part.mesh) not in numbers:
                numbers[id(part.mesh)] = self._add(part.mesh, flat=part.shape == "hfield")
        self._meshes = np.array([numbers[id(part.mesh)] for part in self._parts], np.uint32)
        self._bodies = np.array([part.body for part in self._parts], np.intp)
        self._poses = np.array([part.pose for part in self._parts], float).reshape(-1, 7)
        self._cameras: dict[tuple[Any, ...], tuple[Camera, Array]] = {}
        self._markers: dict[tuple[float, tuple[int, ...]], int] = {}
        self._stands: dict[tuple[Any, ...], tuple[NDArray[np.float64], NDArray[np.float64], float]] = {}
        self.offsets: NDArray[np.float32] = np.zeros((0, 3), np.float32)

    def anew(self, width: int, height: int) -> Picture:
        """Return a `Picture` of another size that shares the meshes, and whose first picture sets the camera again.

        Args:
            width: Width of pictures [pixels], 16 to 8192.
            height: Height of pictures [pixels], 16 to 8192.

        Raises:
            ArgumentError: A size is out of range.
        """
        other = copy.copy(self)
        other.width, other.height = _checked_size(width, height)
        other._renderer = self._renderer.resized(other.width, other.height)
        other._cameras, other._stands = {}, {}
        other.offsets = np.zeros((0, 3), np.float32)
        return other

    def render(
        self,
        shown: Any,
        *,
        worlds: int | Sequence[int] | None = None,
        camera: str | Camera | None = None,
        world: int = 0,
        contacts: bool | None = None,
        ghost: ArrayLike | None = None,
        goals: Mapping[str, tuple[ArrayLike, float, Sequence[int]]] | None = None,
    ) -> NDArray[np.uint8]:
        """Render a picture.

        Args:
            shown: A frame with ``body_q``. With ``status``, faulted worlds are red. With ``contact_count``,
                ``contact_pos`` and ``contact_force``, contacts are drawn. With ``act``, muscles are coloured.
            worlds: How many worlds are drawn on a grid, the first ones; or a list of them. All if left out. With a
                height field wider than 4 m they are drawn in place, on one ground.
            camera: A preset, ``"three-quarter"``, ``"front"``, ``"side"``, ``"top"`` or ``"follow"``, which follows
                ``world``; or a `Camera`. If left out, it follows a single world whose robot floats, and else is
                ``"three-quarter"``.
            world: World of the ghost, and of the camera ``"follow"``.
            contacts: Whether to draw contacts; if left out, those of up to four worlds.
            ghost: Target poses of the bodies of ``world``, shape ``(bodies, 7)``, drawn translucent.
            goals: Translucent balls by name: centres [m], shape ``(worlds, 3)`` or ``(worlds, n, 3)``, in the axes of
                each world, radius [m], and colour as red, green, blue.

        Returns:
            Shape ``(height, width, 3)``: red, green, blue.

        Raises:
            ArgumentError: A world or camera does not exist; the message names it.
            UnknownField: The frame carries no ``body_q``.
        """
        check_camera("picture", camera)
        contacts = check_contacts("picture", contacts)
        world = checks.integer("picture: world", world, least=0, error=ArgumentError)
        if not hasattr(shown, "body_q") and not hasattr(shown, "fields"):
            raise ArgumentError(f"picture: frame is {shown!r:.60}; give a frame with body_q, or a copy of one")
        body_q = np.asarray(shown.body_q, float)
        chosen = self._chosen(worlds, len(body_q))
        if world not in chosen:
            if world != 0 or camera == "follow" or ghost is not None:
                raise ArgumentError(f"picture: world is {world!r}; there are drawn: {_listed(chosen)}")
            world = int(chosen[0])
        if camera is None:
            camera = "follow" if self._subject.floats and len(chosen) == 1 else "three-quarter"
        box, offsets, height = self._stand(chosen, body_q)
        self.offsets = offsets.astype(np.float32)
        place = int(np.argmax(chosen == world))
        meshes, poses = self._instances(body_q[chosen], offsets)
        faulted = np.asarray(_field(shown, "status", np.zeros(len(body_q), int)))[chosen] & FAULTED
        tints = np.where(faulted[:, None, None] > 0, _RED, _PLAIN).astype(np.uint8)
        tints = np.repeat(tints, len(self._parts), axis=1).reshape(-1, 4)
        if self._ground is not None:
            # all worlds have one ground, which is drawn once and in its own colour
            still = self._bodies < 0
            tints[: len(still)][still] = _PLAIN
            kept = np.tile(~still, len(chosen))
            kept[: len(still)] = True
            meshes, poses, tints = meshes[kept], poses[kept], tints[kept]
        layers: list[tuple[Any, ...]] = [(meshes, poses, tints, np.ones(len(meshes), np.float32))]
        if self._tendons is not None:
            act = _field(shown, "act")
            red = np.where(faulted[:, None] > 0, _RED, _PLAIN)
            own = None if act is None else np.asarray(act)[chosen]
            layers.append(self._tendons.layer(body_q[chosen], own, offsets, red, add=self._add))
        if ghost is not None:
            layers.append(self._ghost(np.asarray(ghost, float), offsets[place]))
        aims = [np.zeros((0, 3))]
        for name, goal in (goals or {}).items():
            layer, centres = self._goal(name, goal, chosen, offsets)
            layers.append(layer)
            aims += [centres[place] + goal[1] * axis for axis in (*np.eye(3), *-np.eye(3))]
        view, around = self._view(camera, box, body_q, chosen, place, aims=np.concatenate(aims))
        shows = len(chosen) <= WORLDS_MAX if contacts is None else contacts
        lines = self._contacts(shown, chosen, view) if shows else _no_lines()
        meshes, poses, tints, opacities = (np.concatenate(column) for column in zip(*layers, strict=True))
        lamps = self._lamps(view, body_q[chosen[place]], offsets[place], None if len(chosen) == 1 else box.mean(axis=0))
        return self._renderer.render(
            (view.position, view.target, view.up),
            view.fov,
            around,
            (height, floor.spacing(around[3])),
            meshes,
            poses,
            tints,
            opacities,
            *lines,
            **({"lamps": lamps} if len(lamps) else {}),
        )

    def _lamps(self, view: Camera, body_q: Array, offset: Array, middle: Array | None) -> NDArray[np.float64]:
        """Return the lights of models in a world; from far off where its middle is given, since there are others."""
        if not len(self._lights):
            return lights.rows([])
        lamps = self._lights.lamps(body_q)
        if middle is not None:
            lamps = [lamp.far(middle) for lamp in lamps]
        lamps = [lamp if lamp.position is None else replace(lamp, position=lamp.position + offset) for lamp in lamps]
        return lights.rows([*lamps, *self._lights.headlight(np.subtract(view.target, view.position))])

    def _add(self, mesh: Mesh, *, flat: bool = False) -> int:
        return self._renderer.add(
            np.ascontiguousarray(mesh.vertices, np.float32),
            np.ascontiguousarray(mesh.faces, np.uint32),
            np.ascontiguousarray(mesh.colors, np.uint8),
            flat,
        )

    def _chosen(self, worlds: int | Sequence[int] | None, there: int) -> NDArray[np.intp]:
        if worlds is None:
            return np.arange(there)
        if isinstance(worlds, int | np.integer):
            return np.arange(min(checks.integer("picture: worlds", int(worlds), least=1, error=ArgumentError), there))
        chosen = np.asarray(worlds)
        if chosen.ndim != 1 or not len(chosen) or not np.issubdtype(chosen.dtype, np.integer):
            raise ArgumentError(f"picture: worlds is {worlds!r}; give how many, or a list of which ones")
        wrong = chosen[(chosen < 0) | (chosen >= there)]
        if len(wrong):
            raise ArgumentError(
                f"picture: there is no world {int(wrong[0])} for worlds to show; there are {there}, from 0 on"
            )
        return chosen.astype(np.intp)

    def _stand(self, chosen: NDArray[np.intp], body_q: Array) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
        """Return box and positions of the worlds and the height of the floor, as in the first picture."""
        key = (*chosen.tolist(),)
        if key not in self._stands:
            first = next((world for world in chosen if np.isfinite(body_q[world]).all()), None)
            # do not keep a box of worlds that are not finite
            box = grid.extent(() if first is None else self._parts, body_q[0 if first is None else first])
            offsets = grid.offsets(len(chosen), box, in_place=self._ground is not None).astype(float)
            height = floor.height(self._floors, box, self._ground)
            if first is None:
                return box, offsets, height
            self._stands[key] = box, offsets, height
        return self._stands[key]

    def _instances(self, body_q: Array, offsets: Array) -> tuple[NDArray[np.uint32], Array]:
        """Return meshes and poses of all parts of some worlds."""
        still = np.broadcast_to(np.array([0, 0, 0, 0, 0, 0, 1.0]), (len(body_q), 1, 7))
        # index -1 is the world, appended after the last body
        poses = compose(np.concatenate([body_q, still], axis=1)[:, self._bodies], self._poses)
        poses[..., :3] += offsets[:, None]
        return np.tile(self._meshes, len(body_q)), poses.reshape(-1, 7)

    def _ghost(self, body_q: Array, offset: Array) -> tuple[Any, ...]:
        moving = np.flatnonzero(self._bodies >= 0)
        poses = compose(body_q[self._bodies[moving]], self._poses[moving])
        poses[:, :3] += offset
        count = len(moving)
        opacities = np.full(count, _GHOST_OPACITY, np.float32)
        return self._meshes[moving], poses, np.tile(np.array(_GHOST, np.uint8), (count, 1)), opacities

    def _goal(
        self, name: str, goal: tuple[ArrayLike, float, Sequence[int]], chosen: NDArray[np.intp], offsets: Array
    ) -> tuple[tuple[Any, ...], Array]:
        """Return the balls of a goal, and their centres, shape ``(worlds, n, 3)``."""
        middles, radius, color = goal
        middles = np.asarray(middles, float)
        if middles.ndim not in (2, 3) or middles.shape[-1] != 3:
            raise ArgumentError(f"picture: goal {name!r} has shape {middles.shape}; give (worlds, 3) or (worlds, n, 3)")
        middles = middles.reshape(len(middles), -1, 3)[chosen] + offsets[:, None]
        key = (float(radius), tuple(color))
        if key not in self._markers:
            self._markers[key] = self._add(goal_marker(key[0], (*key[1], 255)))
        poses = np.zeros((middles.size // 3, 7))
        poses[:, :3], poses[:, 6] = middles.reshape(-1, 3), 1.0
        count = len(poses)
        tints = np.zeros((count, 4), np.uint8)
        opacities = np.full(count, 0.45, np.float32)
        return (np.full(count, self._markers[key], np.uint32), poses, tints, opacities), middles

    def _contacts(self, shown: Any, chosen: NDArray[np.intp], view: Camera) -> tuple[Array, Array, Array]:
        if any(_field(shown, name) is None for name in CONTACT_FIELDS if name != "contact_normal"):
            return _no_lines()
        link = self._framing.link
        marks = contact_marks(shown, chosen.tolist(), self.offsets, scale=_FORCE_SCALE, longest=link)
        count = len(marks.points)
        ends = np.concatenate([np.hstack([marks.points, marks.points + marks.arrows]), np.tile(marks.points, 2)])
        colors = np.repeat(np.array([_FORCE, _POINT], np.uint8), count, axis=0)
        away = np.linalg.norm(np.subtract(view.position, view.target))
        pixels = link * 0.5 * self.height / (np.tan(0.5 * view.fov) * max(away, 1e-9))
        own = np.clip(pixels * np.array([_FORCE_PART, _POINT_PART]), _WIDTH_MIN, _WIDTH_MAX)
        return np.ascontiguousarray(ends), colors, np.repeat(own.astype(np.float32), count)

    def _view(
        self, given: str | Camera, box: Array, body_q: Array, chosen: NDArray[np.intp], place: int, *, aims: Array
    ) -> tuple[Camera, tuple[float, float, float, float]]:
        """Return the camera, and centre and radius of the scene."""
        places = self.offsets.astype(float)
        whole = np.stack([box[0] + places.min(axis=0), box[1] + places.max(axis=0)])
        if given == "follow":
            # bodies may be far from their start
            centre = self._framing.middle(body_q[chosen[place]])
            whole = box + places[place] + (0.0 if centre is None else centre - box.mean(axis=0))
        view = (
            given if isinstance(given, Camera) else self._preset(given, box, body_q[chosen], chosen, place, aims=aims)
        )
        middle = whole.mean(axis=0)
        reach = 0.8 * float(np.linalg.norm(whole[1] - whole[0]))
        if self._ground is not None:
            # worlds are anywhere on it, and what is around them has shadows too
            middle = np.array(view.target)
            reach = max(reach, _GROUND_PART * float(np.linalg.norm(np.subtract(view.position, view.target))))
        return view, (float(middle[0]), float(middle[1]), float(middle[2]), max(reach, 1e-3))

    def _preset(
        self, name: str, box: Array, body_q: Array, chosen: NDArray[np.intp], place: int, *, aims: Array
    ) -> Camera:
        """Return the camera of a preset for the chosen worlds, of which ``place`` is followed and has these goals."""
        aspect, places = self.width / self.height, self.offsets.astype(float)
        follows = name == "follow"
        if follows:
            body_q, places = body_q[[place]], places[[place]]
        key = (name, place if follows else -1, *chosen.tolist())
        centre = self._framing.middle(body_q[0])
        if key not in self._cameras:
            points = self._framing.points(body_q, places, robot=follows)
            if not len(points):
                # do not keep a camera of worlds that are not finite
                return cameras.camera(name, box + places.mean(axis=0), aspect=aspect, fov=_FOV)
            first = np.zeros(3) if centre is None else centre
            view = cameras.camera(name, points, aspect=aspect, fov=_FOV, ground=self._ground is not None)
            self._cameras[key] = view, first
        view, first = self._cameras[key]
        if follows and centre is not None:
            view = cameras.shifted(view, centre - first)
        if follows or not self._subject.floats:
            points = self._framing.points(body_q, places, robot=True)
            if not self._subject.floats:
                points = np.concatenate([points, aims[np.isfinite(aims).all(axis=-1)]])
            view = cameras.kept(view, points, aspect=aspect)
        return view


def _checked_size(width: int, height: int) -> tuple[int, int]:
    sizes = (("width", width), ("height", height))
    width, height = (checks.integer(f"picture: {name}", size, least=16, error=ArgumentError) for name, size in sizes)
    return width, height


def _field(shown: Any, name: str, default: Any = None) -> Any:
    try:
        return getattr(shown, name)
    except AttributeError:  # UnknownField is one
        return default


def _no_lines() -> tuple[Array, Array, Array]:
    return np.zeros((0, 6)), np.zeros((0, 4), np.uint8), np.zeros(0, np.float32)


def _listed(chosen: NDArray[np.intp]) -> str:
    few = ", ".join(str(int(world)) for world in chosen[:8])
    return f"{few}, …" if len(chosen) > 8 else few
