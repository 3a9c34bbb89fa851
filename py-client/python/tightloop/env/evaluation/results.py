"""Results of a task's functions that are no numbers: an error, or a fault of the world; and options of a reset."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tightloop.checks.attributes import suggestion
from tightloop.errors import ArgumentError

#: What happens where a result is NaN in a world that is not faulted.
OnNan = Literal["raise", "fault"]
#: Bit of ``infos["fault"]`` of a world whose reward or observation is NaN; the others are those of ``status``.
TASK_FAULT = 16
#: Names in ``infos`` that are not those of metrics.
RESERVED = ("success", "fault", "final_obs", "final_info", "episode")


def check_on_nan(on_nan: str) -> bool:
    """Return whether NaN faults its world.

    Raises:
        ArgumentError: It is neither ``"raise"`` nor ``"fault"``.
    """
    if on_nan not in ("raise", "fault"):
        raise ArgumentError(f'on_nan is {on_nan!r}; give "raise" or "fault"')
    return on_nan == "fault"


def refuse(what: str, wrong: NDArray[np.bool_], value: str = "NaN") -> ArgumentError:
    """Return the error of a result; ``wrong`` are the worlds."""
    worlds = np.flatnonzero(wrong)
    more = f" (and {len(worlds) - 1} more)" if len(worlds) > 1 else ""
    cure = 'return finite numbers, or make the environment with on_nan="fault", which ends such episodes'
    return ArgumentError(f"{what} is {value} in world {worlds[0]}{more}; {cure}")


def check_metric_names(what: str, names: Sequence[Any]) -> None:
    """Check the names of metrics, which stand in ``infos`` beside names of our own.

    Raises:
        ArgumentError: A name is no string, begins with an underscore, or is taken.
    """
    for name in names:
        if not isinstance(name, str):
            raise ArgumentError(f"{what}: a name is {name!r}; give strings")
        if name in RESERVED:
            cure = "`Task.success` returns it" if name == "success" else "choose another"
            raise ArgumentError(f"{what}: the name {name!r} is taken in infos; {cure}")
        if name.startswith("_"):
            raise ArgumentError(
                f"{what}: {name!r} begins with an underscore, as masks in infos do; choose another name"
            )


def check_options(options: Any, known: Sequence[str]) -> None:
    """Check the options of a reset.

    Raises:
        ArgumentError: They are no dict, or there is an unknown one.
    """
    if options is None:
        return
    if not isinstance(options, Mapping):
        raise ArgumentError(f"reset: options is {options!r}; give a dict")
    for name in options:
        if name not in known:
            there = suggestion(str(name), known) if known else "a single environment has none"
            raise ArgumentError(f"reset: options has {name!r}, which is unknown; {there}")
