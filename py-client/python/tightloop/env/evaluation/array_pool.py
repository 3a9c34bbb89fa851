"""A pool for the temporary arrays of a task's functions, which then allocate nothing from frame to frame.

A function does the same operations in every frame. The first call records the result of each operation on a tape.
In later calls, operation k writes into its recorded result. A new array is made where the operation, shape or type
differs from the tape, or where somebody still holds the result. The arithmetic is always NumPy's.
"""

from __future__ import annotations

from collections.abc import Sequence
from sys import getrefcount
from typing import Any

import numpy as np
from numpy.typing import NDArray


class ArrayPool:
    """The pool; its tape belongs to the function that runs."""

    __slots__ = ("_place", "_pooled", "_tape")

    def __init__(self) -> None:
        self._tape: list[tuple[Any, NDArray[Any], PooledArray]] = []
        self._place = 0
        # a type per pool, so that views of an array know their pool
        self._pooled: type[PooledArray] = type("PooledArray", (PooledArray,), {"_pool": self})

    def play(self, tape: list[Any]) -> None:
        """Start a function at the start of its tape, which is an empty list at first.

        The function overwrites its previous results, unless somebody holds them.
        """
        self._tape, self._place = tape, 0

    def wrap(self, array: NDArray[Any]) -> PooledArray:
        """Return a view of the array; results computed from it lie in this pool."""
        return array.view(self._pooled)

    def run(self, key: tuple[Any, ...], call: Any, inputs: Sequence[Any], options: dict[str, Any]) -> Any:
        """Run an operation; its result goes where the same operation put it the last time."""
        tape, place = self._tape, self._place
        self._place = place + 1
        if place < len(tape):
            kept, array, pooled = tape[place]
            if kept == key and getrefcount(array) == _ARRAY_FREE and getrefcount(pooled) == _POOLED_FREE:
                call(*inputs, out=array, **options)
                return pooled
        result = np.asarray(call(*inputs, **options))
        pooled = self.wrap(result)
        tape[place:] = [(key, result, pooled)]
        return pooled


class PooledArray(np.ndarray[Any, Any]):
    """An array of an `ArrayPool`, made by `ArrayPool.wrap`."""

    _pool: ArrayPool

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        if not options and len(inputs) == 2 and method == "__call__" and ufunc.nout == 1:
            # the most frequent case, without lists
            one, other = inputs
            one = one.view(np.ndarray) if isinstance(one, PooledArray) else one
            other = other.view(np.ndarray) if isinstance(other, PooledArray) else other
            return self._pool.run((ufunc, _kind(one), _kind(other)), ufunc, (one, other), options)
        plain, key = _plain(inputs)
        if not options and method == "__call__" and ufunc.nout == 1:
            return self._pool.run((ufunc, *key), ufunc, plain, options)
        call = ufunc if method == "__call__" else getattr(ufunc, method)
        out = options.pop("out", None)
        arrays = {name: option.view(np.ndarray) for name, option in options.items() if isinstance(option, np.ndarray)}
        if out is not None and any(array is not None for array in out):
            call(*plain, out=tuple(_plain(out)[0]), **options | arrays)
            return out[0] if len(out) == 1 else out
        if arrays or ufunc.nout != 1 or method not in ("__call__", "reduce"):
            return call(*plain, **options | arrays)
        return self._pool.run((ufunc, method, options, *key), call, plain, options)

    def __array_function__(self, func: Any, types: Any, args: Any, kwargs: Any) -> Any:
        if func is np.where and len(args) == 3 and not kwargs:
            plain, key = _plain(args)
            if getattr(plain[0], "dtype", None) != np.bool_:
                return np.where(*plain)
            return self._pool.run((func, *key), _where, plain, kwargs)
        return super().__array_function__(func, types, args, kwargs)


def _plain(values: tuple[Any, ...]) -> tuple[list[Any], list[Any]]:
    """Return arrays as plain NumPy arrays, and the kind of each value."""
    plain = [value.view(np.ndarray) if isinstance(value, PooledArray) else value for value in values]
    return plain, [_kind(value) for value in plain]


def _kind(value: Any) -> Any:
    """Return shape and dtype of an array, and the type of any other value."""
    return (value.shape, value.dtype) if type(value) is np.ndarray else type(value)


def _where(condition: Any, yes: Any, no: Any, out: NDArray[Any] | None = None) -> NDArray[Any]:
    if out is None:
        return np.where(condition, yes, no)
    np.copyto(out, no)
    np.copyto(out, yes, where=condition)
    return out


def _free() -> tuple[int, int]:
    """Return the reference counts that `ArrayPool.run` sees on an unused result; they depend on the Python version."""
    pool, tape = ArrayPool(), []
    pool.play(tape)
    pool.run((), np.negative, [np.ones(1)], {})
    _, array, pooled = tape[0]
    return getrefcount(array), getrefcount(pooled)


_ARRAY_FREE, _POOLED_FREE = _free()
