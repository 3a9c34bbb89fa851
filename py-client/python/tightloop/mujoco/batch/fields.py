"""Which fields of ``MjData`` a batch offers, and where each comes from."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np

from tightloop.errors import ArgumentError
from tightloop.mujoco.batch.layout import StateLayout
from tightloop.mujoco.batch.library import mujoco

#: Fields that depend on controls and forces, not on positions and velocities alone.
_ACCELERATION = frozenset(
    """qacc qacc_smooth actuator_force qfrc_actuator qfrc_constraint qfrc_smooth qfrc_inverse cacc cfrc_int cfrc_ext
    act_dot""".split()
)
#: Fields of ``MjData`` whose names tightloop uses for other arrays.
_OTHERS = ("efc_", "contact", "island", "history")
#: Fields of ``MjData`` whose sizes change from step to step, so that they are empty in new data.
_RESIZED = ("efc_", "iefc_", "island", "map_", "iacc", "ifrc_", "contact")


class Fields:
    """The fields of ``MjData`` of a model.

    Args:
        model: The model.
        layout: Its state.
    """

    def __init__(self, model: Any, layout: StateLayout) -> None:
        self._model, self._layout = model, layout
        self._data = mujoco.MjData(model)
        stages = np.asarray(model.sensor_needstage)
        self._sensors_accelerate = bool((stages == mujoco.mjtStage.mjSTAGE_ACC).any())

    def __contains__(self, name: str) -> bool:
        """Whether ``MjData`` has an array of this name."""
        if name in ("time", "warning"):
            return True
        return not name.startswith("_") and isinstance(getattr(self._data, name, None), np.ndarray)

    def shape(self, name: str) -> tuple[int, ...]:
        """Shape of a field of one simulation."""
        if name == "warning":
            return (int(mujoco.mjtWarning.mjNWARNING), 2)
        return np.shape(getattr(self._data, name))

    def dtype(self, name: str) -> np.dtype[Any]:
        """Its own dtype."""
        if name == "warning":
            return np.dtype(np.int32)
        return np.dtype(np.float64) if name == "time" else getattr(self._data, name).dtype

    def is_state(self, name: str) -> bool:
        """Whether a row of the state holds the field, so that it can be written."""
        return name in self._layout or name == "warning"

    def is_empty(self, name: str) -> bool:
        """Whether a field has no elements in any state, as the model has none of its kind."""
        return 0 in self.shape(name) and not name.startswith(_RESIZED)

    def check(self, name: str, known: Collection[str]) -> None:
        """Check that simulations have a field.

        Args:
            name: A field of ``MjData`` that is not part of the state.
            known: Fields that simulations of this release have.

        Raises:
            ArgumentError: tightloop does not compute the field.
        """
        if name in known and not name.startswith(_OTHERS):
            return
        offered = sorted(field for field in known if field in self and not self.is_state(field))
        offered = [field for field in offered if field != "time" and not field.startswith(_OTHERS)]
        raise ArgumentError(
            f"{name}: tightloop does not compute this field; bind one of {', '.join(offered)}, or a part of the state, "
            "or copy a row of the state into an MjData with mj_setState and call mj_forward"
        )

    def accelerates(self, name: str) -> bool:
        """Whether a field depends on controls and forces."""
        return name in _ACCELERATION or (name == "sensordata" and self._sensors_accelerate)
