"""A public callable of the Python API, as tests call it with wrong arguments."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Call:
    """A callable, with arguments that are right, and the kinds of those that are tried wrong.

    Attributes:
        make: Returns the callable, from what the fixture made.
        kinds: Kind by argument.
        right: Arguments that are needed besides.
        left: Arguments that are not tried, with the reason.
    """

    make: Callable[[Any], Callable[..., Any]]
    kinds: Mapping[str, str]
    right: Mapping[str, Any] = field(default_factory=dict)
    left: Mapping[str, str] = field(default_factory=dict)
