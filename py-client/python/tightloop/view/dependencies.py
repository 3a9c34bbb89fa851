"""Checks for the viewer's libraries, which come with the extra ``view``."""

from __future__ import annotations

from tightloop.optional_imports import optional_import

#: How to install the extra ``view``. tightloop-sim is on no package index, so the hint names local files.
INSTALL = 'run `pip install "./py-client[view]"` in the repository, or `pip install "FILE.whl[view]"` from a wheel'

_PROBLEM = "the viewer needs `{}`: " + INSTALL


def check(*modules: str) -> None:
    """Check that libraries of the viewer are installed.

    Args:
        modules: Names of their modules.

    Raises:
        MissingLibrary: A library is not installed; the message says how to install it.
    """
    for module in modules:
        optional_import(module, _PROBLEM)
