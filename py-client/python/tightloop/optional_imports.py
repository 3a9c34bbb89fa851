"""Imports of libraries that tightloop does not depend on."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from tightloop.errors import MissingLibrary


def optional_import(module: str, problem: str) -> Any:
    """Import a module of an optional library.

    Args:
        module: Full name of the module.
        problem: Message of the error if the module is missing; ``{}`` stands for the name of what is missing.

    Raises:
        MissingLibrary: The library is not installed.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        # a module that the library itself misses is the library's error to report
        if error.name is None or not f"{module}.".startswith(f"{error.name}."):
            raise
        raise MissingLibrary(problem.format(error.name)) from error
