"""Models from MuJoCo: see `tightloop.Scene.from_mujoco` and `tightloop.mujoco.Batch`.

The package `mujoco` reads and compiles MJCF.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    # the names that `__getattr__` provides
    Batch: Any

__all__ = ["Batch"]


def __getattr__(name: str) -> Any:
    # Lazy (PEP 562): scenes import this package, and a batch imports scenes.
    if name not in __all__:
        raise AttributeError(f"module `tightloop.mujoco` has no attribute `{name}`")
    return getattr(import_module("tightloop.mujoco.batch"), name)
