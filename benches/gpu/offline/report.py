"""Prints predictions."""

from __future__ import annotations

from .constants import CARDS
from .predict import Part, Prediction


def heading(prediction: Prediction) -> list[str]:
    """What a run does, in a few lines."""
    p, ends, micro = prediction, prediction.ends, 1e6
    steps = (p.seconds - ends.seconds) * micro
    around = (
        f"kernels around them {ends.kernels * micro:.0f}, copy {ends.copy * micro:.0f}, host {ends.host * micro:.0f}"
    )
    work = f"{p.instructions:.0f} instructions at {p.lanes:.2f} of the lanes"
    return [
        f"{p.scene.name}, {p.worlds} worlds, {p.arch} ({CARDS[p.arch].name}): {p.rate / 1e6:.1f} M steps/s",
        f"  frame {p.seconds * micro:.0f} µs: steps and evaluation {steps:.0f}, {around}",
        f"  {ends.staged * micro:.0f} µs more where the device cannot write its readers' pages",
        f"  {p.dispatches} dispatches a frame in {p.tiles} tile(s); per step of 32 worlds {work}",
        f"  a warp alone: {p.mean:.0f} cycles a step, {p.worst:.0f} with the slowest of each dispatch",
        f"  a step of a world loads {p.loaded:.0f} bytes and stores {p.stored:.0f}; a frame touches {p.footprint:.0f}",
    ]


def row(name: str, part: Part, whole: float) -> str:
    """A kernel's line."""
    compiled = part.costs.compiled
    return (
        f"  {name:14}{part.dispatches:6}{compiled.registers:6}{compiled.spilled:8}{compiled.code / 1024:9.1f}"
        f"{compiled.seconds:8.2f}{100 * part.seconds / whole:8.1f}  {part.bound}"
    )


def table(prediction: Prediction) -> str:
    """A run and its kernels; a kernel's share is of all kernels' time."""
    head = f"  {'kernel':14}{'times':>6}{'regs':>6}{'spill B':>8}{'code kB':>9}{'ptxas s':>8}{'share %':>8}  bound"
    whole = sum(part.seconds for part in prediction.parts.values())
    rows = [row(prediction.scene.file(k).removesuffix(".wgsl"), part, whole) for k, part in prediction.parts.items()]
    return "\n".join([*heading(prediction), head, *rows])
