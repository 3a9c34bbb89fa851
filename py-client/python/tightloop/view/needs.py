"""What the viewer needs beyond tightloop's own dependencies; they come with the extra ``tightloop[view]``."""

from __future__ import annotations

from importlib import import_module

from tightloop.errors import MissingLibrary


def check(*modules: str) -> None:
    """Import libraries of the viewer, or say how they are installed.

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
            raise MissingLibrary(f'the viewer needs `{module}`: pip install "tightloop[view]"') from error
