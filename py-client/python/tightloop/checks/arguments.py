"""Checks of arguments; each error names the value and what is valid."""

from __future__ import annotations

import math
import operator
import os
import re
from collections.abc import Container, Sequence
from pathlib import Path
from typing import Any, SupportsFloat, SupportsIndex

import numpy as np
from numpy.typing import NDArray

from tightloop.errors import SceneError

Vector = Sequence[float] | NDArray[Any]
Triple = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.\-]*")
# The daemon reads integers into 64 bits, and checks tighter bounds itself.
_INT_MAX = 2**63 - 1
# Rounding to four digits stays below this; more is a mistake such as degrees or Euler angles.
_QUAT_NORM_SLACK = 1e-3
_QUAT_NORM_ROUNDING = 4e-16


def number(
    what: str,
    value: SupportsFloat,
    *,
    above: float | None = None,
    least: float | None = None,
    infinite: bool = False,
    error: type[Exception] = SceneError,
) -> float:
    """Check a finite float, optionally with a lower bound, or with infinity as a value."""
    try:
        if isinstance(value, str | bytes | bytearray):  # which `float` reads
            raise TypeError
        checked = float(value)
    except (TypeError, ValueError):
        raise error(f"{what} is {value!r}; give a number") from None
    except OverflowError:  # an int with more than 308 digits
        raise error(f"{what} is larger than any float; give a finite number") from None
    if not math.isfinite(checked) and not (infinite and checked == math.inf):
        raise error(f"{what} is {checked}; give a finite number")
    if above is not None and checked <= above:
        raise error(f"{what} is {checked:g}; it must be above {above:g}")
    if least is not None and checked < least:
        raise error(f"{what} is {checked:g}; it must be at least {least:g}")
    return checked


def integer(what: str, value: SupportsIndex, *, least: int = 1, error: type[Exception] = SceneError) -> int:
    """Check a 64-bit int with a lower bound; refuse floats, even whole ones."""
    try:
        checked = operator.index(value)
    except TypeError:
        raise error(f"{what} is {value!r}; give a whole number") from None
    if checked < least:
        raise error(f"{what} is {checked}; it must be at least {least}")
    if checked > _INT_MAX:
        raise error(f"{what} does not fit into 64 bits; give a smaller number")
    return checked


def flag(what: str, value: object, *, error: type[Exception] = SceneError) -> bool:
    """Check a bool; 0 and 1 count, words such as ``"no"`` do not."""
    if isinstance(value, bool | np.bool_) or (isinstance(value, int | np.integer) and value in (0, 1)):
        return bool(value)
    raise error(f"{what} is {value!r}; give True or False")


def text(what: str, value: str, *, error: type[Exception] = SceneError) -> str:
    """Check a string for use in other programs: no lone surrogates, no zero bytes."""
    if not isinstance(value, str):
        raise error(f"{what} is {value!r}; give a string")
    if "\0" in value or any("\ud800" <= letter <= "\udfff" for letter in value):
        raise error(f"{what} is {value!r}; use letters that can be printed")
    return value


def path(what: str, value: str | os.PathLike[str], *, error: type[Exception] = SceneError) -> Path:
    """Return an absolute path; ``~`` is the home folder."""
    try:
        given = os.fspath(value)
    except TypeError:
        given = None
    if not isinstance(given, str):
        raise error(f"{what} is {value!r}; give a path as str or pathlib.Path")
    if "\0" in given:
        raise error(f"{what} is {given!r}; give a path without a zero byte")
    return Path(given).expanduser().absolute()


def triple(what: str, values: Vector, *, error: type[Exception] = SceneError) -> Triple:
    """Check three finite floats."""
    x, y, z = _numbers(what, values, 3, error)
    return x, y, z


def pair(what: str, values: Vector, *, error: type[Exception] = SceneError) -> tuple[float, float]:
    """Check two finite floats."""
    x, y = _numbers(what, values, 2, error)
    return x, y


def quaternion(what: str, values: Vector) -> Quaternion:
    """Check and normalise a unit quaternion (x, y, z, w)."""
    x, y, z, w = _numbers(what, values, 4)
    norm = math.hypot(x, y, z, w)
    if abs(norm - 1.0) > _QUAT_NORM_SLACK:
        raise SceneError(f"{what} {(x, y, z, w)} has length {norm:.4g}; give a unit quaternion (x, y, z, w)")
    if abs(norm - 1.0) < _QUAT_NORM_ROUNDING:
        return x, y, z, w  # so that what was normalised keeps its bits
    return x / norm, y / norm, z / norm, w / norm


def name(what: str, given: str, taken: Container[str]) -> str:
    """Check a name that is unique in the scene and can precede a slash."""
    if not isinstance(given, str) or not _NAME.fullmatch(given):
        rule = "use letters, digits, `_`, `-` and `.`, of which the last two do not come first"
        raise SceneError(f"{what} name {given!r}: {rule}; name= gives another")
    if given in taken:
        raise SceneError(f"{what} name `{given}` is taken; give another name=")
    return given


def choice(what: str, given: Any, known: Sequence[str]) -> None:
    """Check that a value is one of a list of words."""
    if given not in known:
        raise SceneError(f"unknown {what} {given!r}; choose one of {', '.join(map(repr, known))}")


def _numbers(what: str, values: Vector, count: int, error: type[Exception] = SceneError) -> tuple[float, ...]:
    try:
        checked = tuple(number(what, value, error=error) for value in values)
    except TypeError:
        raise error(f"{what} is {values!r}; give {count} numbers") from None
    if len(checked) != count:
        raise error(f"{what} has {len(checked)} values; give {count}")
    return checked
