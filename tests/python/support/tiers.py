"""The two tiers of tests: `make test` leaves out what is marked `nightly`, and `make test-all` runs everything."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest

NIGHTLY = pytest.mark.nightly


def sweep(cases: Iterable[Any], daily: int) -> list[Any]:
    """Cases for `parametrize`: the first ones, `daily` in number, run in both tiers, the others in the nightly one.

    A case of several arguments is a tuple.
    """
    assert daily > 0, "a test of the nightly tier alone is marked as a whole"
    every = list(cases)
    return every[:daily] + [nightly(*(case if isinstance(case, tuple) else (case,))) for case in every[daily:]]


def nightly(*case: Any) -> Any:
    """A case of the nightly tier alone."""
    return pytest.param(*case, marks=NIGHTLY)
