"""The commands of a step, as the table of arrays in the simulator has them."""

from __future__ import annotations

from typing import NamedTuple

from tightloop import _core


class CommandRow(NamedTuple):
    """A command.

    Attributes:
        name: Its name.
        axis: What its columns are of, such as ``"dofs"``.
        parts: Columns of each entry of that axis.
        unit: Unit; ``"–"`` for none.
        doc: What it is.
        is_switch: Whether it takes 0 and 1 alone.
        is_written: Whether `Sim.write` sets it, too.
        is_param: Whether it is a parameter, which acts where the launch names it.
    """

    name: str
    axis: str
    parts: int
    unit: str
    doc: str
    is_switch: bool
    is_written: bool
    is_param: bool


#: Every command by name, in the order of the table.
COMMANDS: dict[str, CommandRow] = {row[0]: CommandRow(*row[:-1], *row[-1]) for row in _core.command_rows()}
