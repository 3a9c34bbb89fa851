"""Whether the translations are right: a frame from a dumped state must end in the state that was dumped after it.

| translation | reference |
|---|---|
| lockstep, all worlds | the CPU backend, or the adapter that the dump was played on |
| CUDA C on the processor, the first worlds | the same |

The translations and the CPU backend round every operation as written, so that scenes agree to the bit. Drivers may
round products and divisions in their own ways. Where lanes share a world, sums have another order. Then rounding
differs, and iterations may stop one earlier or later.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from . import cuda_on_cpu, dump, emulate
from .dump import Scene

MEDIAN = 1e-5
"""Of the worlds' largest differences, each over the value's size or 1: 100 roundings of single precision."""
MEDIAN_OF_CONTACTS = 5e-4
"""The same where contacts are solved: so much an acceleration depends on where the tolerance stops the solver
(sim-core/physics/src/step/solver/mod.rs)."""
POSITIONS = 1e-4
"""[m, rad] of any world. An iteration more or less moves a velocity by some 1e-3 m/s, for a frame of some 0.02 s."""
CUDA_WORLDS = 64
"""Worlds that the CUDA C is played for."""


@dataclass(frozen=True, slots=True)
class Agreement:
    """How far a frame is from what it should be."""

    name: str
    frame: int
    largest: float
    """Difference of a value over its size, or over 1."""
    median: float
    """The same, of each world the largest, in the median of worlds."""
    positions: float
    """The largest of positions [m, rad]."""
    same: float
    """Share of values that are equal to the bit."""
    limit: float
    """What the median must stay below."""

    @property
    def holds(self) -> bool:
        """Whether it is near enough."""
        return self.median < self.limit and self.positions < POSITIONS

    def __str__(self) -> str:
        verdict = "agrees" if self.holds else "DIFFERS"
        return (
            f"  {self.name:9} frame {self.frame:4}: {verdict}; largest {self.largest:.1e}, median of worlds "
            f"{self.median:.1e}, positions {self.positions:.1e}, equal bits {100 * self.same:.1f} %"
        )


def compared(scene: Scene, name: str, frame: int, fields: emulate.Array) -> Agreement:
    """What a frame left in `fields`, beside what it should leave."""
    moving = scene.facts["moving"]
    found = dump.rows(fields, moving)
    wanted = scene.state("after", frame)[: len(found), :moving]
    difference = np.abs(found - wanted)
    # neither may be NaN where the other is not
    difference[np.isnan(found) != np.isnan(wanted)] = np.inf
    difference = np.nan_to_num(difference, nan=0.0, posinf=np.inf)
    scaled = difference / np.maximum(np.nan_to_num(np.abs(wanted)), 1.0)
    return Agreement(
        name,
        frame,
        float(scaled.max()),
        float(np.median(scaled.max(axis=1))),
        float(difference[:, scene.positions].max()),
        float((found.view(np.uint32) == wanted.view(np.uint32)).mean()),
        MEDIAN_OF_CONTACTS if scene.facts["scratch"] else MEDIAN,
    )


def lockstep(scene: Scene, frame: int, emulator: emulate.Emulator) -> Agreement:
    """Checks a frame in lockstep."""
    worlds = emulate.worlds_of(scene, frame)
    for k in scene.step:
        emulator.run(k, worlds)
    return compared(scene, "lockstep", frame, worlds.fields)


def cuda(scene: Scene, frame: int, cache: Path) -> Agreement:
    """Checks a frame of the CUDA C."""
    worlds = emulate.worlds_of(scene, frame, CUDA_WORLDS)
    kernels = {k: scene.kernels[k] for k in sorted(set(scene.step))}
    tables = scene.table("numbers"), scene.table("indices")
    cuda_on_cpu.run(kernels, scene.step, (worlds.fields, worlds.scratch, *tables), cache)
    return compared(scene, "CUDA C", frame, worlds.fields)


def check(scene: Scene, cache: Path) -> list[Agreement]:
    """Checks every sampled frame in lockstep, and the last one as CUDA C."""
    emulator = emulate.emulator(scene, cache)
    found = [lockstep(scene, frame, emulator) for frame in scene.sampled]
    return [*found, cuda(scene, scene.sampled[-1], cache)]
