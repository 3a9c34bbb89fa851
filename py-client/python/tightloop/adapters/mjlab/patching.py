"""The one place that changes mjlab: its `Simulation` becomes ours in every module that has it."""

from __future__ import annotations

import sys
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from tightloop.adapters.environment import library
from tightloop.errors import ArgumentError, MissingLibrary

#: Versions of mjlab whose `Simulation` is known: at least the first, and below the second.
VERSIONS = ("1.6", "1.7")


def install() -> type[Any]:
    """Let mjlab simulate with tightloop. Environments that exist already keep what they have.

    Returns:
        The class that stands for ``mjlab.sim.Simulation`` from now on.

    Raises:
        MissingLibrary: mjlab is not installed.
        ArgumentError: It has another version than those of `VERSIONS`.
    """
    _check_version()
    theirs = library("mjlab.sim.sim", install="mjlab").Simulation
    from tightloop.adapters.mjlab.simulation import Simulation

    if theirs is Simulation:
        return Simulation
    for name, module in list(sys.modules.items()):
        if name.partition(".")[0] == "mjlab" and getattr(module, "Simulation", None) is theirs:
            module.Simulation = Simulation  # type: ignore[attr-defined]
    return Simulation


def _check_version() -> None:
    try:
        found = version("mjlab")
    except PackageNotFoundError:
        raise MissingLibrary(f"mjlab is not installed: pip install 'mjlab=={VERSIONS[0]}.*'") from None
    least, end = (_numbers(text) for text in VERSIONS)
    if not least <= _numbers(found) < end:
        raise ArgumentError(
            f"mjlab is {found}, and tightloop knows the Simulation of {VERSIONS[0]} to below {VERSIONS[1]}: "
            f"pip install 'mjlab=={VERSIONS[0]}.*'"
        )


def _numbers(text: str) -> tuple[int, ...]:
    return tuple(int(part) for part in text.split(".")[:2])
