"""Names of a compiled package that has no types of its own."""

from typing import Any

def __getattr__(name: str) -> Any: ...
