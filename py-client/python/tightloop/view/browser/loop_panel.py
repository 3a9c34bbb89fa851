"""Controls of a page for the loop that steps its worlds: which policy acts, and a chart of rewards."""

from __future__ import annotations

import viser

from tightloop.view.browser.loop_link import LoopLink
from tightloop.view.browser.plots import Chart


class LoopPanel:
    """A choice, and a chart of the values that the loop sends of the followed world.

    Both come with the first message that has them.

    Args:
        gui: GUI that holds them.
        link: What the loop says.
    """

    def __init__(self, gui: viser.GuiApi, link: LoopLink) -> None:
        self._gui, self._link = gui, link
        self._folder = gui.add_folder("Policy and reward", expand_by_default=True)
        self._folder.visible = False
        self._choice: viser.GuiDropdownHandle[str] | None = None
        self._offered: list[str] = []
        self._chart: Chart | None = None
        self._names: list[str] = []

    def update(self, world: int) -> None:
        """Show what came since the last call, of a world."""
        self._link.follow(world)
        if self._link.choices != self._offered:
            self._offer(self._link.choices)
        for step in self._link.take():
            if [*step.values] != self._names or self._chart is None:
                self._chart = self._new_chart([*step.values])
            self._chart.add(step.time, [*step.values.values()])
        if self._chart is not None:
            self._chart.draw()

    def clear(self) -> None:
        """Drop what the chart has, for example when another world is followed."""
        if self._chart is not None:
            self._chart.clear()

    def hide(self) -> None:
        """Hide the folder."""
        self._folder.visible = False

    def _offer(self, choices: list[str]) -> None:
        if self._choice is not None:
            self._choice.remove()
        self._folder.visible, self._offered = True, choices
        with self._folder:
            choice = self._choice = self._gui.add_dropdown("Policy", tuple(choices))
        choice.on_update(lambda _: self._link.choose(choice.value))

    def _new_chart(self, names: list[str]) -> Chart:
        if self._chart is not None:
            self._chart.remove()
        self._folder.visible, self._names = True, names
        with self._folder:
            return Chart(self._gui, "Reward of the followed world", names)
