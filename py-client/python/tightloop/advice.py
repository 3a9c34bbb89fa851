"""Warnings of what is valid and most likely a mistake, at the line of the user's code that led to them."""

from __future__ import annotations

import os
import sys
import warnings
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

from tightloop.errors import TightloopWarning
from tightloop.frames import FAULTED

_OWN = f"{Path(__file__).parent}{os.sep}"
#: Speeds above this say which dof went wrong [rad/s or m/s].
_FAST = 20.0


def warn(message: str) -> None:
    """Warn with the place of the user's code: the innermost call from outside of this package and of libraries."""
    warnings.warn(message, TightloopWarning, stacklevel=_level())


def tell_of_faults(
    frame: Any, bounds: tuple[float | None, float | None], on_nan: str, on_fault: str, dof_names: list[str]
) -> None:
    """Warn of the faulted worlds of a frame.

    Args:
        frame: The frame, with at least one such world.
        bounds: Largest |joint_q| and |joint_qd| of the run; None is no bound.
        on_nan: As of `launch`.
        on_fault: As of `launch`.
        dof_names: As of `Sim`.
    """
    faulted = np.flatnonzero(frame.status & FAULTED)
    first = int(faulted[0])
    worlds = "1 world" if len(faulted) == 1 else f"{len(faulted)} worlds"
    which = "it is" if len(faulted) == 1 else "the first of them is"
    if frame.status[first] & 8:
        known = [f"|{name}| of {bound:g}" for name, bound in zip(("joint_q", "joint_qd"), bounds, strict=True) if bound]
        reason = f"a value beyond the bounds ({', '.join(known)})"
    else:
        reason = "a value that is not finite" + (", possibly of a command" if on_nan == "freeze" else "")
    state = ""
    if "joint_qd" in frame.fields and (speeds := np.abs(frame.joint_qd[first])).size:
        fastest = int(speeds.argmax())
        if speeds[fastest] > _FAST:
            state = f" Just before, `{dof_names[fastest]}` was fastest, at {frame.joint_qd[first, fastest]:.3g}."
    cure = (
        ""
        if on_fault == "reset"
        else " A faulted world keeps its last good state until a reset: reset(mask=(frame.status & 9) != 0) resets "
        'such worlds, and launch(on_fault="reset") does so by itself.'
    )
    warn(
        f"{worlds} of {len(frame.status)} faulted: {which} world {first}, after its step {frame.step[first]}, with "
        f"{reason}.{state} Usual causes are a long dt, gains too large for light links, and shapes that start inside "
        f"of others. Use a smaller dt, more substeps, smaller gains, or joint_armature.{cure} Later faults are not "
        "reported"
    )


def _level() -> int:
    """Return the stack level of the caller's user, as ``warnings.warn`` counts it in the caller."""
    frame: FrameType | None = sys._getframe(1)
    level, outside = 0, None
    while frame is not None:
        level += 1
        file = frame.f_code.co_filename
        if not file.startswith(_OWN):
            outside = level if outside is None else outside
            if f"{os.sep}site-packages{os.sep}" not in file and not file.startswith("<frozen"):
                return level
        frame = frame.f_back
    return level if outside is None else outside
