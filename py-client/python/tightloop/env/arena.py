"""Arrays whose temporaries lie in memory of their own, so that a task's functions allocate nothing from frame to frame.

A task's function does the same operations in every frame. The first time, the result of each is kept, in order; from
then on operation k writes into what it made before. What does not repeat (another operation, shape or type at that
place), and what somebody still holds, is made anew, so the arithmetic is always NumPy's.
"""

from __future__ import annotations

from collections.abc import Sequence
from sys import getrefcount
from typing import Any

import numpy as np
from numpy.typing import NDArray


class Arena:
    """Where the results of operations go: the tape of the function that runs."""

    __slots__ = ("_place", "_pooled", "_tape")

    def __init__(self) -> None:
        self._tape: list[tuple[Any, NDArray[Any], Pooled]] = []
        self._place = 0
        # a type of its own, so that views of an array know their arena without being told
        self._pooled: type[Pooled] = type("Pooled", (Pooled,), {"_arena": self})

    def play(self, tape: list[Any]) -> None:
        """Begin a function from the start of its tape, a list that is empty at first.

        What the function returned the last time is overwritten, unless somebody holds it.
        """
        self._tape, self._place = tape, 0

    def wrap(self, array: NDArray[Any]) -> Pooled:
        """A view of the array; all that is computed from it lies in this arena."""
        return array.view(self._pooled)

    def run(self, key: tuple[Any, ...], call: Any, inputs: Sequence[Any], options: dict[str, Any]) -> Any:
        """The result of an operation: where it was put the last time, if it is the same one."""
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


class Pooled(np.ndarray[Any, Any]):
    """An array of an `Arena`; `Arena.wrap` makes it."""

    _arena: Arena

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        if not options and len(inputs) == 2 and method == "__call__" and ufunc.nout == 1:
            # most of what tasks do, and so without lists
            one, other = inputs
            one = one.view(np.ndarray) if isinstance(one, Pooled) else one
            other = other.view(np.ndarray) if isinstance(other, Pooled) else other
            return self._arena.run((ufunc, _kind(one), _kind(other)), ufunc, (one, other), options)
        plain, key = _plain(inputs)
        if not options and method == "__call__" and ufunc.nout == 1:
            return self._arena.run((ufunc, *key), ufunc, plain, options)
        call = ufunc if method == "__call__" else getattr(ufunc, method)
        out = options.pop("out", None)
        arrays = {name: option.view(np.ndarray) for name, option in options.items() if isinstance(option, np.ndarray)}
        if out is not None and any(array is not None for array in out):
            call(*plain, out=tuple(_plain(out)[0]), **options | arrays)
            return out[0] if len(out) == 1 else out
        if arrays or ufunc.nout != 1 or method not in ("__call__", "reduce"):
            return call(*plain, **options | arrays)
        return self._arena.run((ufunc, method, options, *key), call, plain, options)

    def __array_function__(self, func: Any, types: Any, args: Any, kwargs: Any) -> Any:
        if func is np.where and len(args) == 3 and not kwargs:
            plain, key = _plain(args)
            if getattr(plain[0], "dtype", None) != np.bool_:
                return np.where(*plain)
            return self._arena.run((func, *key), _where, plain, kwargs)
        return super().__array_function__(func, types, args, kwargs)


def _plain(values: tuple[Any, ...]) -> tuple[list[Any], list[Any]]:
    """Arrays as NumPy's own, and the kind of each value."""
    plain = [value.view(np.ndarray) if isinstance(value, Pooled) else value for value in values]
    return plain, [_kind(value) for value in plain]


def _kind(value: Any) -> Any:
    """Shape and type of an array; of what is none, its type."""
    return (value.shape, value.dtype) if type(value) is np.ndarray else type(value)


def _where(condition: Any, yes: Any, no: Any, out: NDArray[Any] | None = None) -> NDArray[Any]:
    if out is None:
        return np.where(condition, yes, no)
    np.copyto(out, no)
    np.copyto(out, yes, where=condition)
    return out


def _free() -> tuple[int, int]:
    """Reference counts that `Arena.run` finds of a result that nobody holds; they differ from Python to Python."""
    arena, tape = Arena(), []
    arena.play(tape)
    arena.run((), np.negative, [np.ones(1)], {})
    _, array, pooled = tape[0]
    return getrefcount(array), getrefcount(pooled)


_ARRAY_FREE, _POOLED_FREE = _free()
