"""One stop after the other: run, told in a line, kept as a picture, shown in the browser."""

from __future__ import annotations

import os
import secrets
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from tightloop.demo.stops import Stop
from tightloop.errors import MissingLibrary

# Size of the pictures [pixels].
_SIZE = (1280, 720)
# Longer in the browser than what a round takes: people look around.
_SECONDS_SEEN = 15.0


@dataclass(frozen=True)
class Plan:
    """How to go through the stops.

    Attributes:
        out: Folder of the pictures.
        seconds: How long to stay at each stop; a round if None, and in the browser some more.
        view: Whether to show it in the browser, in real time.
        port: Port of that page.
        device: Where worlds are kept, as `tightloop.launch` has it.
        threads: Most threads of a step; all cores if None.
    """

    out: Path
    seconds: float | None = None
    view: bool = False
    port: int = 8080
    device: str = "auto"
    threads: int | None = None


def tour(stops: Sequence[Stop], plan: Plan) -> None:
    """Go through the stops.

    Raises:
        TightloopError: A daemon did not start, or ended.
    """
    plan.out.mkdir(parents=True, exist_ok=True)
    # one page follows a daemon by its name, from stop to stop
    name = f"demo-{os.getpid()}-{secrets.token_hex(2)}" if plan.view else None
    with _Page(plan.port) as page:
        for stop in stops:
            stop.open(name, plan.device, plan.threads)
            try:
                if name is not None:
                    page.show(name, stop.worlds)
                print(_visited(stop, plan), flush=True)
            finally:
                stop.close()


def _visited(stop: Stop, plan: Plan) -> str:
    """Stay at a stop; returns what there is to say."""
    seconds = _SECONDS_SEEN if plan.view and plan.seconds is None else plan.seconds
    until = None if seconds is None else time.monotonic() + seconds
    told = None
    while told is None or (until is not None and time.monotonic() < until):
        stop.begin()
        for _ in _paced(stop, until, real_time=plan.view):
            stop.advance()
        # of the first round: a later one may have been cut short
        told = told or _told(stop, plan.out / f"{stop.name}.png")
    return told


def _paced(stop: Stop, until: float | None, *, real_time: bool) -> Iterator[int]:
    """The frames of a round, at least one, as many as there is time for."""
    began = time.monotonic()
    period = stop.sim.dt * stop.sim.substeps
    for frame in range(stop.frames):
        if frame and until is not None and time.monotonic() >= until:
            return
        yield frame
        if real_time:
            time.sleep(max(began + (frame + 1) * period - time.monotonic(), 0.0))


def _told(stop: Stop, path: Path) -> str:
    line = f"{stop.name:<8}{stop.worlds} {stop.title}: {stop.rate():,.0f} physics steps/s; {stop.told()}"
    try:
        _draw(stop, path)
    except MissingLibrary as missing:
        print(f"tightloop: no picture: {missing}", file=sys.stderr)
        return line
    return f"{line}; {path}"


def _draw(stop: Stop, path: Path) -> None:
    """A picture of what is to be seen now."""
    from tightloop.view import needs

    needs.check("PIL", "trimesh")
    from PIL import Image

    from tightloop.view.parts import parts
    from tightloop.view.picture import Picture
    from tightloop.view.source import Shown

    sim = stop.sim
    # computed here, so that no frame has to carry them
    body_q = sim.forward_kinematics(stop.state())
    look = parts(sim.info["scene"], sim.info["scene_folder"], sim.body_names)
    picture = Picture(look, *_SIZE)
    Image.fromarray(picture.render(Shown({"body_q": body_q}), goals=stop.goals())).save(path)


class _Page:
    """The page in the browser, which waits for the next daemon of its name when one ends."""

    def __init__(self, port: int) -> None:
        self._port, self._viewer = port, None

    def __enter__(self) -> _Page:
        return self

    def __exit__(self, *_: object) -> None:
        if self._viewer is not None:
            self._viewer.close()

    def show(self, name: str, worlds: int) -> None:
        """Open it, at the first stop."""
        if self._viewer is None:
            from tightloop.view.process import Viewer

            self._viewer = Viewer(name, port=self._port, worlds=256, open=True)
            print(f"the page is at {self._viewer.url}", flush=True)
