"""Films of a run without a display: PNG, GIF, MP4, HTML, from a simulation, a daemon or a recording."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tightloop import checks
from tightloop.errors import ArgumentError, WaitTimeout
from tightloop.view import needs
from tightloop.view.cameras import PRESETS, Camera
from tightloop.view.display_options import Kind
from tightloop.view.parts import parts
from tightloop.view.picture import Picture
from tightloop.view.rolls import Gif, Mp4, Png, Pngs, Roll
from tightloop.view.source import Live, Recorded, Source, is_recording

if TYPE_CHECKING:
    from tightloop.sim import Sim

#: What a film is made of.
FIELDS = ("body_q", "contact_count", "contact_pos", "contact_force")
#: How long a daemon is filmed [s], where nothing else is said.
LIVE_SECONDS = 5.0
# A daemon that rests shows its state once.
_FIRST_SECONDS = 5.0
# Sums of times are off by roundings.
_SLACK = 1e-6
Progress = Callable[[float], bool]
# Browsers slow pictures down that are shown more shortly than 20 ms.
_GIF_FPS_MAX = 50
_ENDINGS = (".png", ".gif", ".mp4", ".html")


class Film:
    """Frames of a run, as they are added, made into a file.

    ``.png`` is one picture, the first; ``.gif``, ``.mp4`` and ``.html``, which a browser shows from all sides, are
    films; a name without ending is a folder of PNG files. Pictures are drawn by the processor, ``fps`` for each second
    that the frames say.

    Attributes:
        pictures: How many there are by now.

    Args:
        out: The file, or folder.
        sim: What frames are of: a `Sim`, or anything with its ``info``.
        size: Width and height [pixels].
        fps: Pictures a second.
        worlds: How many worlds are seen, the first ones; or which ones. One is ``world``.
        world: The world that is seen alone, or that the camera ``"follow"`` goes along with.
        camera: ``"three-quarter"``, ``"front"``, ``"side"``, ``"top"``, ``"follow"``, or a `Camera`.
        kind: ``"visual"``, or ``"collision"`` for the shapes that touch.
        contacts: Whether contacts are drawn, where frames have ``contact_count``, ``contact_pos``, ``contact_force``.
        speed: Seconds of the run a second of film.

    Raises:
        ArgumentError: An argument is not valid; the message names it.
        MissingLibrary: What writes such a file is not installed.
    """

    def __init__(
        self,
        out: str | os.PathLike[str],
        sim: Sim | Source,
        *,
        size: tuple[int, int] = (640, 480),
        fps: float = 30.0,
        worlds: int | Sequence[int] = 1,
        world: int = 0,
        camera: str | Camera = "three-quarter",
        kind: Kind = "visual",
        contacts: bool = True,
        speed: float = 1.0,
    ) -> None:
        path = checks.path("film: out", out, error=ArgumentError)
        if not path.parent.is_dir():
            raise ArgumentError(f"film: out is {path}, and there is no folder {path.parent}; make it first")
        self._fps = checks.number("film: fps", fps, above=0.0, error=ArgumentError)
        self._speed = checks.number("film: speed", speed, above=0.0, error=ArgumentError)
        if not isinstance(camera, Camera) and camera not in PRESETS:
            raise ArgumentError(f"film: camera is {camera!r}; give a Camera or one of: {', '.join(PRESETS)}")
        if kind not in ("visual", "collision"):
            raise ArgumentError(f"film: kind is {kind!r}; give 'visual' or 'collision'")
        info = sim.info
        self._period: float = info["dt"] * info["substeps"]
        self._camera, self._world, self._contacts = camera, world, contacts
        self._worlds = chosen_worlds(worlds, world, info["worlds"])
        self._page: Any = None
        self._roll: Roll | None = None
        seen = parts(info["scene"], info["scene_folder"], info["body_names"])
        #: What could not be drawn as its file has it.
        self.notes: list[str] = list(seen.notes)
        if isinstance(worlds, int) and worlds > len(self._worlds):
            self.notes.append(f"{worlds} worlds were asked for, and {len(self._worlds)} can be seen")
        self._picture = Picture(seen, *size, kind=kind)
        if _ending(path) == ".html":
            needs.check("viser", "trimesh")
            from tightloop.view.html import Html

            bodies = len(info["body_names"])
            self._page = Html(path, seen, bodies, fps=self._fps, view=camera, kind=kind, contacts=contacts)
        else:
            self._roll = _roll(path, self._fps, size)
        self._single = _ending(path) == ".png"
        self.pictures = 0
        self._time: float | None = None

    @property
    def spacing(self) -> float:
        """Time of the run from picture to picture [s]."""
        return self._speed / self._fps

    @property
    def seconds(self) -> float:
        """Time of the run that was added, up to its last frame [s]."""
        return self._time or 0.0

    def add(self, frame: Any, seconds: float | None = None, *, goals: Mapping[str, Any] | None = None) -> None:
        """Add the next frame.

        Args:
            frame: A `Frame`, a copy of one, or a `Shown`, with ``body_q`` of all worlds that are seen.
            seconds: Time since the frame before [s]; a control frame if left out. Where a picture is due it is drawn;
                where frames are farther apart, it stands.
            goals: As `Picture.render` has them; the HTML shows none.
        """
        self._time = 0.0 if self._time is None else self._time + (self._period if seconds is None else seconds)
        more = self._reached(self._time) - self.pictures
        if more <= 0 or (self._single and self.pictures):
            return
        if self._page is not None:
            for _ in range(more):
                self._page.add(frame, self._worlds)
        else:
            assert self._roll is not None
            pixels = self._picture.render(
                frame,
                worlds=self._worlds,
                camera=self._camera,
                world=self._world,
                contacts=self._contacts,
                goals=goals,
            )
            for _ in range(more):
                self._roll.add(pixels)
        self.pictures += more

    def close(self) -> None:
        """Finish the file; a second time does nothing."""
        for kept in (self._roll, self._page):
            if kept is not None:
                kept.close()
        self._roll = self._page = None

    def __enter__(self) -> Film:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _reached(self, seconds: float) -> int:
        """Pictures that a film of this length has; a picture at each end."""
        return int(seconds / self.spacing + _SLACK) + 1


def film(
    source: str | os.PathLike[str] | Sim,
    out: str | os.PathLike[str],
    *,
    seconds: float | None = None,
    at: float | None = None,
    worlds: int | Sequence[int] = 1,
    world: int = 0,
    progress: Progress | None = None,
    **options: Any,
) -> Film:
    """Film a daemon as it runs, or a recording (``tightloop record``).

    Args:
        source: Name of a daemon, a `Sim`, or path of a recording, which ends in ``.tlrec``.
        out: As of `Film`.
        seconds: How long: of a daemon time as it passes, 5 s if left out; of a recording simulated time, all of it if
            left out.
        at: When the film begins, or the picture is taken, after the recording's begin [s]; of a daemon, from now.
        worlds: As of `Film`.
        world: As of `Film`.
        progress: Called with the time that was filmed [s], frame by frame; the film ends where it returns False.
        **options: As of `Film`: ``size``, ``fps``, ``camera``, ``kind``, ``contacts``, ``speed``.

    Returns:
        The film, finished.

    Raises:
        ArgumentError: An argument is not valid; the message names it.
        UnknownDaemon: No daemon of that name is running; the message lists those that are.
        RecordingError: The recording cannot be read.
        WaitTimeout: The daemon shows nothing.
    """
    at = 0.0 if at is None else checks.number("film: at", at, least=0.0, error=ArgumentError)
    if seconds is not None:
        seconds = checks.number("film: seconds", seconds, above=0.0, error=ArgumentError)
    single = _ending(Path(os.fspath(out))) == ".png"
    name = source if isinstance(source, str | os.PathLike) else source.name
    text = os.fspath(name)
    most = most_worlds(worlds, world)
    recorded = is_recording(text)
    watched: Live | Recorded = Recorded(text, most, FIELDS) if recorded else Live(text, most, FIELDS)
    try:
        if watched.worlds < most:
            # who is not seen is refused by name
            chosen_worlds(worlds, world, watched.worlds)
        with Film(out, watched, worlds=worlds, world=world, **options) as made:
            told = progress or (lambda _: True)
            if isinstance(watched, Recorded):
                _play(watched, made, at, 0.0 if single else seconds, told)
            else:
                _watch(watched, made, at, 0.0 if single else seconds or LIVE_SECONDS, told)
            return made
    finally:
        watched.close()


def _play(source: Recorded, made: Film, at: float, seconds: float | None, progress: Progress) -> None:
    """A recording's frames, from a time on."""
    frames = 0
    # a frame a control period from its begin on; the last one that began by then is what is seen at a time
    begin = int(at / source.period + _SLACK)
    while (shown := source.poll()) is not None:
        if frames >= begin:
            made.add(shown)
            done = seconds is not None and made.seconds + source.period > seconds - _SLACK * source.period
            if not progress(made.seconds) or done:
                break
        frames += 1
    if not made.pictures:
        ends = (frames - 1) * source.period
        raise ArgumentError(f"film: at is {at:g} s, and the recording ends after {ends:.6g} s")


def _watch(source: Live, made: Film, at: float, seconds: float, progress: Progress) -> None:
    """What a daemon shows, as time passes."""
    shown = source.poll(_FIRST_SECONDS)
    if shown is None:
        raise WaitTimeout(f"film: daemon `{source.info['name']}` has shown nothing for {_FIRST_SECONDS:g} s")
    began, spacing = time.monotonic() + at, made.spacing
    count = max(math.ceil(seconds / spacing - _SLACK), 1)
    while made.pictures < count:
        due = made.pictures
        while (wait := began + due * spacing - time.monotonic()) > 0:
            shown = source.poll(wait) or shown
        # where drawing takes longer than there is time, pictures stand, and the film keeps the pace
        late = int((time.monotonic() - began) / spacing)
        made.add(shown, min(max(due, late), count - 1) * spacing - made.seconds)
        if not progress(made.seconds):
            break


def most_worlds(worlds: int | Sequence[int], world: int) -> int:
    """How many worlds a source must show."""
    world = checks.integer("film: world", world, least=0, error=ArgumentError)
    if isinstance(worlds, int):
        return max(checks.integer("film: worlds", worlds, least=1, error=ArgumentError), world + 1)
    return max([*worlds, world], default=0) + 1


def chosen_worlds(worlds: int | Sequence[int], world: int, there: int) -> list[int]:
    """Which worlds are seen, of so many.

    Raises:
        ArgumentError: One is not there; the message names it.
    """
    world = checks.integer("film: world", world, least=0, error=ArgumentError)
    if isinstance(worlds, int):
        count = min(checks.integer("film: worlds", worlds, least=1, error=ArgumentError), there)
        chosen = [world] if worlds == 1 else list(range(count))
    else:
        chosen = [checks.integer("film: an entry of worlds", each, least=0, error=ArgumentError) for each in worlds]
    for each in [*chosen, world]:
        if each >= there:
            raise ArgumentError(f"film: there is no world {each} to be seen; there are {there}, from 0 on")
    if not chosen:
        raise ArgumentError("film: worlds is empty; give how many, or which ones")
    return chosen


def _ending(path: Path) -> str:
    """What kind of file it is to be: also of a name in capitals."""
    return path.suffix.lower()


def _roll(path: Path, fps: float, size: tuple[int, int]) -> Roll:
    ending = _ending(path)
    if ending == "" or path.is_dir():
        return Pngs(path)
    if ending not in _ENDINGS:
        raise ArgumentError(f"film: out is {path.name!r}; it ends in {', '.join(_ENDINGS)}, or is a folder")
    if ending == ".png":
        return Png(path)
    if ending == ".gif" and fps > _GIF_FPS_MAX:
        raise ArgumentError(f"film: fps is {fps:g}; a GIF has at most {_GIF_FPS_MAX}, give an .mp4 for more")
    return Gif(path, fps) if ending == ".gif" else Mp4(path, fps, size)
