"""What a frame takes besides its steps: commands in, checks, outputs out, and the host that waits.

The kernels around the steps are modelled by hand from their loops. Their sources are fingerprinted without numbers: a
kernel that has changed is refused until it is described here.
"""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass

from . import constants as c
from .constants import Card
from .dump import Scene

DESCRIBED: dict[str, set[str]] = {
    "rows": {"d409fc48"},
    "begin": {"49c8b5d7"},
    "check faults": {"0dabda1d", "8763f8f4"},
    "show": {"447bc884"},
}
"""Fingerprints of the sources that `ends` describes."""


@dataclass(frozen=True, slots=True)
class Ends:
    """Times of a frame's ends [s]."""

    kernels: float
    """Kernels around the steps, of all tiles."""
    copy: float
    """The frame over the bus to its reader's pages."""
    host: float
    """Commands, submission, start, wake-up, counters."""
    staged: float
    """What a frame takes longer whose pages the device cannot write."""
    dispatches: int
    """Kernels around the steps."""

    @property
    def seconds(self) -> float:
        """Of all of them, where frames are imported."""
        return self.kernels + self.copy + self.host


def fingerprint(text: str) -> str:
    """Eight characters that change with a kernel's source, but not with numbers in it or repeated lines."""
    lines = dict.fromkeys(re.sub(r"\d+", "#", line.strip()) for line in text.splitlines())
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()[:8]


def check(scene: Scene) -> None:
    """Refuses kernels that are not described.

    Raises:
        SystemExit: A kernel around the steps has changed.
    """
    for label, text in scene.around.items():
        found = fingerprint(text)
        if found not in DESCRIBED.get(label, set()):
            raise SystemExit(
                f"the kernel `{label}` has changed ({found}); describe it in benches/gpu/offline/frame_ends.py"
            )


def words(scene: Scene) -> int:
    """Values of 4 bytes that a world has in a frame: the counters are the last of them."""
    places = [int(x) for x in re.findall(r"frame\[(\d+)u \+ world\]", scene.around["show"])]
    return max(places) // scene.worlds + 1


def ends(scene: Scene, card: Card, worlds: int, tiles: int) -> Ends:
    """Times of the ends of a frame."""
    check(scene)
    wait = card.l2_latency / card.clock
    columns, shown, moving = scene.facts["dofs"], words(scene), scene.facts["moving"]
    # a copy over the bus, then a thread per word: the head, the word, its store, which moves a sector
    sent = c.BUS_LATENCY + worlds * columns * 4 / card.bus_rate
    rows = max(3 * wait, worlds * columns * (4 + 32) / card.l2_rate)
    # copies vector by vector, each after the one before: they lie in one buffer
    begin = wait * (moving // 4 + 3)
    # bounds; state by vectors, then counters
    faults = wait * (moving // 4 + 3)
    # a thread per word: two entries of the table, the word out of a vector that neighbours share, its store
    show = max(4 * wait, worlds * shown * (8 + 4) / card.l2_rate)
    counters = c.COUNTERS / card.clock
    around = 4
    copies = worlds * shown * 4
    return Ends(
        sent + rows + tiles * (begin + faults + counters) + show + tiles * (around + 1) * c.DISPATCH,
        c.DISPATCH + copies / card.bus_rate,
        c.HOST_SUBMIT + c.SUBMISSION + c.WAKE + worlds * (c.HOST_WORLD + columns * 4 / c.HOST_COPY_RATE),
        copies / c.HOST_COPY_RATE,
        tiles * around,
    )
