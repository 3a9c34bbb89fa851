"""Conversion of arguments to the arrays of a command. Contiguous float arrays skip this module."""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.errors import ArgumentError, CommandRefused
from tightloop.gpu.array_libraries import gpu_of


def as_array(
    field: str,
    robot: str | None,
    value: Any,
    worlds: int,
    columns: int,
    *,
    base: int = 0,
    robots: Sequence[tuple[str, int, int]] = (),
) -> NDArray[np.float64]:
    """Convert any array of real numbers to contiguous float64, shape ``(worlds, columns)``.

    Args:
        field: Name of the argument, for messages.
        robot: Robot whose columns these are; None for the whole scene.
        value: The array.
        worlds: Number of worlds.
        columns: Number of columns.
        base: Number of columns of a floating base, which come first and may be left out.
        robots: Robots of the scene with their numbers of columns, and those of a floating base, for messages.

    Raises:
        CommandRefused: The shape is neither ``(worlds, columns)`` nor ``(columns,)``, or the values are not real.
    """
    what = field if robot is None else f"{field} of robot `{robot}`"
    given = real_numbers(what, value)
    size = columns - base if given.shape[-1:] == (columns - base,) else columns
    if given.shape not in ((worlds, size), (size,)):
        if not columns:
            raise CommandRefused(f"{what}: nothing of this scene takes it; leave it out")
        expected = f"expected shape {(worlds, columns)}, or {(columns,)} for all worlds"
        if base:
            expected += f"; {columns - base} without the {base} of its floating base"
        has_worlds = given.shape[:-1] in ((), (worlds,))
        fitting = [name for name, own, base in robots if given.shape and given.shape[-1] in (own, own - base)]
        cure = f'. Robot `{fitting[0]}` has as many: give {{"{fitting[0]}": …}}' if fitting and robot is None else ""
        if given.ndim == 2 and not has_worlds:
            cure = f". The first axis is the worlds, which are {worlds}"
        raise CommandRefused(f"{what}: {expected}; got {given.shape}{cure}")
    with np.errstate(over="ignore"):  # float128 may become inf, which the client refuses
        return np.array(np.broadcast_to(given, (worlds, size)), dtype=np.float64, order="C")


def real_numbers(what: str, value: Any) -> NDArray[Any]:
    """Convert any array of real numbers to NumPy, with its dtype.

    Raises:
        CommandRefused: The value is no array, or its values are not real.
    """
    if isinstance(value, Mapping):
        raise CommandRefused(f"{what} is {value!r:.80}; give an array in the order of the names, such as sim.dof_names")
    given = _numpy(what, value)
    if given.dtype.kind not in "fiu":
        raise CommandRefused(f"{what}: {_shown(value, given)} is not a real number; give float32 or float64")
    return given


def reals(what: str, value: Any) -> NDArray[Any]:
    """Convert an argument of a calculation to NumPy, with its dtype; ``what`` is for messages.

    Raises:
        ArgumentError: The value is no array, or its values are not real.
    """
    try:
        given = np.asarray(value)
    except (ValueError, TypeError):
        raise ArgumentError(
            f"{what} is {value!r:.80}; give an array of real numbers, with rows of one length"
        ) from None
    if given.dtype.kind not in "fiu":
        raise ArgumentError(f"{what}: {_shown(value, given)} is not a real number; give float32 or float64")
    return given


def switches(what: str, value: Any) -> NDArray[Any]:
    """Convert an array of bool or of real numbers to NumPy, bool to 0 and 1.

    Raises:
        CommandRefused: The value is no array, or of something else.
    """
    given = _numpy(what, value)
    return given.astype(np.float64) if given.dtype == np.bool_ else real_numbers(what, given)


def as_mask(name: str, value: Any, worlds: int) -> NDArray[np.bool_]:
    """Convert a mask to a contiguous bool array, shape ``(worlds,)``; ``name`` is for messages.

    Raises:
        CommandRefused: The shape or dtype is wrong.
    """
    given = _numpy(name, value)
    if given.dtype != np.bool_:
        raise CommandRefused(
            f"{name}: {_shown(value, given)} is not bool; give an array with True for the worlds meant"
        )
    if given.shape != (worlds,):
        raise CommandRefused(f"{name}: expected shape {(worlds,)}; got {given.shape}")
    return np.ascontiguousarray(given)


def as_seed(value: Any, worlds: int) -> NDArray[np.uint64]:
    """Convert one seed for all worlds, or one per world, to a contiguous array, shape ``(1,)`` or ``(worlds,)``.

    Raises:
        CommandRefused: The length is wrong, or a seed is not a whole number from 0 to 2**64 - 1.
    """
    try:
        alone = isinstance(value, str | bytes) or np.ndim(value) == 0
    except ValueError:  # rows of different lengths
        alone = False
    entries: list[Any] = [value] if alone else list(value)
    if not alone and len(entries) != worlds:
        raise CommandRefused(f"seed: {len(entries)} seeds for {worlds} worlds; give one, or one per world")
    seeds = []
    for world, entry in enumerate(entries):
        of = "" if alone else f" of world {world}"
        seed = whole_seed(entry)
        if seed is None:
            raise CommandRefused(f"seed{of} is {entry!r}; give a whole number from 0 to 2**64 - 1")
        seeds.append(seed)
    return np.array(seeds, dtype=np.uint64)


def whole_seed(value: Any) -> int | None:
    """Return a seed as an int; None if it is not a whole number from 0 to 2**64 - 1."""
    try:
        # `operator.index` accepts a bool, which is never meant as a seed
        seed = None if isinstance(value, bool | np.bool_) else operator.index(value)
    except TypeError:
        return None
    return seed if seed is not None and 0 <= seed < 2**64 else None


def _shown(value: Any, given: NDArray[Any]) -> str:
    """Return a value that has no dtype to speak of, or the dtype."""
    return f"{value!r:.80}" if given.ndim == 0 or given.dtype == object else f"dtype {given.dtype}"


def _numpy(what: str, value: Any) -> NDArray[Any]:
    try:
        return np.asarray(value)
    except (ValueError, TypeError):
        if gpu_of(value) is not None:
            cure = "`step` takes it after `sim.keep_on_gpu()`; elsewhere give one of the host, such as tensor.cpu()"
            raise CommandRefused(f"{what} is on a GPU; {cure}") from None
        raise CommandRefused(
            f"{what} is {value!r:.80}; give an array of real numbers, with rows of one length"
        ) from None
