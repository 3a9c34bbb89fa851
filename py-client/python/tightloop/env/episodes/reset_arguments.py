"""Autoreset modes and masks of a reset, checked; environments of one machine and of several share these."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from tightloop.env.evaluation.results import check_options
from tightloop.errors import ArgumentError


def autoreset_mode_of(mode: AutoresetMode | str) -> AutoresetMode:
    """Return an autoreset mode, given as itself, by its name or by its value.

    Raises:
        ArgumentError: There is no such mode.
    """
    for known in AutoresetMode:
        if mode in (known, known.name, known.value):
            return known
    raise ArgumentError(f"autoreset_mode is {mode!r}; give NEXT_STEP, SAME_STEP or DISABLED")


def reset_mask(options: dict[str, Any] | None, worlds: int, *, ready: bool) -> NDArray[np.bool_] | None:
    """Return the mask of a reset, shape ``(worlds,)``; None if the options have none.

    Args:
        options: Options of the reset.
        worlds: Number of worlds.
        ready: Whether all worlds have been reset before.

    Raises:
        ArgumentError: The mask or an option is not valid.
    """
    check_options(options, ("reset_mask", "level"))
    if not options or "reset_mask" not in options:
        return None
    mask = options["reset_mask"]
    if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_ or mask.shape != (worlds,):
        raise ArgumentError(f"reset: options, reset_mask: give a NumPy array of bool, shape {(worlds,)}; got {mask!r}")
    if not mask.any():
        raise ArgumentError("reset: options, reset_mask: no environment is to be reset; set at least one to True")
    if not ready and not mask.all():
        raise ArgumentError(
            "reset: options, reset_mask: the first reset is of all environments, and so is one "
            "after a step that failed; leave the mask out"
        )
    return mask
