"""Names of a package that `make check` does not install."""

from typing import Any

def __getattr__(name: str) -> Any: ...
