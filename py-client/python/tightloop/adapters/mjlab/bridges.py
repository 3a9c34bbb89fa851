"""What mjlab sees as ``sim.data`` and ``sim.model``: tensors over the memory of MuJoCo-Warp's structures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from tightloop.adapters.environment import library
from tightloop.adapters.mjlab.model_fields import ModelFields
from tightloop.adapters.mjlab.worlds import Worlds
from tightloop.errors import ArgumentError
from tightloop.mujoco.batch.expansions import can_vary

bridges: Any = library("mjlab.sim.sim_data", install="mjlab")
torch: Any = library("torch", install="torch")


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
    """Fields of the model as tensors, ``(worlds, ...)``: those that differ between worlds are tightloop's.

    The others, and the options, have the values at the start in all worlds. Those that were read are noted, since only
    these can have been written.
    """

    def __init__(self, struct: Any, worlds: int, fields: ModelFields) -> None:
        super().__init__(struct, nworld=worlds)
        object.__setattr__(self, "_fields", fields)
        object.__setattr__(self, "_noted", {})
        object.__setattr__(self, "_opt", OptionBridge(struct.opt, worlds, self._noted))

    def __getattr__(self, name: str) -> Any:
        if name == "opt":
            return self._opt
        if not name.startswith("_"):
            own = self._fields.tensor(name)
            if own is not None:
                return own
        # a tensor of inference would not count its writes
        with torch.inference_mode(False):
            value = super().__getattr__(name)
        if self._fields.acts(name):
            _note(self._noted, name, value)
        return value

    def check(self) -> None:
        """Look for writes that do not reach the worlds.

        Raises:
            ArgumentError: A field was written that has one value for all worlds.
        """
        for (name, _), note in self._noted.items():
            if note.tensor._version == note.writes:
                continue
            if not torch.equal(_rows(note.tensor), note.start):
                cure = "set it in the config of the environment instead"
                if self._fields.tensor(name) is not None:
                    cure = f"read sim.model.{name} again, which was expanded since"
                elif can_vary(name):
                    cure = f'call sim.expand_model_fields(("{name}",)) before you write it'
                raise ArgumentError(f"sim.model.{name} was written, but tightloop read it at the start alone; {cure}")
            note.writes = note.tensor._version


class OptionBridge(bridges.WarpBridge):
    """Options of the model as tensors, noted by `ModelBridge`."""

    def __init__(self, struct: Any, worlds: int, noted: dict[tuple[str, int], Note]) -> None:
        super().__init__(struct, nworld=worlds)
        object.__setattr__(self, "_noted", noted)

    def __getattr__(self, name: str) -> Any:
        with torch.inference_mode(False):
            value = super().__getattr__(name)
        _note(self._noted, f"opt.{name}", value)
        return value


@dataclass
class Note:
    """A tensor of the model that was read.

    Attributes:
        tensor: The tensor.
        writes: How often it was written when it was compared last, as torch counts.
        start: Its values at the start, one row if all worlds share it.
    """

    tensor: Any
    writes: int
    start: Any


def _note(noted: dict[tuple[str, int], Note], name: str, value: Any) -> None:
    """Note what was read, if it is a tensor that is new: a cleared cache makes others of the same memory."""
    if isinstance(value, bridges.TorchArray) and (name, id(value._tensor)) not in noted:
        tensor = value._tensor
        before = [note.start for (other, _), note in noted.items() if other == name]
        start = before[0] if before else _rows(tensor).clone()
        noted[name, id(tensor)] = Note(tensor, tensor._version, start)


def _rows(tensor: Any) -> Any:
    """The rows of a tensor that are apart in memory."""
    return tensor[:1] if tensor.ndim and tensor.stride(0) == 0 else tensor
