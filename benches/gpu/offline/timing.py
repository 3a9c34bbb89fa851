"""How long a warp that is alone takes over blocks of machine code.

Instructions carry stall counts for what has a fixed latency, and scoreboards for the rest. Both are followed in order.
Pipes that an earlier instruction holds delay a later one. A block begins when the one before it in memory was issued,
and waits for what that one left under way.
"""

from __future__ import annotations

from collections.abc import Sequence

from . import constants as c
from .constants import Card
from .sass import Block, Instruction

FLOAT = ("FFMA", "FADD", "FMUL", "FSWZADD", "HFMA2")
SPECIAL = ("MUFU", "FRND", "F2I", "I2F", "F2F")
MEMORY = ("LDG", "STG", "LDL", "STL", "LDS", "STS", "SHFL", "LD", "ST")
CONSTANT = ("LDC", "ULDC", "LDCU", "S2R", "S2UR", "CS2R")
LOADS = ("LDG", "LD")
UNTIMED = ("BRA", "EXIT", "BSSY", "BSYNC", "WARPSYNC", "NOP", "RET", "CALL", "BREAK", "YIELD")


def pipe(instruction: Instruction, card: Card) -> tuple[str, int]:
    """The pipe that an instruction needs, and for how many cycles."""
    operation = instruction.operation
    if operation in FLOAT:
        return "float", card.float_interval
    if operation in SPECIAL:
        return "special", c.SPECIAL_INTERVAL
    if operation in MEMORY:
        return "memory", c.MEMORY_INTERVAL
    if operation in CONSTANT or operation in UNTIMED:
        return operation, 0
    return ("multiply" if operation == "IMAD" else "integer"), c.INTEGER_INTERVAL


def latency(instruction: Instruction, card: Card, load: int) -> int:
    """Cycles until a scoreboard is released that waits for the result; `load` is that of a load from worlds' memory."""
    operation = instruction.operation
    if operation in LOADS:
        # tables are read through the same instruction; they stay in level 1
        return card.l1_latency if ".CONSTANT" in instruction.modifiers else load
    if operation == "LDL":
        return card.l1_latency
    if operation == "MUFU":
        return c.SPECIAL_LATENCY
    if operation in SPECIAL:
        return c.CONVERSION_LATENCY
    if operation == "SHFL":
        return c.SHUFFLE_LATENCY
    return c.CONSTANT_LATENCY if operation in CONSTANT else c.OTHER_LATENCY


def cycles(blocks: Sequence[Block], card: Card, load: int) -> list[int]:
    """Cycles of each block, where a load takes `load` cycles."""
    found: list[int] = []
    ready = [0] * 6
    for block in blocks:
        time, free = 0, {}
        for instruction in block.instructions:
            for k in range(6):
                if instruction.waits >> k & 1:
                    time = max(time, ready[k])
            name, interval = pipe(instruction, card)
            time = max(time, free.get(name, 0))
            free[name] = time + interval
            if instruction.result_barrier < 6:
                k = instruction.result_barrier
                ready[k] = max(ready[k], time + latency(instruction, card, load))
            if instruction.operand_barrier < 6:
                k = instruction.operand_barrier
                ready[k] = max(ready[k], time + c.OPERANDS_LATENCY)
            time += max(instruction.stall, 1)
        found.append(time)
        ready = [max(at - time, 0) for at in ready] if block.continues else [0] * 6
    return found
