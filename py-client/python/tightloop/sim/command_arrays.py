"""Commands and states as the client takes them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from numpy.typing import ArrayLike

from tightloop import _core
from tightloop.arrays.inputs import as_array, real_numbers, switches
from tightloop.arrays.named_columns import Runs, named_columns
from tightloop.errors import CommandRefused
from tightloop.sim.command_rows import COMMANDS

#: An array ``(worlds, dofs)`` for the whole scene, ``(dofs,)`` for identical commands, or a dict of such by robot,
#: joint or pattern.
Command = ArrayLike | Mapping[str, ArrayLike | Mapping[str, ArrayLike]]


def called(sim: Any, call: Callable[..., Any], given: dict[str, Any], *rest: Any) -> Any:
    """Call a method of the client of a simulation with values by name, and convert those that it does not take.

    Args:
        sim: The simulation.
        call: The method.
        given: Values by name; None is left out.
        *rest: Its other arguments.

    Returns:
        What the method returns.

    Raises:
        CommandRefused: A shape or dtype is wrong, or no model of the scene has the name. Other errors are the method's.
    """
    try:
        return call(given, *rest)
    except _core.NotReady as not_ready:
        names = not_ready.args[0]
    return call(given | {name: _converted(sim, name, given[name]) for name in names}, *rest)


def commanded(sim: Any, call: Callable[..., Any], given: dict[str, Any]) -> Any:
    """Leave commands of the GPU in device memory, then call `step` or `send` of the client as `called` does."""
    on_device = None
    if sim._card is not None:
        sim._client.land()  # the daemon may still read what the last step left there
        on_device = sim._card.take(given)
    return called(sim, call, given, on_device)


def _converted(sim: Any, name: str, value: Any) -> _core.Columns:
    return _core.Columns(columns_of(sim, name, value))


def columns_of(sim: Any, name: str, value: Any) -> Runs:
    """Return a command as runs of neighbouring columns: the first of them, and an array ``(worlds, columns)``.

    Raises:
        CommandRefused: A shape or dtype is wrong, or no model of the scene has the name.
    """
    row = COMMANDS.get(name)
    if row is not None and row.is_param:  # varies only where the run names it, which `Params` knows
        return sim.params.ready_columns(name, value)
    layout = sim._client.layout(name)
    if layout is None:
        raise CommandRefused(f"{name}: no model of this scene has any; leave it out")
    names, columns, parts, robots = layout
    if isinstance(value, Mapping) and robots is not None:
        mimics = [(own["name"], own["leader"], own["multiplier"], own["offset"]) for own in sim.info["followers"]]
        return named_columns(name, value, sim.worlds, names, robots, followers=mimics, parts=parts)
    if row is not None and row.is_switch:
        value = switches(name, value)
    if parts > 1:  # the entries of all bodies in a row
        value = real_numbers(name, value)
        if value.shape[-2:] == (columns // parts, parts):
            value = value.reshape(*value.shape[:-2], columns)
    sizes = [(robot, stop - start, base) for robot, start, stop, base in robots or ()]
    return [(0, as_array(name, None, value, sim.worlds, columns, robots=sizes))]
