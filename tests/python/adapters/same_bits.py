"""Checks that two vector environments return the same bits, in some of their worlds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray


def assert_same_bits(what: str, one: NDArray[Any], other: NDArray[Any], worlds: NDArray[np.bool_]) -> None:
    """Rows of two arrays have the same type and bits; NaN equals itself."""
    assert one.dtype == other.dtype and one.shape == other.shape, what
    assert one[worlds].tobytes() == other[worlds].tobytes(), what


def assert_same_infos(one: Mapping[str, Any], other: Mapping[str, Any], worlds: NDArray[np.bool_]) -> None:
    """Infos have the same names, the same masks, and the same bits in rows that the masks mark."""
    assert one.keys() == other.keys()
    for name, value in one.items():
        if isinstance(value, Mapping):
            assert_same_infos(value, other[name], worlds)
        else:
            marked = worlds & one[f"_{name}"] if f"_{name}" in one else worlds
            assert_same_bits(name, value, other[name], marked)


def assert_same_steps(one: Sequence[Any], other: Sequence[Any], worlds: NDArray[np.bool_]) -> None:
    """Results of `step` or `reset` are the same, infos included."""
    for place, (mine, others) in enumerate(zip(one[:-1], other[:-1], strict=True)):
        assert_same_bits(f"result {place}", mine, others, worlds)
    assert_same_infos(one[-1], other[-1], worlds)
