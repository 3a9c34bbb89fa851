"""A slider for each joint with a drive: it shows the followed world's target, and sets it when it is moved."""

from __future__ import annotations

import time
from typing import Any

import viser
from numpy.typing import NDArray

from tightloop.view.display_options import Looks
from tightloop.view.joints import Joint
from tightloop.view.pilot import Pilot

# Steps of a slider over its range.
_STEPS = 1000
# So long a slider stays where a hand put it, until the simulation shows that target [s].
_HELD_SECONDS = 1.0


class Sliders:
    """Sliders of joint targets.

    Args:
        gui: Where they are.
        driven: The joints.
        driver: Who sets their targets.
        looks: Which world is followed.
        worlds: How many worlds can be seen.
    """

    def __init__(self, gui: viser.GuiApi, driven: list[Joint], driver: Pilot, looks: Looks, worlds: int) -> None:
        self._driven = driven
        self._moved_at = dict.fromkeys((joint.dof for joint in driven), 0.0)
        self._handles: list[viser.GuiSliderHandle[float]] = []
        if not driven:
            gui.add_markdown("No joint has a drive: `joint_target_ke` is 0 in all of them.")
            return
        everywhere = gui.add_checkbox("In all worlds", worlds > 1, visible=worlds > 1)
        robots = {joint.name.partition("/")[0] for joint in driven}
        for joint in driven:
            handle = gui.add_slider(
                joint.name if len(robots) > 1 else joint.name.partition("/")[2],
                joint.lower,
                joint.upper,
                (joint.upper - joint.lower) / _STEPS,
                joint.lower,
            )
            self._handles.append(handle)

            @handle.on_update
            def _(event: Any, joint: Joint = joint, handle: Any = handle) -> None:
                # what `tell` writes is no wish of a hand
                if event.client is not None:
                    self._moved_at[joint.dof] = time.monotonic()
                    driver.set_target(joint.dof, handle.value, looks.world, everywhere=everywhere.value)

    def tell(self, targets: NDArray[Any], *, disabled: bool) -> None:
        """Show the followed world's targets, shape ``(dofs,)``; ``disabled`` while another is in control."""
        now = time.monotonic()
        for joint, handle in zip(self._driven, self._handles, strict=True):
            handle.disabled = disabled
            value = min(max(float(targets[joint.dof]), joint.lower), joint.upper)
            held = now - self._moved_at[joint.dof] < _HELD_SECONDS
            if not held and abs(value - handle.value) > (joint.upper - joint.lower) / _STEPS:
                handle.value = value
