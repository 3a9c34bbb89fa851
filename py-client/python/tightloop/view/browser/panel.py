"""The page's controls: time, display, joint targets, drag forces, images of cameras and plots.

They change `DisplayOptions` and send requests to the driver.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
import viser

from tightloop.arrays.frames import FAULTED
from tightloop.view.browser.camera_image import CameraImage, image_fields
from tightloop.view.browser.display_options import DisplayOptions
from tightloop.view.browser.frame_stream import FrameStream
from tightloop.view.browser.joints import Joint
from tightloop.view.browser.live_driver import LiveDriver
from tightloop.view.browser.loop_link import LoopLink
from tightloop.view.browser.loop_panel import LoopPanel
from tightloop.view.browser.player import Player
from tightloop.view.browser.plots import PLOTS_MAX, Plot, choices
from tightloop.view.browser.sliders import Sliders
from tightloop.view.cameras import PRESETS

SPEEDS = {"0.1×": 0.1, "0.25×": 0.25, "0.5×": 0.5, "1×": 1.0, "2×": 2.0, "5×": 5.0, "max": float("inf")}
_STATUS = {1: "not finite, frozen", 2: "solver out of iterations", 4: "contacts left out", 8: "out of bounds, frozen"}
# Period of updates of text and plots [s].
_PERIOD = 0.1
_RATE_SECONDS = 2.0
# With more joints than this, the folder of sliders starts closed.
_OPEN_JOINTS = 12


class Panel:
    """The controls of a page.

    Args:
        server: Server of the page.
        stream: The frames and their driver.
        options: Display options, which the controls write.
        driven: Joints that get sliders.
        aim: Called with the name of a chosen camera preset.
        notes: What users should know about the scene's options.
        preset: Camera preset at the start.
        link: What the loop that steps the worlds says; None if it says nothing.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        stream: FrameStream,
        options: DisplayOptions,
        *,
        driven: list[Joint],
        aim: Callable[[str], None],
        notes: list[str],
        preset: str = "three-quarter",
        link: LoopLink | None = None,
    ) -> None:
        self._gui = server.gui
        self._info = info = stream.info
        self._worlds = worlds = stream.worlds
        self._options = options
        self._driver = driver = stream.driver
        self._plots: list[Plot] = []
        self._shown_at: deque[float] = deque(maxlen=400)
        self._updated_at = 0.0
        self.strength = 1.0
        self._gui.set_panel_label(f"tightloop · {info['name']}")
        self._text = self._gui.add_markdown("")
        self._folders: list[viser.GuiFolderHandle] = []
        self._loop = None if link is None else LoopPanel(self._gui, link)
        with self._folder("Time"):
            self._add_time()
        with self._folder("Look"):
            self._add_display(aim, preset)
        self._sliders = None
        if isinstance(driver, LiveDriver):
            with self._folder("Joint targets", expanded=0 < len(driven) <= _OPEN_JOINTS):
                self._sliders = Sliders(self._gui, driven, driver, options, worlds)
            with self._folder("Push", expanded=False):
                self._add_push(driver)
        self._image = None
        if images := image_fields(info):
            with self._folder("Cameras", expanded=False):
                self._image = CameraImage(self._gui, images)
        with self._folder("Plots", expanded=False):
            self._add_plots()
        if notes:
            with self._folder("Notes", expanded=False):
                self._gui.add_markdown("\n".join(f"- {note}" for note in notes))

    @property
    def fields(self) -> set[str]:
        """Fields that plots and the image show."""
        image = None if self._image is None else self._image.field
        return {plot.field for plot in self._plots} | ({image} if image else set())

    def update(self, shown: Any, *, new: bool) -> None:
        """Update text, sliders and plots.

        Args:
            shown: Frame on the page.
            new: Whether the page shows it for the first time.
        """
        now = time.monotonic()
        world = self._options.world
        if new:
            self._shown_at.append(now)
            for plot in self._plots:
                # a field chosen after this frame was requested arrives with the next one
                if not hasattr(shown, plot.field):
                    continue
                plot.add(float(shown.time[world]), np.asarray(getattr(shown, plot.field)[world]))
        if now - self._updated_at < _PERIOD:
            return
        self._updated_at = now
        taken = self._driver.controller
        self._text.content = self._text_of(shown, taken, now)
        self._play.label = "Pause" if self._driver.playing else "Play"
        for control in self._of_driver:
            control.disabled = taken is not None
        if self._sliders is not None:
            self._sliders.update(np.asarray(shown.joint_target_q)[world], disabled=taken is not None)
        for plot in self._plots:
            plot.draw()
        if self._image is not None:
            self._image.show(shown, world)
        if self._loop is not None:
            self._loop.update(world)

    def drop_image(self) -> None:
        """Show no image of a camera."""
        if self._image is not None:
            self._image.drop()

    def hide(self) -> None:
        """Hide the controls; a browser that is slow may still get updates of those that are removed."""
        for part in (self._text, *self._folders):
            part.visible = False
        if self._loop is not None:
            self._loop.hide()

    def follow(self, world: int) -> None:
        """Follow another world, for example after a click on it."""
        self._world.value = world

    def _folder(self, name: str, *, expanded: bool = True) -> viser.GuiFolderHandle:
        self._folders.append(self._gui.add_folder(name, expand_by_default=expanded))
        return self._folders[-1]

    def _text_of(self, shown: Any, taken: int | None, now: float) -> str:
        world, driver = self._options.world, self._driver
        rate = sum(now - at < _RATE_SECONDS for at in self._shown_at) / _RATE_SECONDS
        bits = int(shown.status[world])
        trouble = ", ".join(text for bit, text in _STATUS.items() if bits & bit)
        frozen = int(np.count_nonzero(np.asarray(shown.status) & FAULTED))
        if taken is not None:
            who = f"process **{taken}** is in control; you watch"
        elif not driver.live:
            who = "recording, playing" if driver.playing else "recording, paused"
        else:
            who = f"you drive, {driver.pace:.2g}× real time" if driver.playing else "paused; nobody drives"
        lines = [
            f"**world {world}** of {self._info['worlds']} · {shown.time[world]:.3f} s · step {int(shown.step[world])}",
            f"{who} · {rate:.0f} frames/s shown",
            f"{self._info['device']}",
        ]
        if trouble:
            lines.append(f"world {world}: **{trouble}**")
        if frozen:
            lines.append(f"{frozen} of the worlds shown are frozen (red); reset frees them")
        if driver.problem:
            lines.append(f"⚠ {driver.problem}")
        return "  \n".join(lines)

    def _add_time(self) -> None:
        driver = self._driver
        self._play = self._gui.add_button("Play", color="green")
        step = self._gui.add_button("Step")
        reset = self._gui.add_button("Reset all" if driver.live else "Restart")
        speed = self._gui.add_dropdown("Speed", tuple(SPEEDS), initial_value="1×")
        self._of_driver: list[Any] = [self._play, step, reset]
        self._play.on_click(lambda _: driver.pause() if driver.playing else driver.play())
        step.on_click(lambda _: driver.step())
        reset.on_click(lambda _: driver.reset(None))
        speed.on_update(lambda _: setattr(driver, "speed", SPEEDS[speed.value]))
        if isinstance(driver, Player):
            skip = self._gui.add_button_group("Skip", ("+1 s", "+10 s"))
            skip.on_click(lambda _: driver.skip(float(skip.value[1:].split()[0])))
        elif self._worlds > 1:
            one = self._gui.add_button("Reset this world")
            self._of_driver.append(one)
            one.on_click(lambda _: driver.reset(self._options.world))

    def _add_display(self, aim: Callable[[str], None], preset: str) -> None:
        gui, options = self._gui, self._options
        camera = gui.add_dropdown("Camera", tuple(PRESETS), initial_value=preset)

        def choose_camera(_: Any) -> None:
            options.choose(follow=camera.value == "follow")
            aim(camera.value)

        camera.on_update(choose_camera)
        world = self._world = gui.add_slider(
            "World", 0, max(self._worlds - 1, 1), 1, options.world, visible=self._worlds > 1
        )
        alone = gui.add_checkbox("This world alone", options.alone, visible=self._worlds > 1)
        shapes = gui.add_checkbox("Collision shapes", options.kind == "collision")
        ghosts = gui.add_checkbox("Targets as ghosts", options.ghosts)
        frames = gui.add_checkbox("Body frames", options.frames)
        where = ("off", "followed world") + (("all worlds",) if self._worlds > 1 else ())
        contacts = gui.add_dropdown("Contacts", where, initial_value=options.contacts)
        scale = gui.add_number("Arrow length [m/N]", options.force_scale, min=1e-4, max=1.0, step=1e-3)

        def choose_world(_: Any) -> None:
            options.choose(world=min(world.value, self._worlds - 1))
            for plot in (*self._plots, *([] if self._loop is None else [self._loop])):
                plot.clear()

        world.on_update(choose_world)
        alone.on_update(lambda _: options.choose(alone=alone.value))
        shapes.on_update(lambda _: options.choose(kind="collision" if shapes.value else "visual"))
        ghosts.on_update(lambda _: options.choose(ghosts=ghosts.value))
        frames.on_update(lambda _: options.choose(frames=frames.value))
        contacts.on_update(lambda _: options.choose(contacts=contacts.value))
        scale.on_update(lambda _: options.choose(force_scale=scale.value))

    def _add_push(self, driver: LiveDriver) -> None:
        if not driver.can_push:
            self._gui.add_markdown('To push bodies, launch with `params=("body_f",)`.')
            return
        self._gui.add_markdown("Hold **Shift** and drag a body: a spring pulls it to the pointer.")
        strength = self._gui.add_slider("Strength", 0.5, 20.0, 0.5, self.strength)
        strength.on_update(lambda _: setattr(self, "strength", strength.value))

    def _add_plots(self) -> None:
        known = choices(self._info)
        field = self._gui.add_dropdown("Field", tuple(known), initial_value=next(iter(known)))
        column = self._gui.add_dropdown("Of", tuple(known[field.value]))
        add, clear = self._gui.add_button("Add plot"), self._gui.add_button("Remove plots")
        drawn = self._gui.add_folder("Last 10 s of the followed world")

        @field.on_update
        def _(_: Any) -> None:
            column.options = tuple(known[field.value])

        @add.on_click
        def _(_: Any) -> None:
            if len(self._plots) < PLOTS_MAX:
                with drawn:
                    self._plots.append(Plot(self._gui, self._info, field.value, column.value))

        @clear.on_click
        def _(_: Any) -> None:
            plots, self._plots = self._plots, []
            for plot in plots:
                plot.remove()
