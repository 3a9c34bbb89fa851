"""The state of a simulation as one row of numbers, in the order of MuJoCo's ``mjSTATE_INTEGRATION``."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.mujoco.batch.hidden_state import refuse_hidden_state
from tightloop.mujoco.batch.library import mujoco

Array = NDArray[np.float64]

#: Fields of ``MjData`` in the order of a row, each with its member of ``mjtState``.
_COMPONENTS = (
    ("time", "mjSTATE_TIME"),
    ("qpos", "mjSTATE_QPOS"),
    ("qvel", "mjSTATE_QVEL"),
    ("act", "mjSTATE_ACT"),
    ("history", "mjSTATE_HISTORY"),
    ("qacc_warmstart", "mjSTATE_WARMSTART"),
    ("ctrl", "mjSTATE_CTRL"),
    ("qfrc_applied", "mjSTATE_QFRC_APPLIED"),
    ("xfrc_applied", "mjSTATE_XFRC_APPLIED"),
    ("eq_active", "mjSTATE_EQ_ACTIVE"),
    ("mocap_pos", "mjSTATE_MOCAP_POS"),
    ("mocap_quat", "mjSTATE_MOCAP_QUAT"),
    ("userdata", "mjSTATE_USERDATA"),
    ("plugin_state", "mjSTATE_PLUGIN"),
    ("plastic", "mjSTATE_PLASTIC"),
)
_INTEGRATION = mujoco.mjtState.mjSTATE_INTEGRATION


class StateLayout:
    """Where each component of the state lies in a row.

    Args:
        model: The model.

    Attributes:
        size: Numbers in a row.

    Raises:
        ArgumentError: An actuator has a delay, or a spring is plastic.
    """

    def __init__(self, model: Any) -> None:
        refuse_hidden_state(model, "Batch")
        self._model = model
        data = mujoco.MjData(model)
        self._starts: dict[int, Array] = {}
        self._slices: dict[str, slice] = {}
        self._shapes: dict[str, tuple[int, ...]] = {}
        first = 0
        for name, flag in _COMPONENTS:
            # older versions of MuJoCo have no plastic springs
            kind = getattr(mujoco.mjtState, flag, None)
            size = 0 if kind is None else mujoco.mj_stateSize(model, kind)
            self._slices[name] = slice(first, first + size)
            self._shapes[name] = np.shape(getattr(data, name, np.empty(0)))
            first += size
        self.size: int = mujoco.mj_stateSize(model, _INTEGRATION)
        if first != self.size:
            raise ValueError(f"the state of this version of MuJoCo has {self.size - first} numbers more than are known")

    def __contains__(self, name: str) -> bool:
        return name in self._slices

    def at(self, name: str) -> slice:
        """Columns of a component."""
        return self._slices[name]

    def view(self, rows: Array, name: str) -> Array:
        """View a component of rows ``(n, size)`` in its own shape, ``(n, ...)``."""
        view = rows[:, self._slices[name]].reshape(len(rows), *self._shapes[name])
        assert view.size == 0 or np.shares_memory(view, rows)
        return view

    def start(self, keyframe: int) -> Array:
        """Return the row after a reset, ``(size,)``: of a keyframe, or of the model for -1."""
        if keyframe in self._starts:
            return self._starts[keyframe]
        data = mujoco.MjData(self._model)
        if keyframe >= 0:
            mujoco.mj_resetDataKeyframe(self._model, data, keyframe)
        row = self._starts[keyframe] = np.empty(self.size)
        mujoco.mj_getState(self._model, data, row, _INTEGRATION)
        row.flags.writeable = False
        return row

    def load(self, data: Any, row: Array) -> None:
        """Put a row into an ``MjData``."""
        mujoco.mj_setState(self._model, data, row, _INTEGRATION)
