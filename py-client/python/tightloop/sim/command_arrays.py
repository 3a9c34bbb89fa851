"""Commands that are named in the daemon's description: those of MuJoCo models, and forces on bodies."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tightloop.arrays.inputs import as_array, real_numbers, switches
from tightloop.arrays.named_columns import Runs
from tightloop.errors import CommandRefused
from tightloop.sim.params import Params

#: An array ``(worlds, dofs)`` for the whole scene, ``(dofs,)`` for identical commands, or a dict of such by robot,
#: joint or pattern.
Command = ArrayLike | Mapping[str, ArrayLike | Mapping[str, ArrayLike]]

#: Commands of a step: those that the client converts, then those that `ready_arrays` prepares
_OWN: tuple[str, ...] = ("joint_f", "joint_target_q", "joint_target_qd", "ctrl")
_PREPARED: tuple[str, ...] = ("mocap_pos", "mocap_quat", "eq_active", "body_f")


def ready_arrays(
    info: Mapping[str, Any], params: Callable[[], Params], group: str, given: Mapping[str, Command | None]
) -> dict[str, NDArray[np.float64] | Runs]:
    """Return what is given as arrays, shape ``(worlds, columns)``, or as runs of columns of such, by name.

    Args:
        info: The daemon's description.
        params: Returns the parameters of the simulation.
        group: Entry of ``info`` that lists names and numbers of columns, ``"commands"`` or ``"writes"``.
        given: Values by name; None is left out.

    Raises:
        CommandRefused: A shape or dtype is wrong, or no model of the scene has the name.
    """
    found: dict[str, NDArray[np.float64] | Runs] = {}
    for name, value in given.items():
        if value is None:
            continue
        if name == "body_f":  # varies only where the run names it, which `Params` knows
            found[name] = params().ready_columns(name, value)
            continue
        columns = {known["name"]: known["columns"] for known in info[group]}
        if name not in columns:
            raise CommandRefused(f"{name}: no model of this scene has any; leave it out")
        flat = _flat(name, value, len(info["mocap_names"]))
        found[name] = as_array(name, None, flat, info["worlds"], columns[name])
    return found


def step_arguments(sim: Any, own: Sequence[Any], prepared: Sequence[Any]) -> tuple[Any, ...]:
    """Return the arguments of a step of a `Sim` as its client takes them.

    Args:
        sim: The simulation.
        own: ``joint_f``, ``joint_target_q``, ``joint_target_qd`` and ``ctrl``, each an array or None.
        prepared: ``mocap_pos``, ``mocap_quat``, ``eq_active`` and ``body_f``, likewise.
    """
    on_device = None
    if sim._card is not None:
        given = dict(zip(_OWN + _PREPARED, (*own, *prepared), strict=True))
        sim._client.land()  # the daemon may still read what the last step left there
        on_device = sim._card.take(given)
        own, prepared = [given[name] for name in _OWN], [given[name] for name in _PREPARED]
    mocap_pos, mocap_quat, eq_active, body_f = prepared
    if mocap_pos is mocap_quat is eq_active is body_f is None:  # most steps, which must not take longer
        return (*own, {}, on_device)
    given = dict(zip(_PREPARED, prepared, strict=True))
    return (*own, ready_arrays(sim.info, lambda: sim.params, "commands", given), on_device)


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
