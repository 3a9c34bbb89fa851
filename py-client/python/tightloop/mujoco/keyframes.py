"""Keyframes of MuJoCo models, as the daemon's description lists them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.errors import ArgumentError


def find(known: list[dict[str, Any]], keyframe: str | int) -> dict[str, Any]:
    """Return a keyframe by its name, ``model/name``, or its place.

    Raises:
        ArgumentError: There is no such keyframe, or several models have one of that name.
    """
    names = [state["name"] for state in known]
    there_are = f"there are: {', '.join(names)}" if names else "no model of this scene has any"
    if isinstance(keyframe, str):
        found = [place for place, name in enumerate(names) if keyframe in (name, name.partition("/")[2])]
        if len(found) > 1:
            several = ", ".join(names[place] for place in found)
            raise ArgumentError(f"keyframe {keyframe!r} is one of several models: give one of {several}")
    elif isinstance(keyframe, int | np.integer) and not isinstance(keyframe, bool):
        found = [int(keyframe)] if 0 <= keyframe < len(known) else []
    else:
        raise ArgumentError(f"keyframe is {keyframe!r}; give a name or a place")
    if not found:
        raise ArgumentError(f"there is no keyframe {keyframe!r}; {there_are}")
    return known[found[0]]


def check_alone(joint_q: Any, joint_qd: Any) -> None:
    """Check that a keyframe is all that a reset sets.

    Raises:
        ArgumentError: There are positions or velocities, too.
    """
    if joint_q is not None or joint_qd is not None:
        raise ArgumentError("reset: joint_q and joint_qd beside a keyframe; leave them out, or write them after it")


def arrays(state: dict[str, Any]) -> dict[str, NDArray[np.float64]]:
    """Return what `Sim.write` takes, the same for all worlds; arrays without entries are left out."""
    found = {name: np.array(value, np.float64) for name, value in state.items() if name != "name"}
    return {name: value for name, value in found.items() if value.size}
