"""What a visit of each stretch of a kernel costs on a card: instructions, cycles of a warp alone, bytes of code."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from . import bytecode, sass, timing, toolchain
from .constants import CARDS, CODE_RATE
from .emulate import LANES
from .sass import Instruction
from .toolchain import Compiled
from .tree import Kernel

Array = npt.NDArray[Any]


@dataclass(frozen=True)
class Costs:
    """Costs by stretch, `(stretches,)` each."""

    compiled: Compiled
    instructions: Array
    near: Array
    """[cycles] where loads hit level 1."""
    l2: Array
    """[cycles] where loads hit level 2."""
    far: Array
    """[cycles] where loads come from device memory."""
    fetch: Array
    """[cycles] that a visit takes longer where its code comes from level 2."""
    local: Array
    """[bytes] of a warp's spilled values, written and read."""
    unclear: float
    """Share of instructions whose line lies in another stretch than their block."""


def costs(kernel: Kernel, arch: str, cache: Path) -> Costs:
    """The costs of a kernel that is compiled for an architecture."""
    compiled = toolchain.compiled(kernel, arch, cache)
    stretches = bytecode.program(kernel).stretches
    everything = sass.blocks(toolchain.disassembled(Path(compiled.cubin), cache), stretches)
    found = [block for block in everything if not block.is_aside]
    card = CARDS[arch]
    count = len(stretches.lines)
    by_stretch = np.array([block.stretch for block in found])

    def total(values: list[int]) -> Array:
        return np.bincount(by_stretch, weights=values, minlength=count)

    sizes = [len(block.instructions) for block in found]
    if 2 * sum(sizes) * sass.BYTES < compiled.code:
        known = f"{sum(sizes) * sass.BYTES} of {compiled.code} bytes"
        raise SystemExit(f"{kernel.file}: the ways through its machine code for {arch} are known for {known} only")
    # checks of CUDA's shuffles are no part of what Vulkan's drivers make
    compiled = replace(compiled, code=sum(sizes) * sass.BYTES)
    near, l2, far = (
        total(timing.cycles(found, card, latency))
        for latency in (card.l1_latency, card.l2_latency, card.memory_latency)
    )
    local = [sum(local_bytes(one) for one in block.instructions) for block in found]
    fetch = np.maximum(total(sizes) * sass.BYTES / CODE_RATE - near, 0)
    agreeing = sum(block.agreeing for block in found)
    return Costs(compiled, total(sizes), near, l2, far, fetch, total(local), 1 - agreeing / sum(sizes))


def local_bytes(instruction: Instruction) -> int:
    """Bytes of local memory that an instruction moves for a warp."""
    if instruction.operation not in ("LDL", "STL"):
        return 0
    width = 4 if ".128" in instruction.modifiers else 2 if ".64" in instruction.modifiers else 1
    return 4 * width * LANES
