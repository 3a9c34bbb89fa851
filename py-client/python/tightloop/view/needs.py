"""Checks for the libraries of the extra ``view``, which the viewer needs beyond tightloop's own dependencies."""

from __future__ import annotations

from importlib import import_module

from tightloop.errors import MissingLibrary

#: How to install the extra ``view``. tightloop-sim is on no package index, so the hint names local files.
INSTALL = 'run `pip install "./py-client[view]"` in the repository, or `pip install "FILE.whl[view]"` from a wheel'


def check(*modules: str) -> None:
    """Import libraries of the viewer.

    Args:
        modules: Their names.

    Raises:
        MissingLibrary: One is not installed.
    """
    for module in modules:
        try:
            import_module(module)
        except ModuleNotFoundError as error:
            # what the library itself misses is for the library to say
            if error.name != module:
                raise
            raise MissingLibrary(f"the viewer needs `{module}`: {INSTALL}") from error
