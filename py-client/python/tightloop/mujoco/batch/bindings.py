"""The live arrays of a batch: which exist, what was written into them, and their update after a call."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from tightloop.errors import ArgumentError
from tightloop.mujoco.batch.fields import Fields
from tightloop.mujoco.batch.layout import StateLayout

Array = NDArray[Any]
#: Simulations of a call: all, or their indices.
Ids = slice | NDArray[np.int64]

_FLOATS = (np.dtype(np.float64), np.dtype(np.float32))


@dataclass
class _Copy:
    """An array of its own over a part of the state, in another dtype, or over all of it."""

    array: Array
    of: Array
    written: Array


class Bindings:
    """The state of all simulations, and arrays over it and over other fields.

    Args:
        fields: Fields of the model.
        layout: Its state.
        start: Row of every simulation at first, ``(nstate,)``.
        num_sims: Number of simulations.

    Attributes:
        rows: States, ``(num_sims, nstate)``. Callers write into views of them at any time.
        last: The rows as the last call left them.
        warnings: MuJoCo's last info and count of each warning, ``(num_sims, kinds, 2)``.
        derived: Arrays of the fields that are not part of the state, by name.
    """

    def __init__(self, fields: Fields, layout: StateLayout, start: Array, num_sims: int) -> None:
        self._fields, self._layout, self._sims = fields, layout, num_sims
        self.rows = np.tile(start, (num_sims, 1))
        self.last = self.rows.copy()
        self.warnings = np.zeros((num_sims, *fields.shape("warning")), np.int32)
        self.derived: dict[str, Array] = {}
        self._copies: list[_Copy] = []
        self._state: _Copy | None = None
        # with it, the rows when all that was written had been brought to them
        self._base = self.last
        self._arrays: dict[str, Array] = {}

    def get(self, name: str, dtype: DTypeLike | None) -> Array:
        """Return the array of a field, the same one at each call.

        Raises:
            ArgumentError: The dtype is not one of the field's, or the field is bound with another one.
        """
        own = np.dtype(np.float64) if name == "state" else self._fields.dtype(name)
        wanted = own if dtype is None else np.dtype(dtype)
        narrow = own == np.float64 and name != "state"
        if wanted != own and not (narrow and wanted in _FLOATS):
            raise ArgumentError(f"{name} cannot be {wanted}; bind it as {own}{' or float32' if narrow else ''}")
        if name not in self._arrays:
            self._arrays[name] = self._made(name, wanted)
        bound = self._arrays[name]
        if bound.dtype != wanted:
            raise ArgumentError(f"{name} is already bound as {bound.dtype}; give that dtype")
        return bound

    def _made(self, name: str, dtype: np.dtype[Any]) -> Array:
        if name == "state":
            self._state = _Copy(self.last.copy(), self.rows, self.last.copy())
            self._base = self.last.copy()
            return self._state.array
        if name == "warning":
            return self.warnings
        if name not in self._layout:
            self.derived[name] = np.zeros((self._sims, *self._fields.shape(name)), dtype)
            return self.derived[name]
        view = self._layout.view(self.rows, name)
        if dtype == view.dtype:
            return view
        array = view.astype(dtype)
        self._copies.append(_Copy(array, view, array.copy()))
        return array

    def is_bound(self, name: str) -> bool:
        """Whether a field is bound."""
        return name in self._arrays

    def collect(self, ids: Ids) -> None:
        """Bring elements that were written into copies to the rows, those of a part after those of the state."""
        self._bring_state(ids, self.rows)
        for copy in self._copies:
            _bring(copy, ids, copy.of)
        for copy in self._all:
            copy.written[ids] = copy.array[ids]
        if self._state is not None:
            self._base[ids] = self.rows[ids]

    def collect_fields(self, ids: Ids) -> None:
        """Bring what was written into fields, and forget what was written into the state as a whole."""
        if self._state is not None:
            self._state.array[ids] = self._state.written[ids]
        self.collect(ids)

    def pending(self, ids: Ids) -> Array:
        """Return a copy of rows with all that was written, which stays pending."""
        rows = self.rows.copy()
        self._bring_state(ids, rows)
        for copy in self._copies:
            at = copy.of.__array_interface__["data"][0] - self.rows.__array_interface__["data"][0]
            columns = slice(at // 8, at // 8 + copy.of[0].size)
            _bring(copy, ids, rows[:, columns].reshape(copy.of.shape))
        return rows[ids]

    def settle(self, ids: Ids) -> None:
        """End a call: what the rows hold is no longer news, and copies show it."""
        self.last[ids] = self.rows[ids]
        for copy in self._all:
            copy.array[ids] = copy.of[ids]
            copy.written[ids] = copy.array[ids]
        if self._state is not None:
            self._base[ids] = self.rows[ids]

    @property
    def _all(self) -> list[_Copy]:
        return self._copies if self._state is None else [self._state, *self._copies]

    def _bring_state(self, ids: Ids, to: Array) -> None:
        """Bring what was written into the state since the last time, except where a field was written."""
        if self._state is not None:
            rows, base = self.rows[ids], self._base[ids]
            # NaN is no other value than NaN
            kept = (rows == base) | (np.isnan(rows) & np.isnan(base))
            news = self._state.array[ids]
            to[ids] = np.where((news != self._state.written[ids]) & kept, news, rows)


def _bring(copy: _Copy, ids: Ids, to: Array) -> None:
    news = copy.array[ids]
    old = to[ids]
    to[ids] = np.where(news != copy.written[ids], news, old)
