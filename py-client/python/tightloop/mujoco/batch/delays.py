"""Actuators whose controls act late: their controls on the way are no part of the state that clients write."""

from __future__ import annotations

from typing import Any

import numpy as np

from tightloop.errors import ArgumentError


def refuse_delays(model: Any, who: str) -> None:
    """Refuse a model with delayed actuators.

    Args:
        model: The model.
        who: What cannot run it.

    Raises:
        ArgumentError: An actuator has a delay; the message has its name.
    """
    # older versions of MuJoCo have no delays
    delays, history = getattr(model, "actuator_delay", None), getattr(model, "actuator_history", None)
    if delays is None or history is None:
        return
    late = np.flatnonzero((delays != 0.0) & (history[:, 0] > 0))
    if late.size:
        name = model.actuator(int(late[0])).name or f"actuator{late[0]}"
        raise ArgumentError(f"{who}: no support for the delay of actuator `{name}`; set its actuator_delay to 0")
