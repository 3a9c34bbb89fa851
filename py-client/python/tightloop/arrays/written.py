"""Arrays of values that belong to something else: entries of a property can be assigned, those of a frame cannot."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.errors import CommandRefused


class PropertyArray(np.ndarray[Any, np.dtype[Any]]):
    """The values of a property. Assigning to entries sets the property, also in place: ``arm.joint_q[:9] += 0.1``.

    An assignment first reads the property again, so entries that were set elsewhere meanwhile keep their values.
    Results of calculations are plain arrays. Other ways to write into the memory, such as ``np.copyto``, raise an
    error, because they would change a copy.
    """

    _memory: NDArray[Any]
    _read: Callable[[], NDArray[Any]]
    _write: Callable[[NDArray[Any], NDArray[np.bool_]], NDArray[Any]] | None = None
    _error: Callable[[str], Exception]

    @classmethod
    def of(
        cls,
        read: Callable[[], NDArray[Any]],
        write: Callable[[NDArray[Any], NDArray[np.bool_]], NDArray[Any]],
        error: Callable[[str], Exception],
    ) -> PropertyArray:
        """Make the array of a property.

        Args:
            read: Returns the property's values, in memory of their own, always of one shape.
            write: Sets the property to values of that shape, and returns those that it then has. A mask says which
                entries were assigned: others may follow them.
            error: Makes the exception of an assignment that does not fit, from the end of its message.
        """
        values = read()
        made = values.view(cls)
        made.flags.writeable = False
        made._memory, made._read, made._write, made._error = values, read, write, error
        return made

    def __getitem__(self, key: Any) -> Any:
        part = super().__getitem__(key)
        if self._write is not None and isinstance(part, PropertyArray):
            if not np.may_share_memory(part, self):  # indices and masks copy
                return np.array(part)
            part._memory, part._error = self._memory[key], self._error
            part._read = lambda: self._read()[key]
            part._write = lambda values, assigned: self._assign(key, values, assigned)[key]
        return part

    def __setitem__(self, key: Any, value: Any) -> None:
        if self._write is None:
            super().__setitem__(key, value)
            return
        value = np.array(value) if isinstance(value, PropertyArray) else value  # before its memory changes
        self._assign(key, value, True)

    def _assign(self, key: Any, value: Any, assigned: NDArray[np.bool_] | bool) -> NDArray[Any]:
        assert self._write is not None
        self._refresh()
        changed, mask = self._memory.copy(), np.zeros(self._memory.shape, bool)
        try:
            changed[key] = value
            mask[key] = assigned
        except (IndexError, TypeError, ValueError) as problem:
            raise self._error(f"cannot be assigned at [{_shown(key)}]: {problem}") from None
        self._memory[...] = self._write(changed, mask)
        return self._memory

    def _refresh(self) -> None:
        """Read the property again."""
        if self._write is not None:
            self._memory[...] = self._read()

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        outs = options.pop("out", ())
        plain = [value.view(np.ndarray) if isinstance(value, PropertyArray) else value for value in inputs]
        owned = [out for out in outs if isinstance(out, PropertyArray)]
        if not owned:
            return getattr(ufunc, method)(*plain, **options, **({"out": outs} if outs else {}))
        for out in owned:
            out._refresh()
        kept = tuple(np.array(out) if isinstance(out, PropertyArray) else out for out in outs)
        getattr(ufunc, method)(*plain, **options, out=kept)
        for out, values in zip(outs, kept, strict=True):
            if isinstance(out, PropertyArray):
                out[...] = values
        return outs[0] if len(outs) == 1 else outs

    def __reduce__(self) -> Any:
        return np.array(self).__reduce__()

    def __repr__(self) -> str:
        return repr(np.array(self))


class FrameArray(np.ndarray[Any, np.dtype[Any]]):
    """An array of a frame, in the daemon's memory, which nobody may write to. Results of it are plain arrays."""

    def __setitem__(self, key: Any, value: Any) -> None:
        if not self.flags.writeable:
            raise _read_only()
        super().__setitem__(key, value)

    # results of calculations, as np.memmap does it
    def __array_wrap__(self, array: NDArray[Any], context: Any = None, return_scalar: bool = False) -> Any:
        return array[()] if return_scalar else array.view(np.ndarray)

    def __reduce__(self) -> Any:
        return np.array(self).__reduce__()

    def __repr__(self) -> str:
        return repr(np.asarray(self))


def _checked_in_place(name: str) -> Callable[[FrameArray, Any], Any]:
    """Return NumPy's operator, such as ``+=``, with our message for memory that is read-only."""
    in_place = getattr(np.ndarray, name)

    def checked(self: FrameArray, other: Any) -> Any:
        if not self.flags.writeable:
            raise _read_only()
        return in_place(self, other)

    return checked


for _name in (
    "__iadd__",
    "__isub__",
    "__imul__",
    "__itruediv__",
    "__ifloordiv__",
    "__imod__",
    "__ipow__",
    "__iand__",
    "__ior__",
    "__ixor__",
    "__ilshift__",
    "__irshift__",
    "__imatmul__",
):
    setattr(FrameArray, _name, _checked_in_place(_name))


def _checked_method(name: str) -> Callable[..., Any]:
    """Return NumPy's method that changes an array, with our message for memory that is read-only."""
    method = getattr(np.ndarray, name)

    @functools.wraps(method)
    def checked(self: FrameArray, *given: Any, **named: Any) -> Any:
        if not self.flags.writeable:
            raise _read_only()
        return method(self, *given, **named)

    return checked


for _name in ("fill", "partition", "put", "resize", "sort"):
    setattr(FrameArray, _name, _checked_method(_name))


def _read_only() -> CommandRefused:
    return CommandRefused(
        "an array of a frame is read-only, since it is the daemon's memory: `sim.write(joint_q=…)` and `sim.params` "
        "change worlds, and `.copy()` of the array is yours to change"
    )


def _shown(key: Any) -> str:
    """A key as it was written."""
    if isinstance(key, slice):
        start, stop = ("" if end is None else end for end in (key.start, key.stop))
        return f"{start}:{stop}" if key.step is None else f"{start}:{stop}:{key.step}"
    if isinstance(key, tuple):
        return ", ".join(map(_shown, key))
    return "…" if key is Ellipsis else repr(key)
