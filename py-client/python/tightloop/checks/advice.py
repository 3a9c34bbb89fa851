"""Warnings of what is valid and most likely a mistake, at the line of the user's code that led to them.

Each cause is reported once per process. A warning that is an error, or that a filter ignores, is not counted as
reported.
"""

from __future__ import annotations

import os
import re
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

from tightloop.arrays.frames import FAULTED
from tightloop.errors import TightloopWarning
from tightloop.terminal import printable

_OWN = f"{Path(__file__).parents[1]}{os.sep}"
#: What explains a command that is not finite: the actions of an environment.
_SOURCE: ContextVar[Callable[[], tuple[int, str] | None] | None] = ContextVar("_SOURCE", default=None)
#: Speeds above this say which dof went wrong [rad/s or m/s].
_FAST = 20.0
#: Causes that this process has reported, and how many it remembers.
_TOLD: set[str] = set()
_TOLD_MAX = 4096
# digits of names are none: joint1 and joint2 are two causes
_NUMBER = re.compile(r"(?<![\w`/.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w/`])|\bnan\b|\binf\b")


def warn(message: str, *, cause: str | None = None) -> None:
    """Warn with the place of the user's code: the innermost call from outside of this package and of libraries.

    Args:
        message: What is wrong, and the cure.
        cause: What warnings of the same mistake share; the message if left out. A later one is silent.
    """
    cause = message if cause is None else cause
    if cause in _TOLD:
        return
    level, _ = _user()
    warnings.warn(printable(message), TightloopWarning, stacklevel=level)
    if len(_TOLD) < _TOLD_MAX and not _is_ignored(message):
        _TOLD.add(cause)


def warn_of_values(message: str) -> None:
    """Warn of values of one simulation; the same message with other numbers has the same cause."""
    warn(message, cause=_NUMBER.sub("#", message))


def forget() -> None:
    """Report every cause again."""
    _TOLD.clear()


def _is_ignored(message: str) -> bool:
    """Return whether a filter for all modules ignores the warning."""
    for action, text, category, module, line in warnings.filters:
        if issubclass(TightloopWarning, category) and (text is None or text.match(message)):
            return action == "ignore" and module is None and not line
    return False


@contextmanager
def explained_by(source: Callable[[], tuple[int, str] | None]) -> Iterator[None]:
    """Name commands that are not finite by where they come from.

    Args:
        source: Returns the first world with such a value, and a text such as ``"action[2] is nan"``; None without one.
    """
    token = _SOURCE.set(source)
    try:
        yield
    finally:
        _SOURCE.reset(token)


def tell_of_faults(  # noqa: PLR0917 (called from Rust, by place)
    frame: Any,
    bounds: tuple[float | None, float | None],
    on_nan: str,
    on_fault: str,
    dof_names: list[str],
    command: tuple[int, str] | None = None,
) -> None:
    """Warn of the faulted worlds of a frame.

    Args:
        frame: The frame, with at least one such world.
        bounds: Largest |joint_q| and |joint_qd| of the run; None is no bound.
        on_nan: As of `launch`.
        on_fault: As of `launch`.
        dof_names: As of `Sim`.
        command: World and text of a command of this step that is not finite.
    """
    faulted = np.flatnonzero(frame.status & FAULTED)
    first = int(faulted[0])
    if command is not None and command[0] in faulted:
        source = _SOURCE.get()
        given = None if source is None else source()
        first, spoiled = command if given is None else given
        after = f"{_worlds(faulted, frame)} world {first}, after its step {frame.step[first]}, since its {spoiled}. "
        who = "the policy and its observations" if given is not None else "what computes it"
        _warn_of_faults(
            f"{after}Check {who} for NaN and infinity.{_cure(on_fault)} Later faults are not reported", "a command"
        )
        return
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
    _warn_of_faults(
        f"{_worlds(faulted, frame)} world {first}, after its step {frame.step[first]}, with "
        f"{reason}.{state} Usual causes are a long dt, gains too large for light links, and shapes that start inside "
        f"of others. Use a smaller dt, more substeps, smaller gains, or joint_armature."
        f"{_cure(on_fault)} Later faults are not reported",
        reason,
    )


def _warn_of_faults(message: str, reason: str) -> None:
    # a fault is an event: another line of the user's code reports it again, such as an edited cell of a notebook
    _, frame = _user()
    place = "" if frame is None else f"{frame.f_code.co_filename}:{frame.f_lineno}"
    warn(message, cause=f"fault by {reason} at {place}")


def _worlds(faulted: Any, frame: Any) -> str:
    worlds = "1 world" if len(faulted) == 1 else f"{len(faulted)} worlds"
    return f"{worlds} of {len(frame.status)} faulted: {'it is' if len(faulted) == 1 else 'the first of them is'}"


def _cure(on_fault: str) -> str:
    if on_fault == "reset":
        return ""
    return (
        " A faulted world keeps its last good state until a reset: reset(mask=(frame.status & 9) != 0) resets such "
        'worlds, and launch(on_fault="reset") does so by itself.'
    )


def _user() -> tuple[int, FrameType | None]:
    """Return the stack level of the caller's user, as ``warnings.warn`` counts it in the caller, and its frame."""
    frame: FrameType | None = sys._getframe(1)
    level = 0
    outside: tuple[int, FrameType] | None = None
    while frame is not None:
        level += 1
        file = frame.f_code.co_filename
        if not file.startswith(_OWN):
            outside = (level, frame) if outside is None else outside
            if f"{os.sep}site-packages{os.sep}" not in file and not file.startswith("<frozen"):
                return level, frame
        frame = frame.f_back
    return (level, None) if outside is None else outside
