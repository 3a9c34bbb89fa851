"""A recorded kernel as a program for `lockstep.cpp`, which runs it for warps of 32 lanes.

A stretch is what lies between two branches: all its lines run equally often, and visits of it are counted. A program is
rows of five numbers: an operation, where its result goes, and three operands. Operands are slots of 32 lanes each. A
vector of WGSL takes four slots.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from .slots import Slots, last_uses
from .tree import (
    Assign,
    Barrier,
    Binary,
    Break,
    Call,
    Cell,
    Define,
    Entry,
    Expression,
    For,
    If,
    Kernel,
    Name,
    Number,
    Part,
    Return,
    Statement,
    Store,
    Unary,
)

INTERPRETER = Path(__file__).with_name("lockstep.cpp")
COMPONENTS = {"x": 0, "y": 1, "z": 2, "w": 3}
BUFFERS = {"fields": 0, "scratch": 1, "numbers": 0, "indices": 1}
SIGNS = {"+": "ADD", "-": "SUB", "*": "MUL", "/": "DIV", "%": "MOD", "<": "LT", ">": "GT", "<=": "LE", ">=": "GE"}
SIGNS |= {"==": "EQ", "!=": "NE", "&&": "AND", "||": "OR"}
SHUFFLES = {"subgroupShuffleXor": "SHUFFLE_XOR", "subgroupShuffle": "SHUFFLE"}
SUFFIXES = {"f32": "_F", "u32": "_U", "bool": ""}
THREAD, WORLDS = 0, 1
"""Slots of the thread's number and of the number of worlds."""


def operations() -> dict[str, int]:
    """Numbers of the operations, in the order of the list in `lockstep.cpp`."""
    found = re.search(r"enum Operation[^{]*\{(.*?)\}", INTERPRETER.read_text(), re.DOTALL)
    assert found, "lockstep.cpp lists its operations"
    return {name: k for k, name in enumerate(re.findall(r"\w+", found[1]))}


@dataclass(slots=True)
class Stretches:
    """Stretches of a kernel."""

    lines: list[int] = field(default_factory=list)
    """First line of each."""
    depths: list[int] = field(default_factory=list)
    """Loops around each."""
    of_line: dict[int, int] = field(default_factory=dict)
    """The stretch of a statement's line; the head of a loop belongs to its body."""


@dataclass(slots=True)
class Program:
    """What `lockstep.cpp` runs."""

    code: npt.NDArray[np.int32]
    constants: npt.NDArray[np.uint32]
    """Slot and bits of each, `(n, 2)`."""
    slots: int
    stretches: Stretches


class Writer:
    """Writes the program of a kernel."""

    def __init__(self) -> None:
        self.numbers = operations()
        self.code: list[list[int]] = []
        self.slots = Slots(first=2)
        self.constants: dict[int, int] = {}
        self.names: dict[str, int] = {"thread_x": THREAD, "worlds": WORLDS}
        self.stretches = Stretches()
        self.is_open = False
        self.depth = 0

    def put(self, operation: str, to: int = 0, a: int = 0, b: int = 0, c: int = 0) -> int:
        """Writes an operation; returns its place."""
        self.code.append([self.numbers[operation], to, a, b, c])
        return len(self.code) - 1

    def enter(self, line: int) -> None:
        """Counts a visit of a stretch that begins at a line."""
        self.put("ENTER", len(self.stretches.lines))
        self.stretches.lines.append(line)
        self.stretches.depths.append(self.depth)
        self.is_open = True

    def block(self, body: tuple[Statement, ...]) -> None:
        """Writes statements; a name ends with the last that uses it."""
        ends = last_uses(body)
        for k, part in enumerate(body):
            if not self.is_open:
                self.enter(part.line)
            self.stretches.of_line[part.line] = len(self.stretches.lines) - 1
            self.statement(part)
            for name, width in ends.get(k, ()):
                self.slots.free(self.names.pop(name), width)

    def statement(self, part: Statement) -> None:
        """Writes a statement."""
        match part:
            case Define(name=name, value=value):
                width = 4 if value.type == "vec4" else 1
                self.names[name] = self.slots.take(width)
                self.write(value, self.names[name])
            case Assign(name=name, value=value):
                with self.slots.temporaries():
                    self.put("SET", self.names[name], self.read(value))
            case Store(cell=cell, values=values):
                self.store(cell, values)
            case If(mask=mask, body=body):
                self.condition(mask, body)
            case For():
                self.loop(part)
            case Barrier():
                # lanes run in lockstep
                pass
            case _:
                raise AssertionError(f"{part} stands alone")

    def condition(self, mask: Expression, body: tuple[Statement, ...]) -> None:
        """`if`, with what leaves the kernel or its loop."""
        with self.slots.temporaries():
            found = self.read(mask)
        self.is_open = False
        match body:
            case (Return(),):
                self.put("RETURN_IF", 0, found)
            case (Break(),):
                self.put("BREAK_IF", 0, found)
            case _:
                at = self.put("IF", 0, found)
                self.block(body)
                self.put("END_IF")
                self.code[at][1] = len(self.code) - 1
                self.is_open = False

    def loop(self, part: For) -> None:
        """`for`: it runs while a lane does."""
        i = self.names[part.name] = self.slots.take(1)
        self.write(part.first, i)
        at = self.put("LOOP")
        with self.slots.temporaries():
            self.put("TEST", 0, i, self.read(part.limit))
        self.depth += 1
        self.enter(part.line)
        self.stretches.of_line[part.line] = len(self.stretches.lines) - 1
        self.block(part.body)
        self.depth -= 1
        self.put("ADD_U", i, i, self.constant(part.step))
        self.put("NEXT", at + 1)
        # where a test or a break goes that finds no lane left
        self.code[at][1] = self.put("END_LOOP")
        self.slots.free(self.names.pop(part.name), 1)
        self.is_open = False

    def store(self, cell: Cell, values: tuple[Expression, ...]) -> None:
        """A store of one value, or of four."""
        with self.slots.temporaries():
            place, buffer = self.read(cell.place), BUFFERS[cell.buffer]
            if cell.component is not None:
                self.put("STORE", buffer, place, self.component(cell), self.read(values[0]))
                return
            row = self.slots.temporary(4)
            for k, value in enumerate(values):
                self.write(value, row + k)
            self.put("STORE_4", buffer, place, row)

    def component(self, cell: Cell) -> int:
        """The slot of a component."""
        if isinstance(cell.component, str):
            return self.constant(COMPONENTS[cell.component])
        assert cell.component is not None
        return self.read(cell.component)

    def constant(self, bits: int) -> int:
        """The slot that has these bits in all lanes."""
        if bits not in self.constants:
            self.constants[bits] = self.slots.fresh(1)
        return self.constants[bits]

    def read(self, x: Expression) -> int:
        """The slot of a value: its own, or a temporary one."""
        match x:
            case Name(name):
                return self.names[name]
            case Number(text, kind):
                return self.constant(bits_of(text, kind))
            case Part(Name(name), component):
                return self.names[name] + COMPONENTS[component]
        slot = self.slots.temporary(4 if x.type == "vec4" else 1)
        self.write(x, slot)
        return slot

    def write(self, x: Expression, to: int) -> None:
        """Writes a value to a slot."""
        with self.slots.temporaries():
            match x:
                case Name() | Number() | Part(Name()):
                    self.put("MOVE", to, self.read(x))
                case Part(Cell() as cell, component):
                    self.write(Cell(cell.buffer, cell.place, component, "f32"), to)
                case Unary(operator, a):
                    self.put("NOT" if operator == "!" else "NEG", to, self.read(a))
                case Binary(operator, a, b):
                    self.put(SIGNS[operator] + SUFFIXES[a.type], to, self.read(a), self.read(b))
                case Cell(buffer, place, None):
                    self.put("LOAD_4", to, BUFFERS[buffer], self.read(place))
                case Cell(buffer, place):
                    self.put("LOAD", to, BUFFERS[buffer], self.read(place), self.component(x))
                case Entry(buffer, index):
                    self.put("ENTRY", to, BUFFERS[buffer], self.read(index))
                case Call("subgroupAdd", (a,), kind):
                    self.put("SUM" + SUFFIXES[kind], to, self.read(a))
                case Call("min" | "max" as function, (a, b), kind):
                    self.put(function.upper() + SUFFIXES[kind], to, self.read(a), self.read(b))
                case Call("f32" | "u32" as function, (a,)):
                    same = function == a.type
                    self.put("MOVE" if same else "TO_" + function.upper(), to, self.read(a))
                case Call(function, arguments):
                    name = SHUFFLES.get(function, function.upper())
                    self.put(name, to, *(self.read(a) for a in arguments))
                case _:
                    raise AssertionError(x)


def bits_of(text: str, kind: str) -> int:
    """The bits of a literal."""
    if kind == "bool":
        return 0xFFFFFFFF if text == "true" else 0
    return int(text) if kind == "u32" else int(np.float32(text).view(np.uint32))


def program(kernel: Kernel) -> Program:
    """The program of a kernel."""
    writer = Writer()
    writer.block(kernel.body)
    writer.put("END")
    constants = [[slot, bits] for bits, slot in writer.constants.items()]
    return Program(
        np.array(writer.code, np.int32),
        np.array(constants, np.uint32).reshape(-1, 2),
        writer.slots.count,
        writer.stretches,
    )
