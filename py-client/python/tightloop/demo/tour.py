"""The tour: runs the demo's scenes one after the other, each with a line of results and a picture."""

from __future__ import annotations

import os
import secrets
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from tightloop.demo.scenes import DemoScene
from tightloop.errors import MissingLibrary
from tightloop.whole_files import whole_file

# Size of the pictures [pixels].
_SIZE = (1280, 720)
# Time per scene in the browser [s].
_SECONDS_SEEN = 15.0


@dataclass(frozen=True)
class Plan:
    """The options of a tour.

    Attributes:
        out: Folder of the pictures.
        seconds: Time per scene [s]; None is one round, and longer in the browser.
        view: Whether to show the scenes in the browser, in real time.
        port: Port of the page.
        device: Device of the physics, as of `tightloop.launch`.
        threads: Largest number of threads of a step; all cores if None.
    """

    out: Path
    seconds: float | None = None
    view: bool = False
    port: int = 8080
    device: str = "auto"
    threads: int | None = None


def tour(demo_scenes: Sequence[DemoScene], plan: Plan) -> None:
    """Run the demo's scenes.

    Raises:
        TightloopError: A daemon did not start, or ended.
    """
    plan.out.mkdir(parents=True, exist_ok=True)
    # one page follows the daemon by its name, from scene to scene
    name = f"demo-{os.getpid()}-{secrets.token_hex(2)}" if plan.view else None
    with _Page(plan.port) as page:
        for demo_scene in demo_scenes:
            demo_scene.open(name, plan.device, plan.threads)
            try:
                if name is not None:
                    page.show(name, demo_scene.worlds)
                print(_visit(demo_scene, plan), flush=True)
            finally:
                demo_scene.close()


def _visit(demo_scene: DemoScene, plan: Plan) -> str:
    """Stay at a stop; returns what there is to say."""
    seconds = _SECONDS_SEEN if plan.view and plan.seconds is None else plan.seconds
    until = None if seconds is None else time.monotonic() + seconds
    summary = None
    while summary is None or (until is not None and time.monotonic() < until):
        demo_scene.begin()
        for _ in _paced(demo_scene, until, real_time=plan.view):
            demo_scene.advance()
        # the summary of the first round: a later one may be cut short
        summary = summary or _visit_summary(demo_scene, plan.out / f"{demo_scene.name}.png")
    return summary


def _paced(demo_scene: DemoScene, until: float | None, *, real_time: bool) -> Iterator[int]:
    """Yield the frames of a round: at least one, and as many as there is time for."""
    began = time.monotonic()
    period = demo_scene.sim.dt * demo_scene.sim.substeps
    for frame in range(demo_scene.frames):
        if frame and until is not None and time.monotonic() >= until:
            return
        yield frame
        if real_time:
            time.sleep(max(began + (frame + 1) * period - time.monotonic(), 0.0))


def _visit_summary(demo_scene: DemoScene, path: Path) -> str:
    shown = f"{demo_scene.name:<7} {demo_scene.worlds} {demo_scene.title}"
    line = f"{shown}: {demo_scene.rate():,.0f} physics steps/s; {demo_scene.summary()}"
    try:
        _draw(demo_scene, path)
    except MissingLibrary as missing:
        print(f"tightloop: no picture: {missing}", file=sys.stderr)
        return line
    return f"{line}; {path}"


def _draw(demo_scene: DemoScene, path: Path) -> None:
    """Save a picture of the current frame."""
    from tightloop.view import dependencies

    dependencies.check("PIL")
    from PIL import Image

    from tightloop.view.parts import parts
    from tightloop.view.picture import Picture
    from tightloop.view.source import Shown

    sim = demo_scene.sim
    # computed here, so that frames need not carry them
    body_q = sim.forward_kinematics(demo_scene.state())
    look = parts(sim.info["scene"], sim.info["scene_folder"], sim.body_names)
    picture = Picture(look, *_SIZE)
    with whole_file(path) as part:
        Image.fromarray(picture.render(Shown({"body_q": body_q}), goals=demo_scene.goals())).save(part)


class _Page:
    """The page in the browser; when a daemon ends, it waits for the next one of the same name."""

    def __init__(self, port: int) -> None:
        self._port, self._viewer = port, None

    def __enter__(self) -> _Page:
        return self

    def __exit__(self, *_: object) -> None:
        if self._viewer is not None:
            self._viewer.close()

    def show(self, name: str, worlds: int) -> None:
        """Open the page for the first scene."""
        if self._viewer is None:
            from tightloop.sim.viewer_process import Viewer

            self._viewer = Viewer(name, port=self._port, worlds=256, open=True)
            print(f"the page is at {self._viewer.url}", flush=True)
