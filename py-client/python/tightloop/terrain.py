"""Terrain to walk on: elevations of one large field, and where robots start.

>>> ground = tightloop.terrain.mixed(seed=0)
>>> shape = ground.add_to(scene, mu=0.8)
>>> ground.starts[level, kind]  # x, y, z of a tile's middle [m]

A field is made of square tiles. Each has a level middle where a robot starts. Every value is a function of the
arguments, ``seed`` included.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tightloop.checks import arguments as checks
from tightloop.checks.attributes import suggestion
from tightloop.checks.signatures import checked_calls
from tightloop.errors import SceneError
from tightloop.scene.height_fields import SAMPLES_MAX
from tightloop.scene.shapes import Shape, Surface

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from tightloop.scene.scene import Scene

Array = NDArray[np.float64]

#: Kinds of tiles, in the order of the columns of `mixed`.
KINDS = ("flat", "rough", "slopes", "stairs", "steps", "stones")


@dataclass(frozen=True)
class Terrain:
    """Elevations and starts, made by `flat`, `rough`, `slopes`, `stairs`, `steps`, `stones` or `mixed`.

    Attributes:
        elevation: Elevations, shape ``(rows, columns)``, rows along x [m].
        cell: Distance of neighbouring elevations [m].
        starts: Middle of each tile on the ground, shape ``(levels, kinds, 3)`` [m], from the middle of the field. A
            terrain of one kind has shape ``(1, 1, 3)``.
        kinds: Kind of each column of tiles.
        tile: Side of a tile [m].
    """

    elevation: Array
    cell: float
    starts: Array
    kinds: tuple[str, ...]
    tile: float = field(default=0.0)

    @property
    def size(self) -> tuple[float, float]:
        """Lengths along x and y [m]."""
        rows, columns = self.elevation.shape
        return (columns - 1) * self.cell, (rows - 1) * self.cell

    @property
    def levels(self) -> int:
        """Number of levels of difficulty."""
        return self.starts.shape[0]

    def height(self, x: float | Array, y: float | Array) -> Array:
        """Return the elevation at places [m], on the triangles that contacts use; outside, at the nearest edge.

        Args:
            x: Places along x from the middle of the field [m].
            y: Places along y, of the same shape [m].
        """
        (width, length), (rows, columns) = self.size, self.elevation.shape
        u = np.clip((np.asarray(x, float) + 0.5 * width) / self.cell, 0.0, columns - 1)
        v = np.clip((np.asarray(y, float) + 0.5 * length) / self.cell, 0.0, rows - 1)
        i = np.minimum(u.astype(int), columns - 2)
        j = np.minimum(v.astype(int), rows - 2)
        u, v, z = u - i, v - j, self.elevation
        low, high = z[j, i], z[j + 1, i + 1]
        third = np.where(v > u, z[j + 1, i], z[j, i + 1])
        # from the corner on the diagonal that is nearest along both axes
        return low + np.where(v > u, (third - low) * v + (high - third) * u, (third - low) * u + (high - third) * v)

    def add_to(
        self,
        scene: Scene,
        *,
        base: float = 1.0,
        pos: checks.Vector = (0.0, 0.0, 0.0),
        name: str | None = "terrain",
        **surface: Unpack[Surface],
    ) -> Shape:
        """Add it to a scene; the arguments are those of `Scene.add_hfield`.

        ``starts`` count from ``pos``.
        """
        return scene.add_hfield(self.elevation, size=self.size, base=base, pos=pos, name=name, **surface)


@checked_calls
def flat(*, tile: float = 8.0, cell: float = 0.1) -> Terrain:
    """Return level ground."""
    return _single("flat", 0.0, tile, cell, 0)


@checked_calls
def rough(*, amplitude: float = 0.05, tile: float = 8.0, cell: float = 0.1, seed: int = 0) -> Terrain:
    """Return random ground: uniform elevations of at most ``amplitude`` [m], smoothed over two cells."""
    return _single("rough", amplitude, tile, cell, seed)


@checked_calls
def slopes(*, slope: float = 0.3, tile: float = 8.0, cell: float = 0.1, seed: int = 0) -> Terrain:
    """Return a pyramid, or a pit, with sides of this ``slope`` [–] and a level middle."""
    return _single("slopes", slope, tile, cell, seed)


@checked_calls
def stairs(*, step: float = 0.1, tile: float = 8.0, cell: float = 0.1, seed: int = 0) -> Terrain:
    """Return square stairs up or down to a level middle, with steps of this height [m] that are 0.3 m deep."""
    return _single("stairs", step, tile, cell, seed)


@checked_calls
def steps(*, height: float = 0.1, tile: float = 8.0, cell: float = 0.1, seed: int = 0) -> Terrain:
    """Return discrete obstacles: blocks and pits of at most this ``height`` [m] on level ground."""
    return _single("steps", height, tile, cell, seed)


@checked_calls
def stones(*, gap: float = 0.2, tile: float = 8.0, cell: float = 0.1, seed: int = 0) -> Terrain:
    """Return stepping stones of about 0.5 m with gaps of this width [m] between them, 0.5 m deep."""
    return _single("stones", gap, tile, cell, seed)


@checked_calls
def mixed(
    kinds: Sequence[str] = KINDS,
    *,
    levels: int = 8,
    tile: float = 8.0,
    cell: float = 0.1,
    border: float = 4.0,
    seed: int = 0,
    hardest: dict[str, float] | None = None,
) -> Terrain:
    """Return a grid of tiles: one column per kind along x, one row per level of difficulty along y.

    Args:
        kinds: Kinds of tiles, of `KINDS`; one may occur several times, with other draws. Stairs and slopes lead up from
            the middle of their tiles in the first column of their kind, down in the second, and so on.
        levels: Levels of difficulty; level 0 is nearly flat, the last one as hard as ``hardest`` says.
        tile: Side of a tile [m].
        cell: Distance of neighbouring elevations [m].
        border: Width of the level ground around all tiles [m].
        seed: Seed of all draws.
        hardest: The size of the last level by kind; left out: ``rough`` 0.1, ``slopes`` 0.5, ``stairs`` 0.2, ``steps``
            0.2, ``stones`` 0.4. See the functions of these names.

    Raises:
        SceneError: An argument is out of range; the message names it.
    """
    levels = checks.integer("terrain: levels", levels)
    width = checks.number("terrain: border", border, least=0.0)
    if isinstance(kinds, str) or not isinstance(kinds, Sequence) or not kinds:
        raise SceneError(f"terrain: kinds is {kinds!r:.80}; give a sequence of at least one of {', '.join(KINDS)}")
    for kind in kinds:
        checks.choice("terrain: kind", kind, KINDS)
    seed = checks.integer("terrain: seed", seed, least=-(2**63))
    samples, step = _cells(tile, cell)
    sizes = _HARDEST | _sizes(hardest)
    around = round(width / step)
    rows, columns = levels * samples + 2 * around + 1, len(kinds) * samples + 2 * around + 1
    _check_count(rows, columns)
    elevation = np.zeros((rows, columns))
    starts = np.zeros((levels, len(kinds), 3))
    for level in range(levels):
        share = (level + 1) / levels
        for column, kind in enumerate(kinds):
            sign = 1.0 if kinds[:column].count(kind) % 2 else -1.0
            own = _tile(kind, share * sizes[kind], samples, step, (seed, level, column), sign=sign)
            first = around + level * samples, around + column * samples
            elevation[first[0] : first[0] + samples + 1, first[1] : first[1] + samples + 1] = own
            middle = first[0] + samples // 2, first[1] + samples // 2
            starts[level, column] = (
                (middle[1] - 0.5 * (columns - 1)) * step,
                (middle[0] - 0.5 * (rows - 1)) * step,
                own[samples // 2, samples // 2],
            )
    return Terrain(elevation, step, starts, tuple(kinds), samples * step)


#: Sizes of the hardest level.
_HARDEST = {"flat": 0.0, "rough": 0.1, "slopes": 0.5, "stairs": 0.2, "steps": 0.2, "stones": 0.4}
#: Half the side of the level middle of a tile [m].
_MIDDLE = 0.8
#: Width of the level rim of a tile, so that neighbours meet [m].
_RIM = 0.3
#: Depth of the gaps between stepping stones [m].
_GAP_DEPTH = 0.5
#: Kinds that are hills or pits.
_SIGNED = ("slopes", "stairs")
#: Depth of a stair [m].
_TREAD = 0.3


def _cells(tile: float, cell: float) -> tuple[int, float]:
    """Cells along a tile, an even number, and their size."""
    tile = checks.number("terrain: tile", tile, least=4.0 * _MIDDLE)
    cell = checks.number("terrain: cell", cell, above=0.0)
    cells = 2 * max(8, round(0.5 * tile / cell)) if tile / cell < SAMPLES_MAX else SAMPLES_MAX
    _check_count(cells, cells)
    return cells, tile / cells


def _check_count(rows: int, columns: int) -> None:
    """Refuse more elevations than a height field may have, before there is memory for them."""
    if rows * columns > SAMPLES_MAX:
        raise SceneError(
            f"terrain: {rows} by {columns} elevations are more than {SAMPLES_MAX}; give a larger cell, a smaller tile "
            "or fewer levels"
        )


def _sizes(hardest: Mapping[str, float] | None) -> dict[str, float]:
    """Return the sizes of the last level that are given, checked."""
    if hardest is None:
        return {}
    if not isinstance(hardest, Mapping):
        raise SceneError(f"terrain: hardest is {hardest!r:.80}; give a dict of sizes by kind")
    for kind in hardest:
        if kind not in KINDS:
            raise SceneError(f"terrain: hardest has {kind!r}, and there is no such kind; {suggestion(kind, KINDS)}")
    return {kind: checks.number(f"terrain: hardest {kind}", size, least=0.0) for kind, size in hardest.items()}


def _single(kind: str, size: float, tile: float, cell: float, seed: int) -> Terrain:
    size = checks.number(f"terrain: size of {kind}", size, least=0.0)
    seed = checks.integer("terrain: seed", seed, least=-(2**63))
    samples, step = _cells(tile, cell)
    own = _tile(kind, size, samples, step, (seed, 0, 0))
    start = np.array([[[0.0, 0.0, own[samples // 2, samples // 2]]]])
    return Terrain(own, step, start, (kind,), samples * step)


def _tile(
    kind: str, size: float, samples: int, cell: float, key: tuple[int, int, int], *, sign: float | None = None
) -> Array:
    """Elevations of a tile, shape ``(samples + 1, samples + 1)``; its rim is at 0.

    ``sign`` is 1 for hills and -1 for pits; None draws it.
    """
    draws = np.random.default_rng([zlib.crc32(kind.encode()), *(part % 2**32 for part in key)])
    from_middle = np.abs(np.arange(samples + 1) - samples // 2) * cell
    ring = np.maximum(from_middle[:, None], from_middle[None, :])
    if kind in _SIGNED:
        size *= draws.choice([-1.0, 1.0]) if sign is None else sign
    found = _MAKERS[kind](size, ring, cell, draws)
    half = 0.5 * samples * cell
    found[ring > half - _RIM] = 0.0
    return found


def _flat(_size: float, ring: Array, _cell: float, _draws: np.random.Generator) -> Array:
    return np.zeros_like(ring)


def _rough(size: float, ring: Array, _cell: float, draws: np.random.Generator) -> Array:
    noise = np.pad(draws.uniform(-1.0, 1.0, ring.shape), 1, mode="edge")
    smooth = 0.25 * (noise[:-2, 1:-1] + noise[2:, 1:-1] + noise[1:-1, :-2] + noise[1:-1, 2:])
    return np.where(ring <= _MIDDLE, 0.0, size * (0.5 * smooth + 0.5 * noise[1:-1, 1:-1]))


def _slopes(size: float, ring: Array, _cell: float, _draws: np.random.Generator) -> Array:
    half = ring.max() - _RIM
    return size * (half - np.clip(ring, _MIDDLE, half))


def _stairs(size: float, ring: Array, _cell: float, _draws: np.random.Generator) -> Array:
    half = ring.max() - _RIM
    # whole treads from the rim inwards; half a cell keeps rounding off their edges
    count = np.floor((half - np.clip(ring, _MIDDLE, half) + 1e-9) / _TREAD)
    return size * count


def _steps(size: float, ring: Array, cell: float, draws: np.random.Generator) -> Array:
    found = np.zeros_like(ring)
    count, samples = round(ring.max() ** 2), ring.shape[0]
    for _ in range(count):
        sides = np.maximum(1, np.round(draws.uniform(0.4, 1.5, 2) / cell)).astype(int)
        row, column = (int(draws.integers(0, max(1, samples - side))) for side in sides)
        found[row : row + sides[0], column : column + sides[1]] = draws.choice([-1.0, -0.5, 0.5, 1.0]) * size
    return np.where(ring <= _MIDDLE, 0.0, found)


def _stones(size: float, ring: Array, cell: float, draws: np.random.Generator) -> Array:
    samples, side = ring.shape[0], 0.5
    pitch = side + size
    shift = draws.uniform(0.0, pitch, 2)
    along = [np.arange(samples) * cell + shift[axis] for axis in range(2)]
    on = (along[0] % pitch < side)[:, None] & (along[1] % pitch < side)[None, :]
    tops = draws.uniform(-0.1, 0.1, [int(part.max() // pitch) + 1 for part in along]) * size
    place = np.ix_(*((part // pitch).astype(int) for part in along))
    return np.where(ring <= _MIDDLE, 0.0, np.where(on, tops[place], -_GAP_DEPTH))


_MAKERS: dict[str, Callable[[float, Array, float, np.random.Generator], Array]] = {
    "flat": _flat,
    "rough": _rough,
    "slopes": _slopes,
    "stairs": _stairs,
    "steps": _steps,
    "stones": _stones,
}
