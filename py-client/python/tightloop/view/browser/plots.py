"""Plots of chosen fields of the followed world over the last seconds."""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np
import viser
import viser.uplot
from numpy.typing import ArrayLike, NDArray

SECONDS = 10.0
#: Each plot sends its data ten times per second.
PLOTS_MAX = 4
# Rows that each plot keeps: `SECONDS` at 60 Hz.
_ROWS_MAX = 600
# Colours of the series of a chart, in order.
_COLORS = ("#2f7ed8", "#e4572e", "#3aa655", "#a05cc8", "#e0a020", "#1fa5a5", "#c2477f", "#6b7280", "#8a6d3b")
# Names along each axis of a field, as keys of a daemon's description.
_AXES = {
    "dofs": "dof_names",
    "coords": "coord_names",
    "bodies": "body_names",
    "sites": "site_names",
    "contact_sensors": "contact_sensor_names",
}
_PARTS = {"3": "x y z", "4": "x y z w", "6": "x y z rx ry rz", "7": "x y z qx qy qz qw"}
_ALL = "all"


def choices(info: dict[str, Any]) -> dict[str, list[str]]:
    """Return the fields that can be plotted, each with its columns by name and ``"all"``."""
    found = {}
    for field in info["known_fields"]:
        axes = field["axes"].strip("()").replace(" ", "").split(",")[1:]
        axes = [axis for axis in axes if axis]
        if not axes:
            found[field["name"]] = [_ALL]
        elif axes[0] in _AXES and (len(axes) == 1 or (len(axes) == 2 and axes[1] in _PARTS)):
            names = list(info[_AXES[axes[0]]])
            if names:
                found[field["name"]] = names if len(axes) == 2 else [_ALL, *names]
    return found


class Chart:
    """Values over the last seconds.

    Args:
        gui: GUI that holds the chart.
        title: What it shows, as Markdown.
        series: Names of the values.
    """

    def __init__(self, gui: viser.GuiApi, title: str, series: Sequence[str]) -> None:
        self._count = len(series)
        self._rows: deque[tuple[float, NDArray[Any]]] = deque(maxlen=_ROWS_MAX)
        # Markdown in front of the plot: uPlot's own title cannot wrap
        self._title = gui.add_markdown(title)
        self._handle = gui.add_uplot(
            tuple(np.zeros(1) for _ in range(1 + self._count)),
            (
                viser.uplot.Series(label="s"),
                *(
                    viser.uplot.Series(label=name, stroke=color, width=1.5)
                    for name, color in zip(series, itertools.cycle(_COLORS), strict=False)
                ),
            ),
            scales={"x": viser.uplot.Scale(time=False)},
            height=180,
        )

    def add(self, time: float, values: ArrayLike) -> None:
        """Append values at a simulated time [s]; an earlier time than the last begins anew."""
        row = np.atleast_1d(np.asarray(values, np.float64))[: self._count]
        if self._rows and time < self._rows[-1][0]:
            # the world was reset
            self._rows.clear()
        if not self._rows or time > self._rows[-1][0]:
            self._rows.append((time, row))

    def clear(self) -> None:
        """Drop all rows, for example when the followed world changes."""
        self._rows.clear()

    def draw(self) -> None:
        """Send the rows to the page."""
        if not self._rows:
            return
        times = np.array([time for time, _ in self._rows])
        rows = np.array([row for _, row in self._rows])
        kept = times >= times[-1] - SECONDS
        self._handle.data = (times[kept], *np.ascontiguousarray(rows[kept].T))

    def remove(self) -> None:
        self._title.remove()
        self._handle.remove()


class Plot(Chart):
    """One field, or one column of it, of the followed world.

    Args:
        gui: GUI that holds the plot.
        info: The daemon's description of itself.
        field: Name of the field.
        column: One of the field's `choices`.
    """

    def __init__(self, gui: viser.GuiApi, info: dict[str, Any], field: str, column: str) -> None:
        self.field = field
        (entry,) = (entry for entry in info["known_fields"] if entry["name"] == field)
        axes = [axis for axis in entry["axes"].strip("()").replace(" ", "").split(",")[1:] if axis]
        names = list(info[_AXES[axes[0]]]) if axes else [field]
        self._row = slice(None) if column == _ALL else names.index(column)
        series = names if column == _ALL else [column]
        if len(axes) == 2:
            series = _PARTS[axes[1]].split()
        title = field if column in (_ALL, field) else f"{field} of {column}"
        short = [name.rpartition("/")[2] for name in series][: len(_COLORS)]
        super().__init__(gui, f"**{title}** [{entry['unit']}]", short)

    def add(self, time: float, values: NDArray[Any]) -> None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Append a world's values of the field at a simulated time [s]."""
        super().add(time, values[self._row] if values.ndim else values)
