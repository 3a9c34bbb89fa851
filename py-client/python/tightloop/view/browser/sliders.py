"""A slider for each driven joint, which shows and sets the followed world's target."""

from __future__ import annotations

import time
from typing import Any

import viser
from numpy.typing import NDArray

from tightloop.view.browser.display_options import DisplayOptions
from tightloop.view.browser.joints import Joint
from tightloop.view.browser.live_driver import LiveDriver

# Number of steps of a slider over its range.
_STEPS = 1000
# A moved slider keeps its position for this time, until frames show the new target [s].
_HELD_SECONDS = 1.0


class Sliders:
    """Sliders of joint targets.

    Args:
        gui: GUI that holds the sliders.
        driven: The driven joints.
        driver: Driver that sets their targets.
        options: Display options, which name the followed world.
        worlds: Number of visible worlds.
    """

    def __init__(
        self, gui: viser.GuiApi, driven: list[Joint], driver: LiveDriver, options: DisplayOptions, worlds: int
    ) -> None:
        self._driven = driven
        self._moved_at = dict.fromkeys((joint.dof for joint in driven), 0.0)
        # values that `update` has seen or written: another value is a user's, whose event may still be on its way
        self._known: dict[int, float] = {}
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
            self._known[joint.dof] = handle.value

            @handle.on_update
            def _(event: Any, joint: Joint = joint, handle: Any = handle) -> None:
                # values that `update` writes are not from a user
                if event.client is not None:
                    self._moved_at[joint.dof] = time.monotonic()
                    driver.set_target(joint.dof, handle.value, options.world, everywhere=everywhere.value)

    def update(self, targets: NDArray[Any], *, disabled: bool) -> None:
        """Show the followed world's targets, shape ``(dofs,)``; ``disabled`` while another client is in control."""
        now = time.monotonic()
        for joint, handle in zip(self._driven, self._handles, strict=True):
            handle.disabled = disabled
            value = min(max(float(targets[joint.dof]), joint.lower), joint.upper)
            if handle.value != self._known[joint.dof]:
                self._known[joint.dof] = handle.value
                self._moved_at[joint.dof] = now
            held = now - self._moved_at[joint.dof] < _HELD_SECONDS
            if not held and abs(value - handle.value) > (joint.upper - joint.lower) / _STEPS:
                handle.value = self._known[joint.dof] = value
