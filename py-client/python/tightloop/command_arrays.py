"""Commands that are named in the daemon's description: those of MuJoCo models, and forces on bodies."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tightloop.errors import CommandRefused
from tightloop.inputs import as_array, real_numbers, switches
from tightloop.params import Params

#: An array ``(worlds, dofs)`` for the whole scene, ``(dofs,)`` for identical commands, or a dict of such by robot,
#: joint or pattern.
Command = ArrayLike | Mapping[str, ArrayLike | Mapping[str, ArrayLike]]


def ready_arrays(
    info: Mapping[str, Any], params: Callable[[], Params], group: str, given: Mapping[str, Command | None]
) -> dict[str, NDArray[np.float64]]:
    """Return what is given as arrays, shape ``(worlds, columns)``, by name.

    Args:
        info: The daemon's description.
        params: Returns the parameters of the simulation.
        group: Entry of ``info`` that lists names and numbers of columns, ``"commands"`` or ``"writes"``.
        given: Values by name; None is left out.

    Raises:
        CommandRefused: A shape or dtype is wrong, or no model of the scene has the name.
    """
    found = {}
    for name, value in given.items():
        if value is None:
            continue
        if name == "body_f":  # varies only where the run says so, which `Params` knows
            found[name] = params().ready(name, value)
            continue
        columns = {known["name"]: known["columns"] for known in info[group]}
        if name not in columns:
            raise CommandRefused(f"{name}: no model of this scene has any; leave it out")
        flat = _flat(name, value, len(info["mocap_names"]))
        found[name] = as_array(name, None, flat, info["worlds"], columns[name])
    return found


def step_arrays(
    sim: Any, mocap_pos: Any, mocap_quat: Any, eq_active: Any, body_f: Any
) -> dict[str, NDArray[np.float64]]:
    """Return those commands of a step of a `Sim` that `ready_arrays` prepares."""
    if mocap_pos is mocap_quat is eq_active is body_f is None:  # most steps, which must not take longer
        return {}
    given = {"mocap_pos": mocap_pos, "mocap_quat": mocap_quat, "eq_active": eq_active, "body_f": body_f}
    return ready_arrays(sim.info, lambda: sim.params, "commands", given)


def _flat(name: str, value: Command, mocaps: int) -> Command:
    """Return an array of mocap bodies with the entries of all of them in a row, and switches as numbers."""
    if name == "eq_active":
        return switches(name, value)
    width = {"mocap_pos": 3, "mocap_quat": 4}.get(name)
    if width is None:
        return value
    given = real_numbers(name, value)
    if given.shape[-2:] != (mocaps, width):
        return given
    return given.reshape(*given.shape[:-2], -1)
