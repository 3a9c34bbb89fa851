"""Libraries of the formats, which come with the extra ``data``."""

from __future__ import annotations

from typing import Any

from tightloop.optional_imports import optional_import

#: How to install the extra ``data``. tightloop-sim is on no package index, so the hint names local files.
INSTALL = 'run `pip install "./py-client[data]"` in the repository, or `pip install "FILE.whl[data]"` from a wheel'


def load(module: str) -> Any:
    """Import a module of the extra.

    Raises:
        MissingLibrary: It is not installed; the message says how to install it.
    """
    return optional_import(module, "export needs `{}`: " + INSTALL)
