"""Machine code of a kernel in basic blocks, and the stretch of source lines that each block runs as often as."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, field

from . import loops
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
    is_aside: bool = False
    """Nothing leads here, or only a check of CUDA's shuffles, which Vulkan's have not. It counts nothing."""

    @property
    def last(self) -> Instruction:
        """Its last instruction."""
        return self.instructions[-1]

    @property
    def continues(self) -> bool:
        """Whether the next block may follow by itself."""
        may_stay = self.last.is_predicated or re.match(r"U?P\d|!U?P\d", self.last.operands) or self.diverges
        return self.last.operation not in ("EXIT", "RET", "BRA", "JMP", "BRX") or bool(may_stay)

    @property
    def diverges(self) -> bool:
        """Whether it ends in a branch that is taken where not all lanes are there."""
        return self.last.operation == "BRA" and ".DIV" in self.last.modifiers

    @property
    def target(self) -> str | None:
        """The label that its last instruction may jump to."""
        match = re.search(r"\.L_x_\d+", self.last.operands) if self.last.operation == "BRA" else None
        return match[0] if match else None


def blocks(sass: str, stretches: Stretches) -> list[Block]:
    """Blocks of a kernel that nvdisasm printed with `-gi -hex`, in the order of addresses."""
    found, labels = split(sass)
    at = {block.instructions[0].address: k for k, block in enumerate(found)}
    ways: list[list[int]] = []
    for k, block in enumerate(found):
        following = [k + 1] if block.continues and k + 1 < len(found) else []
        if block.target is not None:
            to = at[labels[block.target]]
            following.append(to)
            if block.diverges:
                put_aside(found, to)
        ways.append(following)
    used = loops.reachable(ways)
    for k, (block, depth) in enumerate(zip(found, loops.depths(ways), strict=True)):
        block.depth = depth
        block.is_aside |= k not in used
    assign([block for block in found if not block.is_aside], stretches)
    return found


def put_aside(found: list[Block], first: int) -> None:
    """Marks blocks from `first` on, up to the one that jumps back."""
    for block in found[first:]:
        block.is_aside = True
        if not block.continues:
            break


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
