"""Paths of the spatial tendons of MuJoCo models, from the poses of bodies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.mujoco import saved
from tightloop.view.poses import Array, rotate
from tightloop.view.tendons import wrap

#: Arrays of an exported model that say where tendons are, and what they look like.
ARRAYS = (
    *("tendon_adr", "tendon_num", "tendon_width", "tendon_rgba", "tendon_group", "tendon_matid", "mat_rgba"),
    *("mat_texture_mean", "wrap_type", "wrap_type.names", "wrap_objid", "wrap_prm", "site_bodyid", "site_pos"),
    *("geom_bodyid", "geom_pos", "geom_quat", "geom_size", "actuator_trntype", "actuator_trntype.names"),
    *("actuator_trnid", "actuator_dyntype", "actuator_dyntype.names", "actuator_actadr", "actuator_actnum"),
    *("vis.rgba.actuator", "vis.rgba.actuatorpositive"),
)
# Groups of tendons that MuJoCo's viewer shows at first: those below.
_GROUPS_SHOWN = 3
# A tendon without a colour of its own has that of its material.
_NO_COLOR = (0.5, 0.5, 0.5, 1.0)
# A path around a shape is two straight lines, with an arc between them.
_AROUND = wrap.PIECES + 2


@dataclass
class _Spans:
    """Pieces of paths from site to site, as columns; places of bodies are those of ``body_q``."""

    tendon: list[int] = field(default_factory=list)
    bodies: list[list[int]] = field(default_factory=list)
    ends: list[Array] = field(default_factory=list)
    # of those around a shape: its body and pose, radius, whether it is a cylinder; the side site's body and place
    shape: list[tuple[int, Array, float, bool]] = field(default_factory=list)
    side: list[tuple[int, Array]] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class Segments:
    """Straight pieces of tendons in some worlds.

    Attributes:
        ends: Both ends of each piece [m], shape ``(worlds, pieces, 2, 3)``. Where a tendon touches no shape, its pieces
            on the shape have length 0.
        tendon: Which tendon each piece belongs to, shape ``(pieces,)``.
    """

    ends: NDArray[np.float64]
    tendon: NDArray[np.intp]


class Tendons:
    """The tendons of a scene that MuJoCo's viewer shows at first.

    Attributes:
        radii: Radius of each tendon [m], shape ``(tendons,)``: MuJoCo's ``width``.
        colors: Red, green, blue and opacity, 0 to 1, shape ``(tendons, 4)``.
        muscles: Columns of ``act`` of muscles that pull a tendon, and the tendon of each, shape ``(muscles, 2)``.
    """

    def __init__(self) -> None:
        self.radii = np.zeros(0)
        self.colors = np.zeros((0, 4))
        self.muscles = np.zeros((0, 2), np.intp)
        # colours of a muscle at rest and at work, as MuJoCo's viewer has them
        self._rest, self._work = np.zeros((0, 4)), np.zeros((0, 4))
        self._straight, self._bent = _Spans(), _Spans()

    def __len__(self) -> int:
        return len(self.radii)

    def add(self, found: dict[str, NDArray[Any]], bodies: Sequence[int], first_act: int) -> None:
        """Add the tendons of a model.

        Args:
            found: Its arrays, `ARRAYS`.
            bodies: Where its bodies are in ``body_q``.
            first_act: Column of its first activation in ``act``.
        """
        numbers = {}
        colors = _colors(found)
        kinds = saved.kinds(found, "wrap_type")
        for tendon, (first, count) in enumerate(zip(found["tendon_adr"], found["tendon_num"], strict=True)):
            rows = range(first, first + count)
            is_spatial = any(kinds[row] == "mjWRAP_SITE" for row in rows)
            if is_spatial and found["tendon_group"].ravel()[tendon] < _GROUPS_SHOWN and colors[tendon, 3] > 0:
                numbers[tendon] = len(self.radii) + len(numbers)
                self._add_path(found, bodies, kinds, rows, numbers[tendon])
        shown = [*numbers]
        self.radii = np.concatenate([self.radii, found["tendon_width"].ravel()[shown]])
        self.colors = np.concatenate([self.colors, colors[shown]])
        self._add_muscles(found, numbers, first_act)

    def segments(self, body_q: Array) -> Segments:
        """Return the paths for poses of bodies, shape ``(worlds, bodies, 7)``."""
        body_q = np.asarray(body_q, float)
        ends = [self._ends(body_q, self._straight)]
        tendon = [np.array(self._straight.tendon, np.intp)]
        if self._bent.tendon:
            ends.append(self._around(body_q))
            tendon.append(np.repeat(self._bent.tendon, _AROUND))
        return Segments(np.concatenate(ends, axis=1), np.concatenate(tendon))

    def shown_colors(self, act: Array | None, worlds: int) -> NDArray[np.float64]:
        """Return the colours of all tendons, those of muscles by their activation, shape ``(worlds, tendons, 4)``.

        Args:
            act: Activations, shape ``(worlds, activations)``, or None where they are not known.
            worlds: Number of worlds.
        """
        colors = np.tile(self.colors, (worlds, 1, 1))
        if act is None or not len(self.muscles):
            return colors
        columns, tendons = self.muscles.T
        strength = np.nan_to_num(np.clip(np.asarray(act, float)[:, columns], 0.0, 1.0))
        # of several muscles that pull a tendon, the one that works most
        most = np.zeros((worlds, len(self)))
        for tendon, own in zip(tendons, strength.T, strict=True):
            most[:, tendon] = np.maximum(most[:, tendon], own)
        muscles, first = np.unique(tendons, return_index=True)
        rest, work = self._rest[first], self._work[first]
        colors[:, muscles] = rest + (work - rest) * most[:, muscles, None]
        return colors

    def _add_path(
        self, found: dict[str, NDArray[Any]], bodies: Sequence[int], kinds: list[str], rows: range, tendon: int
    ) -> None:
        def site(place: int) -> tuple[int, Array]:
            return bodies[found["site_bodyid"].ravel()[place]], found["site_pos"].reshape(-1, 3)[place]

        before: tuple[int, Array] | None = None
        shape: int | None = None
        for row in rows:
            if kinds[row] == "mjWRAP_PULLEY":
                before = shape = None
            elif kinds[row] in ("mjWRAP_SPHERE", "mjWRAP_CYLINDER"):
                shape = row
            else:
                here = site(int(found["wrap_objid"].ravel()[row]))
                spans = self._straight if shape is None else self._bent
                if before is not None:
                    spans.tendon.append(tendon)
                    spans.bodies.append([before[0], here[0]])
                    spans.ends.append(np.stack([before[1], here[1]]))
                if before is not None and shape is not None:
                    geom = int(found["wrap_objid"].ravel()[shape])
                    pose = np.concatenate(
                        [found["geom_pos"].reshape(-1, 3)[geom], found["geom_quat"].reshape(-1, 4)[geom, [1, 2, 3, 0]]]
                    )
                    radius = float(found["geom_size"].reshape(-1, 3)[geom, 0])
                    body = bodies[found["geom_bodyid"].ravel()[geom]]
                    spans.shape.append((body, pose, radius, kinds[shape] == "mjWRAP_CYLINDER"))
                    beside = round(float(found["wrap_prm"].ravel()[shape]))
                    spans.side.append(site(beside) if beside >= 0 else (-1, np.zeros(3)))
                before, shape = here, None

    def _add_muscles(self, found: dict[str, NDArray[Any]], numbers: dict[int, int], first_act: int) -> None:
        ways, laws = saved.kinds(found, "actuator_trntype"), saved.kinds(found, "actuator_dyntype")
        targets = found["actuator_trnid"].reshape(-1, 2)[:, 0]
        last = found["actuator_actadr"].ravel() + found["actuator_actnum"].ravel() - 1
        muscles = [
            (first_act + int(last[k]), numbers[int(targets[k])])
            for k in range(len(ways))
            if ways[k] == "mjTRN_TENDON" and laws[k] == "mjDYN_MUSCLE" and int(targets[k]) in numbers
        ]
        added = len(muscles)
        self.muscles = np.concatenate([self.muscles, np.array(muscles, np.intp).reshape(-1, 2)])
        self._rest = np.concatenate([self._rest, np.tile(found["vis.rgba.actuator"].reshape(1, 4), (added, 1))])
        self._work = np.concatenate([self._work, np.tile(found["vis.rgba.actuatorpositive"].reshape(1, 4), (added, 1))])

    def _ends(self, body_q: Array, spans: _Spans) -> NDArray[np.float64]:
        """Both ends of pieces in the world, shape ``(worlds, pieces, 2, 3)``."""
        poses = body_q[:, np.array(spans.bodies, np.intp).reshape(-1, 2)]
        return poses[..., :3] + rotate(poses[..., 3:], np.array(spans.ends, float).reshape(1, -1, 2, 3))

    def _around(self, body_q: Array) -> NDArray[np.float64]:
        """Pieces of paths around shapes, shape ``(worlds, spans · _AROUND, 2, 3)``."""
        spans = self._bent
        ends = self._ends(body_q, spans)
        carriers = body_q[:, [body for body, *_ in spans.shape]]
        own = np.array([pose for _, pose, *_ in spans.shape])
        center = carriers[..., :3] + rotate(carriers[..., 3:], own[None, :, :3])

        def local(points: Array) -> Array:
            """Points of the world in the frames of the shapes."""
            inverse = np.array([-1.0, -1.0, -1.0, 1.0])
            return rotate(own[None, :, 3:] * inverse, rotate(carriers[..., 3:] * inverse, points - center))

        sides = body_q[:, [body for body, _ in spans.side]]
        side = sides[..., :3] + rotate(sides[..., 3:], np.array([at for _, at in spans.side])[None])
        touches, arc = wrap.bend(
            local(ends[:, :, 0]),
            local(ends[:, :, 1]),
            radius=np.array([[radius for *_, radius, _ in spans.shape]]),
            is_cylinder=np.array([[is_cylinder for *_, is_cylinder in spans.shape]]),
            side=local(side),
            has_side=np.array([[body >= 0 for body, _ in spans.side]]),
        )
        turned = rotate(carriers[:, :, None, 3:], rotate(own[None, :, None, 3:], arc))
        # without a touch, the first piece is the whole way, and the others have no length
        arc = np.where(touches[..., None, None], center[:, :, None] + turned, ends[:, :, 1:])
        path = np.concatenate([ends[:, :, :1], arc, ends[:, :, 1:]], axis=2)
        pieces = np.stack([path[:, :, :-1], path[:, :, 1:]], axis=3)
        return pieces.reshape(len(body_q), -1, 2, 3)


def _colors(found: dict[str, NDArray[Any]]) -> NDArray[np.float64]:
    """Colours of all tendons of a model, or of their materials with the mean of their textures."""
    colors = np.array(found["tendon_rgba"], float).reshape(-1, 4)
    materials = found["mat_rgba"].reshape(-1, 4)
    for tendon, material in enumerate(found["tendon_matid"].ravel()):
        if material >= 0:
            if np.array_equal(colors[tendon], _NO_COLOR):
                colors[tendon] = materials[material]
            colors[tendon, :3] *= found["mat_texture_mean"].reshape(-1, 3)[material]
    return np.clip(colors, 0.0, 1.0)
