"""Commands and states as the client takes them: arrays that need no conversion, or runs of columns of such."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from numpy.typing import ArrayLike

from tightloop.arrays.inputs import as_array, real_numbers, switches
from tightloop.arrays.named_columns import named_columns
from tightloop.errors import CommandRefused
from tightloop.sim.command_rows import COMMANDS

#: An array ``(worlds, dofs)`` for the whole scene, ``(dofs,)`` for identical commands, or a dict of such by robot,
#: joint or pattern.
Command = ArrayLike | Mapping[str, ArrayLike | Mapping[str, ArrayLike]]


def ready_arrays(sim: Any, given: dict[str, Any]) -> dict[str, Any]:
    """Convert the values of a dict that the client cannot take as they are, and return the dict.

    Args:
        sim: The simulation.
        given: Values by name; None is left out.

    Raises:
        CommandRefused: A shape or dtype is wrong, or no model of the scene has the name.
    """
    for name in sim._client.unready(given):
        given[name] = _converted(sim, name, given[name])
    return given


def step_arguments(sim: Any, given: dict[str, Any]) -> tuple[dict[str, Any], tuple[int, int] | None]:
    """Return the arguments of a step of a `Sim` as its client takes them; ``given`` has the commands by name."""
    on_device = None
    if sim._card is not None:
        sim._client.land()  # the daemon may still read what the last step left there
        on_device = sim._card.take(given)
    return ready_arrays(sim, given), on_device


def _converted(sim: Any, name: str, value: Any) -> Any:
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
    return as_array(name, None, value, sim.worlds, columns, robots=sizes)
