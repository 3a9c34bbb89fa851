"""Loops of machine code: how many lie around each block.

A branch back to a block that every way to it passes closes a loop (Aho, Sethi, Ullman 1986, section 10.4). Code that
the compiler puts aside and that jumps back closes none.
"""

from __future__ import annotations

from collections.abc import Sequence

Ways = Sequence[Sequence[int]]
"""Successors of each block. The first block is where the code begins."""


def reachable(ways: Ways) -> set[int]:
    """Blocks that a way from the first leads to."""
    found, waiting = {0}, [0]
    while waiting:
        new = set(ways[waiting.pop()]) - found
        found |= new
        waiting += new
    return found


def predecessors(ways: Ways) -> list[list[int]]:
    """Reachable blocks from which a way leads to each block."""
    found: list[list[int]] = [[] for _ in ways]
    for block in sorted(reachable(ways)):
        for one in ways[block]:
            found[one].append(block)
    return found


def dominators(ways: Ways) -> list[int]:
    """For each block, the blocks that every way to it passes, as bits; itself among them."""
    before = predecessors(ways)
    everything = (1 << len(ways)) - 1
    found = [1] + [everything] * (len(ways) - 1)
    changed = True
    while changed:
        changed = False
        for block in range(1, len(ways)):
            common = everything
            for one in before[block]:
                common &= found[one]
            changed |= found[block] != common | 1 << block
            found[block] = common | 1 << block
    return found


def depths(ways: Ways) -> list[int]:
    """Loops around each block."""
    passed, before = dominators(ways), predecessors(ways)
    bodies: dict[int, set[int]] = {}
    for head, sources in enumerate(before):
        for block in sources:
            if passed[block] >> head & 1:
                bodies.setdefault(head, {head}).add(block)
    for head, body in bodies.items():
        waiting = [block for block in body if block != head]
        while waiting:
            new = set(before[waiting.pop()]) - body
            body.update(new)
            waiting += new
    return [sum(block in body for body in bodies.values()) for block in range(len(ways))]
