"""Films of a run as PNG, GIF, MP4 or HTML, without a display, from a simulation, a daemon or a recording."""

from __future__ import annotations

import contextlib
import math
import os
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tightloop.checks import advice
from tightloop.checks import arguments as checks
from tightloop.checks.signatures import checked_calls
from tightloop.errors import ArgumentError, DaemonLost, TightloopWarning, WaitTimeout
from tightloop.view import dependencies
from tightloop.view.arguments import check_camera, check_contacts, check_size, check_worlds
from tightloop.view.browser.display_options import Kind
from tightloop.view.cameras import Camera
from tightloop.view.encoders import Encoder, GifEncoder, Mp4Encoder, PngFile, PngFolder
from tightloop.view.parts import parts
from tightloop.view.picture import Picture
from tightloop.view.source import Live, Recorded, Source, is_recording
from tightloop.whole_files import place_of

if TYPE_CHECKING:
    from tightloop.sim.sim import Sim
    from tightloop.view.html import Html

#: Frame fields of a film.
FIELDS = ("body_q", "act", "contact_count", "contact_pos", "contact_force")
#: Default length of a film of a daemon [s].
LIVE_SECONDS = 5.0
# A paused daemon publishes its state only once.
_FIRST_SECONDS = 5.0
# Tolerance for rounding errors in sums of times.
_SLACK = 1e-6
Progress = Callable[[float], bool]
# Browsers slow down pictures of less than 20 ms.
_GIF_FPS_MAX = 50
_ENDINGS = (".png", ".gif", ".mp4", ".html")


@checked_calls
class Film:
    """Writes frames of a run into a picture or a film.

    A ``.png`` file is the first picture. ``.gif`` and ``.mp4`` files are films, and an ``.html`` file is a film that a
    browser shows from all sides. A name without an ending is a folder of PNG files. The CPU draws ``fps`` pictures per
    second of the run.

    The file appears, or replaces an existing one, when the film is complete: at `close`, or at the end of a ``with``
    block without an error. After an error there is no film, a warning reports it, and an existing file is unchanged.

    Attributes:
        pictures: Number of pictures so far.

    Args:
        out: The file or folder.
        sim: Simulation of the frames: a `Sim`, or anything with its ``info``.
        size: Width and height [pixels].
        fps: Pictures per second.
        worlds: How many worlds are shown, the first ones; or a list of them. A single one is ``world``.
        world: World that is shown alone, or that the camera ``"follow"`` follows.
        camera: ``"three-quarter"``, ``"front"``, ``"side"``, ``"top"``, ``"follow"``, or a `Camera`. If left out, it
            follows a single world whose robot floats, and else is ``"three-quarter"``.
        kind: ``"visual"``, or ``"collision"`` for collision shapes.
        contacts: Whether to draw contacts, if frames have ``contact_count``, ``contact_pos``, ``contact_force``. If
            left out, those of up to four worlds.
        speed: Seconds of the run per second of film.

    Raises:
        ArgumentError: An argument is not valid; the message names it.
        MissingLibrary: The library for this kind of file is not installed.
        OutputError: The file cannot be written.
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
        camera: str | Camera | None = None,
        kind: Kind = "visual",
        contacts: bool | None = None,
        speed: float = 1.0,
    ) -> None:
        path = checks.path("film: out", out, error=ArgumentError)
        if not path.parent.is_dir():
            raise ArgumentError(f"film: out is {path}, and there is no folder {path.parent}; make it first")
        self._fps = checks.number("film: fps", fps, above=0.0, error=ArgumentError)
        self._speed = checks.number("film: speed", speed, above=0.0, error=ArgumentError)
        check_camera("film", camera)
        check_worlds("film", worlds)
        size, contacts = check_size("film", size), check_contacts("film", contacts)
        if kind not in ("visual", "collision"):
            raise ArgumentError(f"film: kind is {kind!r}; give 'visual' or 'collision'")
        if not hasattr(sim, "info"):
            raise ArgumentError(
                f"film: sim is {sim!r:.80}; give a Sim, or the name of a daemon to `tightloop.view.film`"
            )
        info = sim.info
        self._period: float = info["dt"] * info["substeps"]
        self._camera, self._world, self._contacts = camera, world, contacts
        self._worlds = chosen_worlds(worlds, world, info["worlds"])
        self._page: Html | None = None
        self._encoder: Encoder | None = None
        seen = parts(info["scene"], info["scene_folder"], info["body_names"])
        #: Notes on what could not be drawn as in its file.
        self.notes: list[str] = list(seen.notes)
        if isinstance(worlds, int) and worlds > len(self._worlds):
            self.notes.append(f"{worlds} worlds were asked for, and {len(self._worlds)} can be seen")
        self._picture = Picture(seen, *size, kind=kind)
        if _ending(path) in _ENDINGS and not path.is_dir():
            place_of(path)
        if _ending(path) == ".html":
            dependencies.check("viser")
            from tightloop.view.html import Html

            bodies = len(info["body_names"])
            self._page = Html(path, seen, bodies, fps=self._fps, view=camera, kind=kind, contacts=contacts)
        else:
            self._encoder = _encoder(path, self._fps, size)
        self._single = _ending(path) == ".png"
        self._out = path
        self.pictures = 0
        self._time: float | None = None

    @property
    def spacing(self) -> float:
        """Time of the run between two pictures [s]."""
        return self._speed / self._fps

    @property
    def seconds(self) -> float:
        """Time of the run up to the last added frame [s]."""
        return self._time or 0.0

    def add(self, frame: Any, seconds: float | None = None, *, goals: Mapping[str, Any] | None = None) -> None:
        """Add the next frame.

        Args:
            frame: A `Frame`, a copy of one, or a `Shown`, with ``body_q`` of all shown worlds.
            seconds: Time since the frame before [s]; a control frame if left out. A picture is drawn when it is due,
                and repeated if frames are farther apart.
            goals: As of `Picture.render`; HTML shows no goals.
        """
        self._time = 0.0 if self._time is None else self._time + (self._period if seconds is None else seconds)
        more = self._reached(self._time) - self.pictures
        if more <= 0 or (self._single and self.pictures):
            return
        if self._page is not None:
            for _ in range(more):
                self._page.add(frame, self._worlds)
        else:
            assert self._encoder is not None
            pixels = self._picture.render(
                frame,
                worlds=self._worlds,
                camera=self._camera,
                world=self._world,
                contacts=self._contacts,
                goals=goals,
            )
            for _ in range(more):
                self._encoder.add(pixels)
        self.pictures += more

    def close(self) -> None:
        """Finish the file; a second call does nothing.

        Raises:
            OutputError: The file cannot be written; one that was there is unchanged.
        """
        if (made := self._take()) is not None:
            made.close()

    def discard(self) -> None:
        """Leave no film; a file that was there is unchanged. A folder keeps its pictures. After `close`, do nothing."""
        if (made := self._take()) is not None:
            made.discard()

    def __enter__(self) -> Film:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self.close()
            return
        lost = self.pictures if self._would_lose() else 0
        self.discard()
        if lost:
            # where warnings are errors, the user's own error is the one to see
            with contextlib.suppress(TightloopWarning):
                advice.warn(
                    f"film: {self._out} is not written, since {kind.__name__} ended it after {lost} picture(s); to "
                    "keep them, catch the error inside of the `with` block, or call close() there"
                )

    def _would_lose(self) -> bool:
        """Whether discarding loses pictures: a folder and a single picture have them already."""
        return self._page is not None or isinstance(self._encoder, GifEncoder | Mp4Encoder)

    def _take(self) -> Encoder | Html | None:
        """Return what is to be finished, once."""
        made = self._page or self._encoder
        self._page = self._encoder = None
        return made

    def _reached(self, seconds: float) -> int:
        """Return the number of pictures of a film of this length, with one at each end."""
        return int(seconds / self.spacing + _SLACK) + 1


@checked_calls
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
    """Make a film of a running daemon, or of a recording (``tightloop record``).

    Args:
        source: Name of a daemon, a `Sim`, or path of a recording, which ends in ``.tlrec``.
        out: As of `Film`.
        seconds: Length [s]: wall-clock time of a daemon, 5 s if left out; simulated time of a recording, all if left
            out. The film is shorter if the daemon ends first; a note reports it.
        at: Start of the film, or time of the picture, after the start of the recording [s]; of a daemon, from now.
        worlds: As of `Film`.
        world: As of `Film`.
        progress: Called after each frame with the filmed time [s]; the film ends when it returns False.
        **options: As of `Film`: ``size``, ``fps``, ``camera``, ``kind``, ``contacts``, ``speed``.

    Returns:
        The finished film.

    Raises:
        ArgumentError: An argument is not valid; the message names it.
        UnknownDaemon: No daemon of that name is running; the message lists those that are.
        RecordingError: The recording cannot be read.
        WaitTimeout: The daemon published no frame.
        OutputError: The file cannot be written; one that was there is unchanged.
    """
    at = 0.0 if at is None else checks.number("film: at", at, least=0.0, error=ArgumentError)
    if seconds is not None:
        seconds = checks.number("film: seconds", seconds, above=0.0, error=ArgumentError)
    single = _ending(checks.path("film: out", out, error=ArgumentError)) == ".png"
    check_worlds("film", worlds)
    world = checks.integer("film: world", world, least=0, error=ArgumentError)
    name = source if isinstance(source, str | os.PathLike) else source.name
    text = str(name)
    most = most_worlds(worlds, world)
    recorded = is_recording(text)
    watched: Live | Recorded = Recorded(text, most, FIELDS) if recorded else Live(text, most, FIELDS)
    try:
        if watched.worlds < most:
            # report a world that is not there
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
    """Add the frames of a recording from a time on."""
    frames = 0
    # one frame per control period; the picture at a time shows the last frame that began by then
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
    """Add the frames of a daemon in real time."""
    shown = source.poll(_FIRST_SECONDS)
    if shown is None:
        raise WaitTimeout(f"film: daemon `{source.info['name']}` has shown nothing for {_FIRST_SECONDS:g} s")
    began, spacing = time.monotonic() + at, made.spacing
    count = max(math.ceil(seconds / spacing - _SLACK), 1)
    while made.pictures < count:
        due = made.pictures
        try:
            while (wait := began + due * spacing - time.monotonic()) > 0:
                shown = source.poll(wait) or shown
        except DaemonLost as lost:
            if not made.pictures:
                raise
            made.notes.append(f"the film ends after {made.seconds:.3g} s: {lost}")
            break
        # if drawing is too slow, pictures repeat and the film keeps real time
        late = int((time.monotonic() - began) / spacing)
        made.add(shown, min(max(due, late), count - 1) * spacing - made.seconds)
        if not progress(made.seconds):
            break


def most_worlds(worlds: int | Sequence[int], world: int) -> int:
    """Return how many worlds a source must show."""
    world = checks.integer("film: world", world, least=0, error=ArgumentError)
    if isinstance(worlds, int):
        return max(checks.integer("film: worlds", worlds, least=1, error=ArgumentError), world + 1)
    return max([*worlds, world], default=0) + 1


def chosen_worlds(worlds: int | Sequence[int], world: int, there: int) -> list[int]:
    """Return the worlds to show.

    Raises:
        ArgumentError: A world does not exist; the message names it.
    """
    world = checks.integer("film: world", world, least=0, error=ArgumentError)
    if isinstance(worlds, int):
        count = min(checks.integer("film: worlds", worlds, least=1, error=ArgumentError), there)
        chosen = [world] if worlds == 1 else list(range(count))
    else:
        chosen = [checks.integer("film: an entry of worlds", each, least=0, error=ArgumentError) for each in worlds]
    for each in [*chosen, world]:
        if each >= there:
            raise ArgumentError(
                f"film: there is no world {each} for worlds or world to show; there are {there}, from 0 on"
            )
    if not chosen:
        raise ArgumentError("film: worlds is empty; give how many, or which ones")
    return chosen


def _ending(path: Path) -> str:
    """Return the ending of a file name in lower case."""
    return path.suffix.lower()


def _encoder(path: Path, fps: float, size: tuple[int, int]) -> Encoder:
    ending = _ending(path)
    if ending == "" or path.is_dir():
        return PngFolder(path)
    if ending not in _ENDINGS:
        raise ArgumentError(f"film: out is {path.name!r}; it ends in {', '.join(_ENDINGS)}, or is a folder")
    if ending == ".png":
        return PngFile(path)
    if ending == ".gif" and fps > _GIF_FPS_MAX:
        raise ArgumentError(f"film: fps is {fps:g}; a GIF has at most {_GIF_FPS_MAX}, give an .mp4 for more")
    return GifEncoder(path, fps) if ending == ".gif" else Mp4Encoder(path, fps, size)
