"""How long a dispatch takes on a card, from what its warps did and what its code costs.

A dispatch takes as long as the longest of these, and the price of a dispatch that waits for the one before:

| bound | time |
|---|---|
| slowest | cycles of the slowest warp, as if it were alone on its quarter of a multiprocessor |
| warps | cycles of all warps, over those that can be resident |
| issue | instructions of all warps, over what all quarters issue |
| l1, l2, memory | bytes over bandwidth |

Assumptions, besides those of `constants.py`:

- A load of what its warp has not touched in this dispatch comes from level 2, or from device memory in the share by
  which the frame's memory exceeds level 2. Stores count as touches.
- Other loads hit level 1, in the share of the resident warps' memory that fits there. Tables always do.
- Code comes from level 2 at a warp's first visit, unless all kernels of the frame fit into the code cache together. A
  kernel that is larger than the cache fetches the share that does not fit at every visit.
- For other numbers of worlds the emulated warps are repeated, or thinned out evenly.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from . import constants as c
from .constants import Card
from .costs import Costs
from .emulate import LANES, SECTOR, Tally

Array = npt.NDArray[Any]


@dataclass(frozen=True, slots=True)
class Setting:
    """What a dispatch shares with the others of its frame."""

    card: Card
    worlds: int
    """Worlds of the dispatch: those of a tile."""
    emulated: int
    """Worlds that were emulated."""
    code: int
    """[bytes] of all kernels of the frame."""
    footprint: float
    """[bytes] of a world that the frame touches."""

    @property
    def scale(self) -> float:
        """Worlds for one that was emulated."""
        return self.worlds / self.emulated


@dataclass(frozen=True, slots=True)
class Dispatch:
    """A dispatch on a card."""

    seconds: float
    """With its price."""
    bound: str
    """What it is bound by."""
    instructions: float
    """Of all warps."""
    mean: float
    """[cycles] of a warp."""
    worst: float
    """[cycles] of the slowest."""


def resident(costs: Costs, workgroup: int, card: Card) -> int:
    """Warps that a multiprocessor holds."""
    per_warp = -(-costs.compiled.registers * LANES // c.REGISTER_UNIT) * c.REGISTER_UNIT
    groups = card.groups * -(-workgroup // LANES)
    return min(card.warps, groups, c.REGISTERS // per_warp)


def dispatch(tally: Tally, costs: Costs, workgroup: int, setting: Setting) -> Dispatch:
    """The time of a dispatch."""
    card = setting.card
    emulated = len(tally.visits)
    warps = max(round(emulated * setting.scale), 1)
    places = resident(costs, workgroup, card)
    beside = min(places, -(-warps // card.multiprocessors))
    first_loads, first_stores = tally.first.sum(axis=0)
    own = SECTOR * (first_loads + first_stores) / emulated + costs.compiled.stack * LANES
    hits = min(1.0, card.l1 / max(beside * own, 1.0))
    misses = max(0.0, 1.0 - card.l2 / max(setting.footprint * setting.worlds, 1.0))
    cycles = warp_cycles(tally, costs, setting.code, hits, misses)
    chosen = np.arange(warps) * emulated // warps
    worst = float(cycles[chosen].max())

    instructions = float(tally.visits.sum(axis=0) @ costs.instructions) * setting.scale
    local = float(tally.visits.sum(axis=0) @ costs.local)
    loads, stores = SECTOR * float(tally.load_sectors.sum()), SECTOR * float(tally.store_sectors.sum())
    again = max(loads - SECTOR * float(first_loads), 0.0) + local
    beyond_l1 = SECTOR * float(first_loads) + stores + (1 - hits) * again
    quarters = card.multiprocessors * c.QUARTERS
    bounds = {
        "slowest": worst / card.clock,
        "warps": float(cycles.mean()) * warps / (places * card.multiprocessors) / card.clock,
        "issue": instructions / (quarters * c.ISSUE_EFFICIENCY * card.clock),
        "l1": (loads + stores + local) * setting.scale / (card.l1_rate * card.multiprocessors * card.clock),
        "l2": beyond_l1 * setting.scale / card.l2_rate,
        "memory": misses * beyond_l1 * setting.scale / card.memory_rate,
    }
    bound = max(bounds, key=lambda name: bounds[name])
    seconds = bounds[bound] + c.DISPATCH
    name = bound if bounds[bound] > c.DISPATCH else "dispatch"
    return Dispatch(seconds, name, instructions, float(cycles.mean()), worst)


def warp_cycles(tally: Tally, costs: Costs, code: int, hits: float, misses: float) -> Array:
    """Cycles of each emulated warp, as if it were alone, `(warps,)`."""
    visits, cold = tally.visits.astype(float), tally.cold.astype(float)
    beyond = (1 - misses) * costs.l2 + misses * costs.far - costs.near
    cycles = visits @ costs.near + cold @ beyond + (1 - hits) * ((visits - cold) @ beyond)
    if code > c.CODE_CACHE:
        first = (visits > 0).astype(float)
        excess = max(0.0, 1 - c.CODE_CACHE / costs.compiled.code)
        cycles += first @ costs.fetch + excess * ((visits - first) @ costs.fetch)
    return cycles


def tiles(worlds: int, places: int) -> int:
    """Tiles that run one after the other, each with the worlds that a buffer can bind; `places` is values per world."""
    fit = max(c.BINDING // (4 * places), 1)
    return -(-worlds // fit)
