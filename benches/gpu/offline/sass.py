"""Machine code of a kernel in basic blocks, and the stretch of source lines that each block runs as often as."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, field

from .bytecode import Stretches

BYTES = 16
"""Bytes of an instruction, Volta and later."""
LEAVES = ("BRA", "EXIT", "RET", "CALL", "BRX", "JMP", "BREAK")
"""Operations after which the next instruction runs less often, or never."""
LINE = re.compile(r'\s*//## File "([^"]*)", line (\d+)(?: inlined at "([^"]*)", line (\d+))?')
LABEL = re.compile(r"\s*(\.L_x_\d+):")
FIRST = re.compile(r"\s*/\*([0-9a-f]{4,})\*/\s+(@!?U?P\w+ )?(\w+)((?:\.\w+)*)([^;]*);\s+/\* 0x([0-9a-f]+) \*/")
SECOND = re.compile(r"\s*/\* 0x([0-9a-f]+) \*/")


@dataclass(slots=True)
class Instruction:
    """An instruction."""

    address: int
    line: int
    """Line of the kernel's source, 0 if it comes from none."""
    operation: str
    modifiers: str
    operands: str
    is_predicated: bool
    control: int = 0
    """Its scheduling bits: stall 4, yield 1, barrier of the result 3, of the operands 3, barriers to wait for 6."""

    @property
    def stall(self) -> int:
        """Cycles until the next may be issued."""
        return self.control & 15

    @property
    def result_barrier(self) -> int:
        """The scoreboard that is released when the result is there; 7: none."""
        return self.control >> 5 & 7

    @property
    def operand_barrier(self) -> int:
        """The scoreboard that is released when operands were read; 7: none."""
        return self.control >> 8 & 7

    @property
    def waits(self) -> int:
        """Scoreboards that must be free, a bit each."""
        return self.control >> 11 & 63


@dataclass(slots=True)
class Block:
    """Instructions that run equally often."""

    instructions: list[Instruction] = field(default_factory=list)
    depth: int = 0
    """Loops around it in the machine code."""
    stretch: int = 0
    """Stretch of lines that it runs as often as."""
    agreeing: int = 0
    """Instructions whose line lies in that stretch, or in none."""

    @property
    def continues(self) -> bool:
        """Whether the next block may follow by itself."""
        last = self.instructions[-1]
        return last.operation not in ("EXIT", "RET", "BRA", "JMP", "BRX") or last.is_predicated


def blocks(sass: str, stretches: Stretches) -> list[Block]:
    """Blocks of a kernel that nvdisasm printed with `-gi -hex`, in the order of addresses."""
    found, labels = split(sass)
    loops = [(labels[target], at) for target, at in branches(found) if labels.get(target, at) < at]
    for block in found:
        at = block.instructions[0].address
        block.depth = sum(first <= at <= last for first, last in loops)
    assign(found, stretches)
    return found


def split(sass: str) -> tuple[list[Block], dict[str, int]]:
    """Blocks, and the addresses of labels."""
    found: list[Block] = []
    labels: dict[str, int] = {}
    waiting: list[str] = []
    line, starts, open_instruction = 0, True, None
    for text in sass.splitlines():
        if match := LINE.match(text):
            places = ((match[1], match[2]), (match[3], match[4]))
            line = next((int(number) for file, number in places if file and file.endswith(".wgsl")), 0)
        elif match := LABEL.match(text):
            waiting.append(match[1])
            starts = True
        elif match := FIRST.match(text):
            address = int(match[1], 16)
            if match[3] == "NOP":
                continue
            labels.update(dict.fromkeys(waiting, address))
            waiting.clear()
            instruction = Instruction(address, line, match[3], match[4], match[5].strip(), bool(match[2]))
            if starts:
                found.append(Block())
            found[-1].instructions.append(instruction)
            starts = instruction.operation in LEAVES
            open_instruction = instruction
        elif open_instruction is not None and (match := SECOND.match(text)):
            open_instruction.control = int(match[1], 16) >> 41 & 0x1FFFFF
            open_instruction = None
    return found, labels


def branches(found: list[Block]) -> list[tuple[str, int]]:
    """Label and address of each branch."""
    instructions = (block.instructions[-1] for block in found)
    targets = ((re.search(r"\.L_x_\d+", last.operands), last) for last in instructions if last.operation == "BRA")
    return [(match[0], last.address) for match, last in targets if match]


def assign(found: list[Block], stretches: Stretches) -> None:
    """Gives each block the stretch that most of its instructions come from, among those in as many loops.

    The compiler moves instructions out of loops, so a line alone does not tell how often one runs.
    """
    last: dict[int, int] = {}
    for block in found:
        of_lines = [stretches.of_line.get(instruction.line) for instruction in block.instructions]
        votes = Counter(stretch for stretch in of_lines if stretch is not None)
        fitting = {stretch: n for stretch, n in votes.items() if stretches.depths[stretch] == block.depth}
        if fitting:
            block.stretch = max(fitting, key=lambda stretch: (fitting[stretch], -stretch))
        elif block.depth in last:
            block.stretch = last[block.depth]
        elif votes:
            block.stretch = votes.most_common(1)[0][0]
        last[block.depth] = block.stretch
        block.agreeing = sum(stretch in (None, block.stretch) for stretch in of_lines)
