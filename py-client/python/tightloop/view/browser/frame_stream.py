"""The frames that a page shows, from a running daemon or a recording, each with the driver that advances it."""

from __future__ import annotations

import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from tightloop.sim.launching import attach
from tightloop.view.browser.live_driver import LiveDriver
from tightloop.view.browser.player import Player
from tightloop.view.source import CONTACT_FIELDS, Live, Recorded, is_recording

#: Up to this many worlds are shown at the daemon's rate, more worlds at half of it.
FEW_WORLDS = 16
# At 60 frames per second, the frame after the next has arrived after this time.
_EVERY_OTHER_SECONDS = 0.036
# Without a page open, the daemon is checked this often.
_THERE_SECONDS = 1.0
#: Fields of every frame; contacts and plots ask for more.
FIELDS = ("body_q", "body_qd", "joint_q", "joint_target_q", "act")


class LiveStream:
    """Frames of a daemon as observers see them.

    Args:
        name: Name of the daemon.
        worlds: The most worlds to show.

    Raises:
        UnknownDaemon: No daemon of that name is running; the message lists those that are.
    """

    def __init__(self, name: str, worlds: int) -> None:
        self._name = name
        self._most = worlds
        self._fields = frozenset(FIELDS)
        self._newest: Any = None
        self._seen = time.monotonic()
        self._source = Live(name, worlds, FIELDS)
        self.info: dict[str, Any] = self._source.info
        self.worlds: int = self._source.worlds
        #: Notes on what is shown.
        self.notes: list[str] = []
        if self.worlds < min(worlds, self.info["worlds"]):
            cure = "launch(watch_worlds=…) or serve --watch-worlds let it show more"
            self.notes.append(f"the daemon shows its first {self.worlds} worlds of {self.info['worlds']}; {cure}")
        self.driver = LiveDriver(attach(self.info["name"]), lambda: self._newest)

    @property
    def came(self) -> float:
        """When the newest frame arrived, on the monotonic clock [s]."""
        return self._source.came

    def poll(self, timeout: float) -> Any:
        """Return the newest frame, or None if none arrives within ``timeout`` [s].

        Raises:
            DaemonLost: The daemon went away.
        """
        patience = 0.0
        if self.worlds > FEW_WORLDS:
            patience = max(self.came + _EVERY_OTHER_SECONDS - time.monotonic(), 0.0)
        shown = self._source.poll(timeout, patience)
        if shown is not None:
            self._newest = shown
        return shown

    def want(self, fields: Iterable[str]) -> None:
        """Add fields to all later frames."""
        wanted = self._fields | set(fields)
        if wanted != self._fields:
            before = self._source
            self._source = Live(self._name, self._most, tuple(sorted(wanted)))
            self._fields = wanted
            before.close()

    def rest(self) -> None:
        """Ask the daemon for no frames until the next `poll`; only check that it runs.

        Raises:
            DaemonLost: The daemon went away.
        """
        self._source.rest()
        now = time.monotonic()
        if now - self._seen > _THERE_SECONDS:
            self._seen = now
            self.driver.check()

    def close(self) -> None:
        """Detach from the daemon, which keeps running."""
        self.driver.close()
        self._source.close()


class RecordedStream:
    """Frames of a recording.

    Args:
        path: The file.
        worlds: The most worlds to show.
    """

    def __init__(self, path: str, worlds: int) -> None:
        self._path = str(Path(path).expanduser().absolute())
        self._most = worlds
        # a recording is read once, so every field that an option may need is evaluated
        self._fields = frozenset((*FIELDS, *CONTACT_FIELDS))
        first = self._open()
        self.info: dict[str, Any] = first.info
        self.worlds: int = first.worlds
        self.notes: list[str] = [] if first.note is None else [first.note]
        first.close()
        self.driver = Player(self._open)
        #: When the newest frame arrived, on the monotonic clock [s].
        self.came = time.monotonic()

    def _open(self) -> Recorded:
        return Recorded(self._path, self._most, tuple(sorted(self._fields)))

    def poll(self, timeout: float) -> Any:
        """Return the frame that is due, or None if none is within ``timeout`` [s]."""
        shown = self.driver.poll(timeout)
        self.came = time.monotonic()
        return shown

    def want(self, fields: Iterable[str]) -> None:
        """Add fields to all later frames; a recording then restarts."""
        wanted = self._fields | set(fields)
        if wanted != self._fields:
            self._fields = wanted
            self.driver.reset(None)

    def rest(self) -> None:
        """Do nothing: a recording does not play between two polls."""

    def close(self) -> None:
        """Close the file."""
        self.driver.close()


FrameStream = LiveStream | RecordedStream


def open_stream(target: str, worlds: int) -> FrameStream:
    """Open the frame stream of a daemon's name or a recording's path, with at most ``worlds`` worlds."""
    return RecordedStream(target, worlds) if is_recording(target) else LiveStream(target, worlds)
