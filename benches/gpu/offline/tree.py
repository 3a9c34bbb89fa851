"""The parts of a recorded kernel: expressions with their types, statements with their lines."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

Type = Literal["f32", "u32", "bool", "vec4"]
Component = Literal["x", "y", "z", "w"]


@dataclass(frozen=True, slots=True)
class Number:
    """A literal, as it is written without its suffix."""

    text: str
    type: Type


@dataclass(frozen=True, slots=True)
class Name:
    """A value, a variable, an index of a loop or an input."""

    name: str
    type: Type


@dataclass(frozen=True, slots=True)
class Unary:
    """`-a` or `!a`."""

    operator: str
    a: Expression
    type: Type


@dataclass(frozen=True, slots=True)
class Binary:
    """`a operator b`."""

    operator: str
    a: Expression
    b: Expression
    type: Type


@dataclass(frozen=True, slots=True)
class Call:
    """A function of WGSL, by its name there."""

    function: str
    arguments: tuple[Expression, ...]
    type: Type


@dataclass(frozen=True, slots=True)
class Part:
    """A component of a vector that was read whole."""

    vector: Expression
    component: Component
    type: Type = "f32"


@dataclass(frozen=True, slots=True)
class Cell:
    """Memory of a world: vector number `place` of a buffer, or a component of it, known or found at run time."""

    buffer: str
    place: Expression
    component: Component | Expression | None
    type: Type


@dataclass(frozen=True, slots=True)
class Entry:
    """A value of a table that all worlds share."""

    buffer: str
    index: Expression
    type: Type


Expression = Number | Name | Unary | Binary | Call | Part | Cell | Entry


@dataclass(frozen=True, slots=True)
class Define:
    """`let name = value;`, or `var` if it changes."""

    line: int
    name: str
    value: Expression
    changes: bool


@dataclass(frozen=True, slots=True)
class Assign:
    """`name = value;`"""

    line: int
    name: str
    value: Expression


@dataclass(frozen=True, slots=True)
class Store:
    """`cell = value;` A whole vector is stored from four values."""

    line: int
    cell: Cell
    values: tuple[Expression, ...]


@dataclass(frozen=True, slots=True)
class If:
    """`if (mask) { body }`"""

    line: int
    mask: Expression
    body: tuple[Statement, ...]
    end: int


@dataclass(frozen=True, slots=True)
class For:
    """`for (var name = first; name < end; name += step) { body }`"""

    line: int
    name: str
    first: Expression
    limit: Expression
    step: int
    body: tuple[Statement, ...]
    end: int


@dataclass(frozen=True, slots=True)
class Barrier:
    """`subgroupBarrier();`: what lanes wrote before it, those of their world read after it."""

    line: int


@dataclass(frozen=True, slots=True)
class Break:
    """`break;`"""

    line: int


@dataclass(frozen=True, slots=True)
class Return:
    """`return;`"""

    line: int


Statement = Define | Assign | Store | If | For | Barrier | Break | Return


@dataclass(frozen=True, slots=True)
class Binding:
    """A buffer of a kernel."""

    number: int
    name: str
    element: str
    is_written: bool


@dataclass(slots=True)
class Kernel:
    """A recorded kernel."""

    file: str
    workgroup: int
    bindings: list[Binding]
    body: tuple[Statement, ...] = ()
    lanes: int = 1
    """Threads that share a world."""
    has_place: bool = False
    """Whether it asks for a thread's place in its subgroup."""
    types: dict[str, Type] = field(default_factory=dict)
