"""What mjlab sees as ``sim.data`` and ``sim.model``: tensors over the memory of MuJoCo-Warp's structures."""

from __future__ import annotations

from typing import Any

from tightloop.adapters.environment import library
from tightloop.adapters.mjlab.model_fields import ModelFields
from tightloop.adapters.mjlab.worlds import Worlds

bridges: Any = library("mjlab.sim.sim_data", install="mjlab")


class DataBridge(bridges.WarpBridge):
    """Fields of all worlds as tensors. A field that no simulation of tightloop fills is an AttributeError."""

    def __init__(self, struct: Any, worlds: Worlds) -> None:
        super().__init__(struct)
        object.__setattr__(self, "_worlds", worlds)

    def __getattr__(self, name: str) -> Any:
        if not name.startswith("_"):
            self._worlds.touch(name)
        return super().__getattr__(name)


class ModelBridge(bridges.WarpBridge):
    """Fields of the model as tensors, ``(worlds, ...)``: those that differ between worlds are tightloop's."""

    def __init__(self, struct: Any, worlds: int, fields: ModelFields) -> None:
        super().__init__(struct, nworld=worlds)
        object.__setattr__(self, "_fields", fields)

    def __getattr__(self, name: str) -> Any:
        if not name.startswith("_"):
            own = self._fields.tensor(name)
            if own is not None:
                return own
        return super().__getattr__(name)
