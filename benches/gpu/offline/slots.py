"""Slots of a program's values, taken again once nothing needs the value, so that few are in use."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields, is_dataclass

from .tree import Define, Name, Statement


class Slots:
    """Hands out slots, alone or four in a row."""

    def __init__(self, first: int) -> None:
        self.count = first
        self.spare: dict[int, list[int]] = {1: [], 4: []}
        self.open: list[list[tuple[int, int]]] = []

    def take(self, width: int) -> int:
        """The first of some slots in a row."""
        return self.spare[width].pop() if self.spare[width] else self.fresh(width)

    def fresh(self, width: int) -> int:
        """Slots in a row that nothing had before."""
        self.count += width
        return self.count - width

    def free(self, slot: int, width: int) -> None:
        """Gives slots back."""
        self.spare[width].append(slot)

    def temporary(self, width: int) -> int:
        """Slots that are given back where the innermost `temporaries` ends."""
        slot = self.take(width)
        self.open[-1].append((slot, width))
        return slot

    @contextmanager
    def temporaries(self) -> Iterator[None]:
        """Gives temporary slots back at its end."""
        self.open.append([])
        yield
        for slot, width in self.open.pop():
            self.free(slot, width)


def names(part: object) -> Iterator[str]:
    """Names that a statement or an expression mentions."""
    if isinstance(part, Name):
        yield part.name
    elif isinstance(part, tuple):
        for x in part:
            yield from names(x)
    elif is_dataclass(part):
        for one in fields(part):
            value = getattr(part, one.name)
            if one.name == "name" and isinstance(value, str):
                yield value
            elif not isinstance(value, str | int):
                yield from names(value)


def last_uses(body: tuple[Statement, ...]) -> dict[int, list[tuple[str, int]]]:
    """Names that the block defines, with their slots, by the statement of the block that mentions them last.

    `world` is left out: reads of memory need it without a mention.
    """
    widths: dict[str, int] = {}
    last: dict[str, int] = {}
    for k, part in enumerate(body):
        for name in names(part):
            last[name] = k
        if isinstance(part, Define):
            widths[part.name] = 4 if part.value.type == "vec4" else 1
    ends: dict[int, list[tuple[str, int]]] = {}
    for name, width in widths.items():
        if name != "world":
            ends.setdefault(last[name], []).append((name, width))
    return ends
