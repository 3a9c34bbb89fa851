"""Arrays whose temporaries lie in memory of their own, so that a task's functions allocate nothing from frame to frame.

A task's function does the same operations in every frame. The first time, the result of each is kept, in order; from
then on operation k writes into what it made before. What does not repeat (another operation, shape or type at that
place), and what somebody still holds, is made anew, so the arithmetic is always NumPy's.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray


class Arena:
    """Where the results of operations go: the tape of the function that runs."""

    __slots__ = ("_place", "_tape")

    def __init__(self) -> None:
        self._tape: list[tuple[list[Any], NDArray[Any], Pooled]] = []
        self._place = 0

    def play(self, tape: list[Any]) -> None:
        """Begin a function from the start of its tape, a list that is empty at first.

        What the function returned the last time is overwritten.
        """
        self._tape, self._place = tape, 0

    def wrap(self, array: NDArray[Any]) -> Pooled:
        """A view of the array; all that is computed from it lies in this arena."""
        pooled = array.view(Pooled)
        pooled._arena = self
        return pooled

    def run(self, key: list[Any], call: Any, inputs: list[Any], options: dict[str, Any]) -> Any:
        """The result of an operation: where it was put the last time, if it is the same one."""
        tape, place = self._tape, self._place
        self._place = place + 1
        if place < len(tape) and tape[place][0] == key:
            _, array, pooled = tape[place]
            if (sys.getrefcount(array), sys.getrefcount(pooled)) == _FREE:
                call(*inputs, out=array, **options)
                return pooled
        result = call(*inputs, **options)
        if not isinstance(result, np.ndarray):
            result = np.asarray(result)
        pooled = self.wrap(result)
        tape[place:] = [(key, result, pooled)]
        return pooled


class Pooled(np.ndarray[Any, Any]):
    """An array of an `Arena`; `Arena.wrap` makes it."""

    _arena: Arena | None = None

    def __array_finalize__(self, parent: Any) -> None:
        self._arena = getattr(parent, "_arena", None)

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        arena, plain, key = None, [], [ufunc, method]
        for value in inputs:
            array = value
            if type(array) is Pooled:
                arena = arena or array._arena
                array = array.view(np.ndarray)
            plain.append(array)
            key += (array.shape, array.dtype) if type(array) is np.ndarray else (type(array),)
        call = ufunc if method == "__call__" else getattr(ufunc, method)
        out = options.pop("out", None)
        if out is not None and any(array is not None for array in out):
            own = tuple(array.view(np.ndarray) if type(array) is Pooled else array for array in out)
            call(*plain, out=own, **options)
            return out[0] if len(out) == 1 else out
        for name, option in options.items():
            if isinstance(option, np.ndarray):  # `where`
                arena, options[name] = None, option.view(np.ndarray)
        if arena is None or ufunc.nout != 1 or method not in ("__call__", "reduce"):
            return call(*plain, **options)
        if options:
            key.append(options)
        return arena.run(key, call, plain, options)

    def __array_function__(self, func: Any, types: Any, args: Any, kwargs: Any) -> Any:
        if func is np.where and len(args) == 3 and not kwargs and self._arena is not None:
            plain = [array.view(np.ndarray) if type(array) is Pooled else array for array in args]
            if getattr(plain[0], "dtype", None) != np.bool_:
                return np.where(*plain)
            key = [func, *((array.shape, array.dtype) if type(array) is np.ndarray else type(array) for array in plain)]
            return self._arena.run(key, _where, plain, {})
        return super().__array_function__(func, types, args, kwargs)


def _where(condition: Any, yes: Any, no: Any, out: NDArray[Any] | None = None) -> NDArray[Any]:
    if out is None:
        return np.where(condition, yes, no)
    np.copyto(out, no)
    np.copyto(out, yes, where=condition)
    return out


def _free() -> tuple[int, int]:
    """Reference counts that `Arena.run` finds of a result that nobody holds; they differ from Python to Python."""
    arena, tape = Arena(), []
    for _ in range(2):
        arena.play(tape)
        arena.run([], np.negative, [np.ones(1)], {})
    _, array, pooled = tape[0]
    return sys.getrefcount(array), sys.getrefcount(pooled)


_FREE = (-1, -1)
_FREE = _free()
