"""State of a model that clients cannot write: controls on their way, and rests of springs that yield."""

from __future__ import annotations

from typing import Any

import numpy as np

from tightloop.errors import ArgumentError


def refuse_hidden_state(model: Any, who: str) -> None:
    """Refuse a model with delayed actuators or plastic springs.

    Args:
        model: The model.
        who: What cannot run it.

    Raises:
        ArgumentError: An actuator has a delay, or a spring yields; the message has its name.
    """
    # older versions of MuJoCo have no delays
    delays, history = getattr(model, "actuator_delay", None), getattr(model, "actuator_history", None)
    if delays is not None and history is not None:
        late = np.flatnonzero((delays != 0.0) & (history[:, 0] > 0))
        if late.size:
            name = model.actuator(int(late[0])).name or f"actuator{late[0]}"
            raise ArgumentError(f"{who}: no support for the delay of actuator `{name}`; set its actuator_delay to 0")
    # and no plastic springs
    for kind, array in (("joint", "jnt_plasticadr"), ("tendon", "tendon_plasticadr")):
        plastic = np.flatnonzero(getattr(model, array, np.empty(0)) >= 0)
        if plastic.size:
            name = getattr(model, kind)(int(plastic[0])).name or f"{kind}{plastic[0]}"
            cure = "compile the model without its springyield"
            raise ArgumentError(f"{who}: no support for the plastic spring of {kind} `{name}`; {cure}")
