"""Fields of the model that differ between worlds, and the parameters of a simulation that they become."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.adapters.environment import library
from tightloop.mujoco.batch.constants import set_const
from tightloop.mujoco.batch.expansions import CONSTANTS, Expansions, is_idle
from tightloop.mujoco.batch.shapes import geoms_of_shapes

torch: Any = library("torch", install="torch")

Array = NDArray[Any]


class ModelFields:
    """Arrays ``(worlds, ...)`` of model fields, in single precision as mjlab has them.

    Args:
        model: The model.
        worlds: Number of worlds.
    """

    def __init__(self, model: Any, worlds: int) -> None:
        self._model, self._ids = model, np.arange(worlds)
        self._expansions = Expansions(model, worlds, "remove the event that writes it")
        self._tensors: dict[str, Any] = {}
        # what the parameters were made of last: counts of the writes to each tensor
        self._versions: tuple[int, ...] = ()
        self._values: dict[str, Array] = {}
        # what the constants were computed from last
        self._sources: dict[str, Array] = {}
        self._recomputed = 0

    def acts(self, name: str) -> bool:
        """Whether a field may change the motion, so that it is ours and not MuJoCo-Warp's."""
        return name in self._expansions and not is_idle(name)

    def expand(self, name: str) -> None:
        """Give a field a value per world; see `Expansions.get`. One that has some keeps them."""
        if name in self._tensors:
            return
        values = self._expansions.of(name)
        # constants that were computed for each world have their type already
        is_new = name not in self._expansions.names
        dtype = np.float32 if is_new and values.dtype == np.float64 else values.dtype
        # a tensor of inference would not count its writes
        with torch.inference_mode(False):
            self._tensors[name] = torch.from_numpy(self._expansions.get(name, dtype))

    def tensor(self, name: str) -> Any:
        """Return a field that was expanded, ``(worlds, ...)``, else None. Of constants it is a copy."""
        if name in CONSTANTS and name not in self._tensors and name in self._expansions.names:
            return torch.from_numpy(self._expansions.of(name).astype(np.float32))
        return self._tensors.get(name)

    def params(self) -> tuple[str, ...]:
        """Return the parameters that must vary for what is expanded."""
        return self._expansions.params()

    def values(self, shape_names: list[str]) -> dict[str, Array]:
        """Return the parameters of all worlds, ``(worlds, ...)``; see `Expansions.values`.

        It is the same dict as long as nothing was written, which torch counts.

        Args:
            shape_names: Names of the shapes of the simulation.
        """
        versions = (len(self._expansions.names), self._recomputed, *(t._version for t in self._tensors.values()))
        if versions == self._versions:
            return self._values
        shapes = geoms_of_shapes(self._model, shape_names) if self._expansions.needs_shapes else []
        self._values = self._expansions.values(shapes, self._ids)
        self._versions = versions
        return self._values

    def references(self) -> Array | None:
        """Return ``qpos0`` of each world, ``(worlds, nq)``, if it was expanded: where a reset puts them."""
        return self._expansions.of("qpos0") if "qpos0" in self._expansions.names else None

    def recompute(self) -> None:
        """Run ``mj_setConst`` for the worlds whose fields have changed since the last time."""
        changed = np.zeros(len(self._ids), bool)
        for name in self._tensors:
            array = self._expansions.of(name).reshape(len(self._ids), -1)
            before = self._sources.get(name)
            if before is None:
                before = np.broadcast_to(np.ravel(getattr(self._model, name, array[0])), array.shape)
            changed |= (array != before.astype(array.dtype)).any(axis=1)
            self._sources[name] = array.copy()
        if changed.any():
            self._recomputed += 1
            set_const(self._model, self._expansions, self._ids[changed], len(self._ids))
