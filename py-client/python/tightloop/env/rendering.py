"""Render modes of environments: pictures as arrays, or a page in the browser."""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tightloop.env.task import Task
from tightloop.errors import ArgumentError, CommandRefused

if TYPE_CHECKING:
    from tightloop.sim.sim import Sim
    from tightloop.sim.viewer_process import Viewer
    from tightloop.view.picture import Picture

#: Gymnasium's render modes: a page in the browser, and pictures.
MODES = ("human", "rgb_array")
#: Frame fields for pictures, besides those that the task reads.
FIELDS = ("body_q",)
# Size of pictures [pixels], enough for a film of a policy.
_SIZE = (480, 360)
_GOAL = (40, 190, 90)


def check(mode: str | None) -> str | None:
    """Check a render mode."""
    if mode is not None and mode not in MODES:
        raise ArgumentError(f"render_mode is {mode!r}; give one of {', '.join(map(repr, MODES))}, or None")
    return mode


def marks(task: Task, goal: NDArray[Any]) -> dict[str, Any] | None:
    """Return goals for `Picture.render`; None if the task's goals have no position."""
    return None if task.goal_radius is None else {"goal": (goal[:, :3], task.goal_radius, _GOAL)}


class Rendering:
    """Shows the worlds of an environment.

    Attributes:
        viewer: The page of the mode ``"human"``, else None.

    Args:
        sim: The simulation.
        task: The task; goals with a position are marked.
        mode: One of `MODES`.

    Raises:
        ArgumentError: The frames of a joined daemon carry no ``body_q``.
        MissingLibrary: The extra ``view`` is not installed.
    """

    def __init__(self, sim: Sim, task: Task, mode: str) -> None:
        self._sim, self._task, self._mode = sim, task, mode
        self._picture: Picture | None = None
        self._due = 0.0
        self.viewer: Viewer | None = None
        if mode == "human":
            self.viewer = sim.view(worlds=min(sim.worlds, 1024))
            print(f"tightloop: {sim.name} is shown at {self.viewer.url}", file=sys.stderr, flush=True)
        elif "body_q" not in sim.fields:
            cure = "start it with `python -m tightloop.env serve … --render`"
            raise ArgumentError(f"render_mode is {mode!r}, and frames of daemon `{sim.name}` carry no body_q; {cure}")

    def pace(self, seconds: float) -> None:
        """In the mode ``"human"``, wait until a step has taken its simulated time [s]."""
        if self._mode == "human":
            now = time.monotonic()
            time.sleep(max(self._due - now, 0.0))
            self._due = max(self._due, now) + seconds

    def plot(self, times: NDArray[Any], values: Mapping[str, NDArray[Any]]) -> None:
        """In the mode ``"human"``, plot values of the followed world.

        Args:
            times: Time of each world since its reset [s], shape ``(worlds,)``.
            values: Arrays by name, each of that shape.
        """
        if self.viewer is None:
            return
        world = min(self.viewer.world, len(times) - 1)
        # a world that has just begun an episode got nothing yet
        if times[world] > 0.0:
            self.viewer.plot(world, times[world], {name: value[world] for name, value in values.items()})

    def render(self, frame: Any, goal: NDArray[Any]) -> tuple[NDArray[np.uint8], ...] | None:
        """Render a picture of each world; None in the mode ``"human"``, whose page updates itself.

        Raises:
            CommandRefused: No episode has begun.
        """
        if self._mode == "human":
            return None
        if frame is None:
            raise CommandRefused("render: no episode has begun; call reset first")
        picture = self._pictures()
        goals = marks(self._task, goal)
        worlds = range(self._sim.worlds)
        return tuple(picture.render(frame, worlds=[world], world=world, goals=goals) for world in worlds)

    def _pictures(self) -> Picture:
        if self._picture is None:
            from tightloop.view.parts import parts
            from tightloop.view.picture import Picture

            info = self._sim.info
            self._picture = Picture(parts(info["scene"], info["scene_folder"], info["body_names"]), *_SIZE)
        return self._picture
